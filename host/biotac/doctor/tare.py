"""Checks tares and electrodes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..wire import messages_gen as wire
from ..wire.native import lib
from .catalogue import Finding
from .facts import BoardFacts, Facts

#: The limits of FrameFlags.RAIL.
RAIL_LOW, RAIL_HIGH = 0, lib.bt_rail_count()


def check(facts: Facts) -> Iterator[Finding]:
    """The tare of each finger that is present; electrodes and channels of those that sent frames."""
    board = facts.board
    for finger in board.present if board else []:
        assert board is not None
        yield from _tare(board, finger)
        mine = board.frames[board.frames["finger"] == finger]
        if len(mine):
            counts = mine["counts"]
            good = counts != wire.INVALID_COUNT
            railed = good & ((counts <= RAIL_LOW) | (counts >= RAIL_HIGH))
            names = [f"E{k + 1}" for k in np.flatnonzero(railed.mean(axis=0) > 0.5)]
            if names:
                yield Finding("electrodes_railed", f"finger {finger}: {', '.join(names)}")
            missing = [f"E{k + 1}" for k in np.flatnonzero((~good).mean(axis=0) > 0.5)]
            missing += [n.upper() for n in ("pdc", "tac", "tdc") if (mine[n] == wire.INVALID_COUNT).mean() > 0.5]
            if missing:
                yield Finding("channel_missing", f"finger {finger}: {', '.join(missing)}")


def _tare(board: BoardFacts, finger: int) -> Iterator[Finding]:
    state = board.sensors_after[finger]
    if state.tare_state == wire.TareState.INIT:
        yield Finding("no_tare", f"finger {finger} has not been still since it was plugged in")
    if state.tare_state == wire.TareState.FAULT:
        yield Finding("tare_fault", f"finger {finger}: its tare is frozen, {state.tare_age_ms / 1000:.0f} s old")
    last = [rows["flags"][rows["finger"] == finger][-1:] for rows in (board.frames, board.idle)]
    if any((flags & wire.FrameFlags.BASE_OLD).any() for flags in last):
        age_s = state.tare_age_ms / 1000
        yield Finding("base_old", f"finger {finger} has been touched for over a minute; its tare is {age_s:.0f} s old")
