"""Checks tares, and what each channel says: no word, the end of the range, always the same, or mostly noise."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..wire import messages_gen as wire
from ..wire.native import lib
from .catalogue import Finding
from .facts import BoardFacts

#: The limits of FrameFlags.RAIL.
RAIL_LOW, RAIL_HIGH = 0, lib.bt_rail_count()

# For how many rounds until the end a channel must say one and the same count. An electrode whose noise is 0.45 counts,
# the quietest seen, does so for 100 once in 10^13 tries; TDC, which is slow, did so for 280 in one of 1000 tries.
STUCK_ROUNDS = 100
STUCK_TDC_ROUNDS = 280

# Noise is the median change of a count's slope from round to round: what presses and slides is smooth. No electrode of
# the public recordings exceeds 22 counts, or 5.5 times the middle one of its finger.
NOISE_COUNTS = 40.0
NOISE_RATIO = 8.0


def check(board: BoardFacts) -> Iterator[Finding]:
    """The tares; then electrodes, PDC, TDC, TAC and PAC of the fingers that sent frames."""
    for finger in board.present:
        yield from _tare(board, finger)
    for finger in board.present:
        for code, names in _judge(_channels(board, finger)).items():
            if names:
                yield Finding(code, f"finger {finger}: {', '.join(names)}")


def _tare(board: BoardFacts, finger: int) -> Iterator[Finding]:
    state = board.sensors_after[finger]
    age = f"{state.tare_age_ms / 1000:.0f} s old"
    if state.tare_state == wire.TareState.INIT:
        yield Finding("no_tare", f"finger {finger} has not been still since it was plugged in")
    if state.tare_state == wire.TareState.FAULT:
        yield Finding("tare_fault", f"finger {finger}: its tare is frozen, {age}")
    last = [rows["flags"][rows["finger"] == finger][-1:] for rows in (board.frames, board.idle)]
    if any((flags & wire.FrameFlags.BASE_OLD).any() for flags in last):
        yield Finding("base_old", f"finger {finger} has been touched for over a minute; its tare is {age}")


def _channels(board: BoardFacts, finger: int) -> dict[str, NDArray[np.integer]]:
    """The counts (rounds, samples a round) of each channel; a finger without frames or PAC lacks those channels."""
    rows = board.frames[board.frames["finger"] == finger]
    pac = board.pac[board.pac["finger"] == finger]
    channels = {f"E{k + 1}": rows["counts"][:, [k]] for k in range(rows["counts"].shape[1])}
    channels |= {name.upper(): rows[name][:, np.newaxis] for name in ("pdc", "tac", "tdc")} | {"PAC": pac["pac"]}
    return {name: counts for name, counts in channels.items() if len(counts)}


def _judge(channels: dict[str, NDArray[np.integer]]) -> dict[str, list[str]]:
    """By the finding's code, the names of the channels it is about. A channel has one finding."""
    codes = ("sensor_frozen", "channel_missing", "channel_railed", "channel_stuck", "channel_noisy")
    found: dict[str, list[str]] = {code: [] for code in codes}
    noise_counts = {}
    for name, counts in channels.items():
        rounds = STUCK_TDC_ROUNDS if name == "TDC" else STUCK_ROUNDS
        good = counts[(counts != wire.INVALID_COUNT).all(axis=1)].astype(float)
        if 2 * len(good) < len(counts):
            found["channel_missing"].append(name)
        elif ((good <= RAIL_LOW) | (good >= RAIL_HIGH)).mean() > 0.5:
            found["channel_railed"].append(name)
        elif len(good) >= rounds and not np.ptp(good[-rounds:], axis=0).any():
            found["channel_stuck"].append(name)
        elif name.startswith("E") and len(good) >= rounds:
            noise_counts[name] = np.median(np.abs(np.diff(good, n=2, axis=0)))
    if noise_counts:
        limit_counts = max(NOISE_COUNTS, NOISE_RATIO * np.median(list(noise_counts.values())))
        found["channel_noisy"] = [name for name, noise in noise_counts.items() if noise > limit_counts]
    if channels and len(found["channel_stuck"]) == len(channels):
        found["sensor_frozen"], found["channel_stuck"] = ["every channel"], []
    return found
