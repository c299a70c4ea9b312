"""Queries a board for some seconds. The board's state is unchanged, except that its stream is stopped afterwards."""

from __future__ import annotations

import os
from collections.abc import Callable
from contextlib import suppress

from ..errors import BiotacError, CommandRefusedError, PortError
from ..hand.hand import Hand
from ..hand.opening import open as open_board
from ..link.discovery import SERIAL_PREFIX
from ..wire.batches import join
from ..wire.sensor_gen import MAX_SENSORS
from .facts import ExaminedBoard, Facts
from .system import device_of, look


def examine(
    port: str | None,
    *,
    seconds: float = 3.0,
    expected_fingers: int | None = None,
    take_link: bool = False,
    by: Callable[[Hand], ExaminedBoard] | None = None,
) -> Facts:
    """All facts about ``port``, or about the only board if ``port`` is None; errors become facts.

    ``take_link``: from the host at the board's other port. ``by``: gets them from a hand that reconnects, in place of
    ``listen`` for some seconds.
    """
    system = look(port)
    device = device_of(port, system.boards)
    if device is None and port is not None and system.boards:
        serials = ", ".join(f"{SERIAL_PREFIX}{b.serial_number}" for b in system.boards)
        number = port.removeprefix(SERIAL_PREFIX).upper()
        return Facts(port, system, PortError(f"no board has serial number {number}; expected one of {serials}"))
    if device is None:
        return Facts(None, system)
    try:
        # pace=1.0: a simulated board runs in real time, unless its PORT says otherwise.
        with open_board(device, pace=1.0, reconnect=by is not None) as hand:
            if device.startswith("replay:"):
                text = "is a recording, no board: `biotac check FILE` verifies it, `biotac info FILE` lists losses"
                return Facts(device, system, PortError(f"{device} {text}"))
            if take_link:
                hand.take_link()
            return Facts(device, system, None, by(hand) if by else listen(hand, seconds), expected_fingers)
    except BiotacError as error:
        return Facts(device, system, error)


def listen(hand: Hand, seconds: float) -> ExaminedBoard:
    """Counters, then a stream, then the counters again."""
    infos = [hand.sensor_info(finger) for finger in range(MAX_SENSORS)]
    hand.sync()
    before = hand.status()
    sensors_before = [hand.sensor_status(finger) for finger in range(MAX_SENSORS)]
    batches = []
    for _ in range(2):
        batches.append(hand.read_batch(seconds / 2))
        hand.sync()
    hand.stop()
    batch = join(batches)
    chip = None
    with suppress(CommandRefusedError):
        chip = hand.board.measure()  # after the stream: an emulated board's time begins with it
    return ExaminedBoard(
        hello=hand.info,
        sensors=[info for info in infos if any(info.serial)],
        before=before,
        after=hand.status(),
        sensors_before=sensors_before,
        sensors_after=[hand.sensor_status(finger) for finger in range(MAX_SENSORS)],
        frames=batch.frames,
        pac=batch.pac,
        idle=batch.idle,
        stats=hand.stats,
        clock=hand.clock.now() if has_crystal(hand) else None,
        clock_resets=hand.clock.resets,
        warnings=hand.warnings,
        chip=chip,
    )


def has_crystal(hand: Hand) -> bool:
    """Whether the board has a real clock: behind a pty is a program, and its time waits for the computer."""
    return hand.link.source is None and not os.path.realpath(hand.port).startswith("/dev/pts/")
