"""Checks whether everything arrived, and when."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..hand.faults import faults_of
from ..hand.views import DEFAULT_NAMES
from ..wire import messages_gen as wire
from ..wire import sensor_gen as sensor
from .catalogue import Finding
from .facts import ExaminedBoard, grown

#: A crystal stays within 100 ppm over age and temperature.
CRYSTAL_PPM = 100.0
RP2040, REVISION_B2 = 0x0002927, 2  # SYSINFO_CHIP_ID, data sheet 2.20
RP2350, REVISION_A2 = 0x0004927, 2  # the same, data sheet 12.15
#: Slots are timed by the board's own clock: 1 % off cannot be rounding.
RATE_SHARE = 0.01


def check(board: ExaminedBoard, *, fed: bool = False) -> Iterator[Finding]:
    """An early chip, restarts, latched faults, late slots, losses on either side, slot rate, clock drift.

    ``fed``: the sensors are a sensor board's.
    """
    chip_id = board.chip.chip_id if board.chip is not None else 0
    if chip_id & 0x0FFFFFFF == RP2040 and chip_id >> 28 < REVISION_B2:
        yield Finding("chip_old", f"chip id 0x{chip_id:08X}; from B2 on its first digit is 2")
    if chip_id & 0x0FFFFFFF == RP2350 and chip_id >> 28 <= REVISION_A2 and len(board.present) < sensor.MAX_SENSORS:
        yield Finding("chip_floats", f"chip id 0x{chip_id:08X}: RP2350 A2 or older; later ones begin with more than 2")
    if board.after.uptime_s < board.before.uptime_s or board.stats.disordered:
        yield Finding("board_restarted", f"it has been up for {board.after.uptime_s} s")
        return  # the counters restarted and show nothing
    earlier = replace(board.before, faults=board.before.faults & ~wire.FaultFlags.STARTED)  # set on every board
    if fed:  # a sensor board is silent until it has a tape
        earlier = replace(earlier, finger_faults=(0,) * sensor.MAX_SENSORS)
    if faults := faults_of(earlier, DEFAULT_NAMES):
        yield Finding("faults_latched", str(faults).replace("\n", "; "))
    for counter, text in (("slots_late", "slots were too late"), ("messages_dropped", "messages did not fit the link")):
        if more := grown(board.before, board.after, counter):
            yield Finding(counter, f"{more} {text}")
    if board.stats.frames_lost or board.stats.pac_lost:
        seen = f"{board.stats.frames_lost} frames and {board.stats.pac_lost} PAC blocks are missing"
        yield Finding("frames_lost", seen)
    if board.stats.crc_errors or board.stats.other_errors:
        seen = f"{board.stats.crc_errors} frames with a bad CRC, {board.stats.other_errors} otherwise damaged"
        yield Finding("bytes_damaged", seen)
    for finger in board.present:
        rate = slots_per_s(board, finger)
        if rate is not None and abs(rate / board.hello.slot_hz - 1) > RATE_SHARE:
            yield Finding("rate_wrong", f"finger {finger}: {rate:.0f} samples a second, expected {board.hello.slot_hz}")
    if board.clock is None:
        return
    if board.clock_resets:
        yield Finding("clock_jumped", f"{board.clock_resets} jump(s)")
    drift_ppm, bound_ppm = board.clock.drift_ppm, board.clock.drift_uncertainty_ppm
    if board.clock.known and abs(drift_ppm) - bound_ppm > CRYSTAL_PPM:
        seen = f"{drift_ppm:+.0f} ppm, +/- {bound_ppm:.0f} ppm; up to {CRYSTAL_PPM:.0f} ppm is normal"
        yield Finding("clock_drift", seen)


def slots_per_s(board: ExaminedBoard, finger: int) -> float | None:
    """Slots per second of a finger by the board's own clock; None with less than two rounds, or without a bus.

    The median over consecutive frames and heartbeats: rounds without a good word are not numbered and leave holes.
    """
    rounds = [rows[["seq", "t_us"]][rows["finger"] == finger] for rows in (board.frames, board.idle)]
    seq, t_us = (np.concatenate([r[name] for r in rounds]) for name in ("seq", "t_us"))
    order = np.argsort(t_us)
    steps, times_us = np.diff(seq[order]), np.diff(t_us[order])
    good = (steps > 0) & (times_us > 0)
    if not good.any() or board.hello.board == wire.BoardKind.MESSAGES:
        return None
    return float(np.median(steps[good] * len(sensor.SLOTS) / (times_us[good] / 1e6)))
