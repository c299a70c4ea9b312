"""Checks tares, and each channel: no word, the end of the range, always the same, or a fault that the board found."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ..wire import messages_gen as wire
from ..wire.native import lib
from ..wire.sensor_gen import ELECTRODE_NAMES
from .catalogue import Finding
from .facts import ExaminedBoard

#: The limits of FrameFlags.RAIL.
RAIL_LOW, RAIL_HIGH = 0, lib.BT_THRESHOLD_RAIL_COUNT

# For how many rounds until the end a channel must have one and the same count. An electrode with 0.45 counts of noise,
# the quietest seen, does so for 100 once in 10^13 tries; TDC, which is slow, did so for 280 in one of 1000 tries.
STUCK_ROUNDS = 100
STUCK_TDC_ROUNDS = 280

# Two electrodes that moved by the same amount, and never differed by more than an eighth of it, are one: the closest of
# the public recordings differed by half of it. Mirror images pressed on the midline may differ by less, but not as
# little as two readings of one voltage: over so many rounds their mean differs by no more than 5 sigma, a settling
# converter's counts, and the voltage's motion within a round. The half second in which a press begins is too short.
SAME_MOVED_COUNTS = 40.0
SAME_SHARE = 8.0
SAME_ROUNDS, SAME_SETTLING_COUNTS = 25, 2.0

# With one analog-to-digital converter every electrode still has noise of its own: over so many rounds no two of the
# public recordings' moved by that much and stayed within 13 counts of their distance.
COPIED_COUNTS = 1.0

# In 46 000 rounds of two real fingers, pressed with up to 10 N all over, compressed skin lowered an electrode's count
# by up to 2729, and bulging skin raised it by up to 849.
RISE_COUNTS, RISE_ROUNDS = 1000, 25

# The finding's code, by the board's own (SENSOR_STATUS). RAILED and MISSING electrodes show in the frames.
ELECTRODE_FAULTS = {
    wire.SensorFault.ALONE: "electrode_alone",
    wire.SensorFault.STUCK: "channel_stuck",
    wire.SensorFault.NOISY: "channel_noisy",
}
SENSOR_FAULTS = {
    wire.SensorFault.FROZEN: "sensor_frozen",
    wire.SensorFault.TOGETHER: "electrodes_shifted",
    wire.SensorFault.EXCHANGED: "sensor_exchanged",
    wire.SensorFault.SILENT: "electrodes_silent",
    wire.SensorFault.OTHER_KIND: "wrong_sensor",
}

# Presses of real fingers move the static pressure by 50 to 120 counts a newton. Without a calibration a press at the
# side reads two to three times too large, more than its interval has.
PRESSED_N, PRESSED_ROUNDS, LOW_PDC_PER_N = 1.0, 50, 35.0


def check(board: ExaminedBoard) -> Iterator[Finding]:
    """The tares; then electrodes, PDC, TDC, TAC and PAC of the fingers that sent frames."""
    for finger in board.present:
        yield from _tare(board, finger)
        yield from _pressure(board, finger)
        yield from _rises(board, finger)
    for finger in board.present:
        found = dict(_by_the_board(board.sensors_after[finger]))
        if "sensor_frozen" not in found:
            channels = _channels(board, finger)
            if board.hello.board == wire.BoardKind.MESSAGES:  # a channel that was never sent is no fault of a sensor
                channels = {name: counts for name, counts in channels.items() if (counts != wire.INVALID_COUNT).any()}
            for code, names in _channel_faults(channels).items():
                found[code] = list(dict.fromkeys(names + found.get(code, [])))
        for code, names in found.items():
            if names:
                yield Finding(code, f"finger {finger}: {', '.join(names)}")


def _by_the_board(state: wire.SensorStatus) -> Iterator[tuple[str, list[str]]]:
    """The board's own findings: the codes, and the electrodes they are about."""
    if code := SENSOR_FAULTS.get(wire.SensorFault(state.sensor_fault)):
        yield code, ["every channel"]
    elif code := ELECTRODE_FAULTS.get(wire.SensorFault(state.electrode_fault)):
        yield code, [f"E{k + 1}" for k in range(len(ELECTRODE_NAMES)) if state.electrodes_out >> k & 1]


def _tare(board: ExaminedBoard, finger: int) -> Iterator[Finding]:
    state = board.sensors_after[finger]
    age = f"{state.tare_age_ms / 1000:.0f} s old"
    if state.tare_state == wire.TareState.INIT:
        yield Finding("no_tare", f"finger {finger} has not been still since it was plugged in")
    if state.tare_state == wire.TareState.FAULT:
        yield Finding("tare_fault", f"finger {finger}: its tare is frozen, {age}")
    last = [rows["flags"][rows["finger"] == finger][-1:] for rows in (board.frames, board.idle)]
    if any((flags & wire.FrameFlags.BASE_OLD).any() for flags in last):
        yield Finding("base_old", f"finger {finger} has been touched for over a minute; its tare is {age}")


