"""Checks tares."""

from __future__ import annotations

from collections.abc import Iterator

from ..wire import messages_gen as wire
from .catalogue import Finding
from .facts import BoardFacts, Facts


def check(facts: Facts) -> Iterator[Finding]:
    """The tare of each finger that is present."""
    board = facts.board
    for finger in board.present if board else []:
        assert board is not None
        yield from _tare(board, finger)


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
