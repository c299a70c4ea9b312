"""Asking a board for some seconds. Changes nothing on it but that its stream is stopped afterwards."""

from __future__ import annotations

import os

from ..errors import BiotacError, PortError
from ..hand.hand import Hand
from ..hand.opening import open as open_board
from ..wire.batches import join
from ..wire.sensor_gen import MAX_SENSORS
from .facts import BoardFacts, Facts
from .system import look


def examine(port: str | None, *, seconds: float = 3.0, expected_fingers: int | None = None) -> Facts:
    """All facts of ``port``, of the only board without one; errors become facts."""
    system = look(port)
    device = port
    if port is None or port.startswith("serial:"):
        number = None if port is None else port.removeprefix("serial:").upper()
        fitting = [b.device for b in system.boards if number in (None, (b.serial_number or "").upper())]
        device = fitting[0] if len(fitting) == 1 else None
        if device is None and number is not None and system.boards:
            there = ", ".join(f"serial:{b.serial_number}" for b in system.boards)
            error = PortError(f"no board has serial number {number}; there is {there}")
            return Facts(port, system, error, None, expected_fingers)
    if device is None:
        return Facts(None, system, None, None, expected_fingers)
    try:
        # A simulated board's own time at its own pace, unless its PORT says otherwise.
        with open_board(device, pace=1.0) as hand:
            return Facts(device, system, None, listen(hand, seconds), expected_fingers)
    except BiotacError as error:
        return Facts(device, system, error, None, expected_fingers)


def listen(hand: Hand, seconds: float) -> BoardFacts:
    """Counters, then a stream, then the counters again."""
    told = [hand.sensor_info(finger) for finger in range(MAX_SENSORS)]
    sensors = [its for its in told if any(its.serial)]
    hand.sync()
    before = hand.status()
    sensors_before = [hand.sensor_status(finger) for finger in range(MAX_SENSORS)]
    batches = []
    for _ in range(2):
        batches.append(hand.read_batch(seconds / 2))
        hand.sync()
    hand.stop()
    batch = join(batches)
    return BoardFacts(
        hello=hand.info,
        sensors=sensors,
        before=before,
        after=hand.status(),
        sensors_before=sensors_before,
        sensors_after=[hand.sensor_status(finger) for finger in range(MAX_SENSORS)],
        frames=batch.frames,
        idle=batch.idle,
        stats=hand.stats,
        clock=hand.clock.now() if has_crystal(hand) else None,
        clock_resets=hand.clock.resets,
        warnings=hand.warnings,
    )


def has_crystal(hand: Hand) -> bool:
    """Behind a pty is a program: its time waits for the computer, and is no clock."""
    return hand.link.source is None and not os.path.realpath(hand.port).startswith("/dev/pts/")