def _pressure(board: ExaminedBoard, finger: int) -> Iterator[Finding]:
    """How far presses moved the pressure, by the least force of the board's interval; and whether it flagged that."""
    rows = board.frames[board.frames["finger"] == finger]
    least_n = rows["normal_n"] - np.nan_to_num(rows["normal_half_n"])
    pressed = (least_n >= PRESSED_N) & (rows["pdc"] != wire.INVALID_COUNT)
    per_n = (rows["pdc"] - rows["pdc_tare"])[pressed] / least_n[pressed]
    if pressed.sum() >= PRESSED_ROUNDS and np.median(per_n) < LOW_PDC_PER_N:
        seen = f"moves by {np.median(per_n):.0f} counts per newton, of a press of {np.median(least_n[pressed]):.1f} N"
        yield Finding("pressure_flat", f"finger {finger}: static pressure {seen}")
    elif (rows["flags"][-1:] & wire.FrameFlags.PDC_FLAT).any():
        yield Finding("pressure_flat", f"finger {finger}: static pressure did not follow a press (PDC_FLAT)")


def _rises(board: ExaminedBoard, finger: int) -> Iterator[Finding]:
    """Whether an electrode's count rises in a touch, further than skin bulges."""
    rows = board.frames[(board.frames["finger"] == finger) & (board.frames["tare_state"] == wire.TareState.CONTACT)]
    rise = np.where(rows["counts"] == wire.INVALID_COUNT, 0.0, rows["counts"] - rows["tare"])
    often = (rise >= RISE_COUNTS).sum(axis=0)
    if often.max(initial=0) >= RISE_ROUNDS:
        seen = f"E{often.argmax() + 1} rises by {rise[:, often.argmax()].max():.0f} counts above its tare"
        yield Finding("electrodes_inverted", f"finger {finger}: {seen}; bulging skin was seen to rise by 849 at most")


def _channels(board: ExaminedBoard, finger: int) -> dict[str, NDArray[np.integer]]:
    """The counts (rounds, samples a round) of each channel; a finger without frames or PAC lacks those channels."""
    rows = board.frames[board.frames["finger"] == finger]
    pac = board.pac[board.pac["finger"] == finger]
    channels = {f"E{k + 1}": rows["counts"][:, [k]] for k in range(rows["counts"].shape[1])}
    channels |= {name.upper(): rows[name][:, np.newaxis] for name in ("pdc", "tac", "tdc")} | {"PAC": pac["pac"]}
    return {name: counts for name, counts in channels.items() if len(counts)}


def _channel_faults(channels: dict[str, NDArray[np.integer]]) -> dict[str, list[str]]:
    """By the finding's code, the names of the channels it is about. A channel has one finding."""
    codes = ("channel_missing", "channel_railed", "channel_stuck", "electrodes_shorted", "channel_copied")
    found: dict[str, list[str]] = {code: [] for code in codes}
    moved: dict[str, NDArray[np.floating]] = {}
    for name, counts in channels.items():
        rounds = STUCK_TDC_ROUNDS if name == "TDC" else STUCK_ROUNDS
        good = counts[(counts != wire.INVALID_COUNT).all(axis=1)].astype(float)
        if 2 * len(good) < len(counts):
            found["channel_missing"].append(name)
        elif ((good <= RAIL_LOW) | (good >= RAIL_HIGH)).mean() > 0.5:
            found["channel_railed"].append(name)
        elif len(good) >= rounds and not np.ptp(good[-rounds:], axis=0).any():
            found["channel_stuck"].append(name)
        elif name.startswith("E") and STUCK_ROUNDS <= len(good) == len(counts) and np.ptp(good) >= SAME_MOVED_COUNTS:
            moved[name] = good[:, 0]
    for first, second in combinations(moved, 2):
        apart = moved[first] - moved[second]
        if np.abs(apart).max() * SAME_SHARE <= np.ptp(moved[first]) and _same_voltage(moved[first], moved[second]):
            found["electrodes_shorted"].append(f"{first} and {second}")
        elif np.ptp(apart) <= COPIED_COUNTS:
            found["channel_copied"].append(f"{first} and {second}")
    return found


def _same_voltage(first: NDArray[np.floating], second: NDArray[np.floating]) -> bool:
    """Whether counts (rounds,) of two electrodes differ by no more than readings of the same voltage may."""
    sigma = 1.05 * float(np.median(np.abs(np.diff(first - second)))) if len(first) > 1 else 0.0
    for begin in range(0, len(first) - SAME_ROUNDS + 1, SAME_ROUNDS):
        block = slice(begin, begin + SAME_ROUNDS)
        per_round = np.ptp(first[block]) / (SAME_ROUNDS - 1)
        limit = 5.0 * sigma / np.sqrt(SAME_ROUNDS) + SAME_SETTLING_COUNTS + per_round
        if abs((first[block] - second[block]).mean()) > limit:
            return False
    return True
