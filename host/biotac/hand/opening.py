"""Opening a board: the link, the handshake, and a simulated board's inputs before time starts."""

from __future__ import annotations

import os
from collections.abc import Mapping
from typing import Any

from ..errors import NotAGatewayError
from ..keep import Calibration, harness
from ..link import Link, open_link
from ..link.discovery import choose
from ..wire import messages_gen as wire
from ..wire.frames import Q4_PER_COUNT
from .hand import MAX_AGE_S, Hand


def open(
    port: str | os.PathLike[str] | None = None,
    *,
    pace: float = 0.0,
    reconnect: bool = False,
    fingers: Mapping[str, int] | None = None,
    max_age_s: float = MAX_AGE_S,
) -> Hand:
    """Open a board, shake hands, and read it from now on.

    Without ``port``, opens the only board on USB, found by its USB ids; no other port is opened. ``port`` is
    ``serial:E6605838831F5B2C``, a board's serial number; a device path (``/dev/ttyACM0``, ``COM3``); ``spidev:0.0,0.1``
    for sensors on this computer's own SPI bus, one BUS.DEVICE per finger (``?calibration=1:0x50:24c02``, one for each,
    loads the calibrations stored in the EEPROMs on their harnesses); ``sim:SOURCE`` for a simulated board, where SOURCE
    is a scenario (``press.toml``) or a recording of counts (``.npz``, ``.btd``); or ``emu:pico?source=SOURCE`` for the
    board's own flash image in an emulator, playing the same. ``replay:press.mcap?from=12.5&to=20`` plays a recording,
    or that part of it: the board's stream again, while commands that would change a board raise CommandRefusedError.
    ``uart:DEVICE?baud=N`` is a board's UART, ``bag:FILE``, ``csv:FILE?columns=FILE.toml`` and
    ``foxglove://HOST:PORT/topic`` are counts that another driver published (host/docs/guides/owners.md).
    ``socket://HOST:PORT`` or ``rfc2217://HOST:PORT`` a serial port on the network, and ``zenoh:NAME`` a board that
    another computer shares. ``pace`` is for simulated and emulated boards and recordings: device seconds per second, or
    0 for as fast as this side reads.

    With ``reconnect``, a board that went away is looked for, by its serial number, until it is back. Then the session's
    changes (settings, calibrations, maps, subscriptions) are restored, the stream resumes, and the first batch
    with rows has a ``biotac.Gap`` in the messages. Without it, and for spidev, DeviceLostError is raised. ``fingers``
    names chip selects 0..4 for ``hand["thumb"]``; the default names are index, middle, ring, little, thumb. A finger's
    latest values are shown until they are ``max_age_s`` old, and are NaN from then on.

    Raises PortError, NotAGatewayError or WireVersionError; InputError for a source or a recording that cannot be
    played, or an EEPROM without a calibration; CommandRefusedError for a calibration of another sensor.
    """
    text = choose() if port is None else os.fspath(port)
    if text.startswith("spidev:"):
        bare, own = harness.load(text)
        return shake_hands(open_link(bare, pace=pace), fingers=fingers, max_age_s=max_age_s, calibrations=own)
    return shake_hands(open_link(text, pace=pace), reconnect=reconnect, fingers=fingers, max_age_s=max_age_s)


def shake_hands(link: Link, *, calibrations: Mapping[int, Calibration] | None = None, **options: Any) -> Hand:
    """Make a Hand with these ``options`` from an open link, and give it each finger's calibration.

    A simulated board gets the source's stored tare, as a user gives one to a real board. Closes the link when any of
    this fails.
    """
    try:
        hand = Hand(link, **options)
    except BaseException:
        link.close()
        raise
    source = link.source
    try:
        if hand.info.board == wire.BoardKind.PICO_SENSOR:
            raise NotAGatewayError(
                f"{link.port} is a sensor board, not a gateway: feed it with `biotac sim SOURCE --sensor-port "
                f"{link.port}`, and open the port of the gateway it is wired to"
            )
        if hand.info.board == wire.BoardKind.POSIX_LIVE:
            link.follow_loads()
        for finger, calibration in (calibrations or {}).items():
            hand.board.set_calibration(finger, calibration)
        if source and source.tare_q4 is not None:
            for finger, tare_q4 in enumerate(source.tare_q4):
                hand.set_tare(finger, tare_q4 / Q4_PER_COUNT)
    except BaseException:
        hand.close()
        raise
    return hand
