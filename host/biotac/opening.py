"""Opening a board: link, handshake, and what a simulated board is given before its time starts."""

from __future__ import annotations

import os

from . import _wire as wire
from .hand import Hand
from .link import Link, open_link


def open(port: str | os.PathLike[str], *, pace: float = 0.0) -> Hand:
    """Open a board and shake hands.

    ``port`` is a device path (``/dev/ttyACM0``, ``COM3``), ``spidev:0.0,0.1`` for sensors on this computer's
    own SPI bus, one BUS.DEVICE a finger, or ``sim:SOURCE`` for a simulated board,
    where SOURCE is a scenario (``press.toml``) or a recording of counts (``.npz``, ``.btd``), or
    ``emu:pico?source=SOURCE`` for the board's own flash image in an emulator, playing the same.
    ``replay:press.mcap?from=12.5&to=20`` plays a recording, or that part of it: the board's stream again, while
    commands that would change a board raise CommandRefusedError.
    ``pace`` is for simulated and emulated boards and recordings: device seconds per second, 0 for as fast as
    this side reads.

    Raises PortError, NotAGatewayError, WireVersionError, or InputError for a source or a recording that
    cannot be played.
    """
    return shake_hands(open_link(os.fspath(port), pace=pace))


def shake_hands(link: Link) -> Hand:
    """Make a Hand of an open link.

    A simulated board gets its source's settings (an emulated finger's own gains) and stored tare
    first, as a real one would from its user. Closes the link when that fails.
    """
    hand = Hand(link)
    source = link.source
    if source is None:
        return hand
    try:
        for name, value in source.settings.items():
            hand.set_setting(wire.Setting[name.upper()], value)
        if source.tare_q4 is not None:
            for finger, tare_q4 in enumerate(source.tare_q4):
                hand.set_tare(finger, tare_q4 / 16.0)
    except BaseException:
        hand.close()
        raise
    return hand
