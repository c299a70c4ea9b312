"""Recorded counts through the board's own code: a finger's rounds in, the messages a board would send out."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..core.board_map import BoardMap
from ..core.finger import FINGER_DTYPE, ROUND_US, Finger
from ..errors import CommandRefusedError
from ..wire import messages_gen as wire
from ..wire.dtypes_gen import DTYPES
from ..wire.frames import StructArray

_FRAME_FIELDS = list(DTYPES[wire.Frame.ID].names or ())
_WORDS = {
    wire.TareReason.HOST_HOLD: Finger.hold,
    wire.TareReason.HOST_RELEASE: Finger.release,
    wire.TareReason.HOLD_LAPSED: Finger.lapse,
}
_ROWS = 2000  # between two calls of show


@dataclass(frozen=True)
class HostTare:
    """What the host told the board: ``counts`` (19,) and ``pdc``, or with ``now`` to take its own latest means."""

    counts: NDArray[np.float64]
    pdc: float | None
    now: bool = False

    def give(self, finger: Finger) -> None:
        """Tell ``finger``; where it sees no means to take now, it gets those that the board took."""
        try:
            if self.now:
                finger.tare_now()
                return
        except CommandRefusedError:
            pass
        finger.set_tare(self.counts, self.pdc)


@dataclass(frozen=True)
class Rounds:
    """A finger's rounds: ``counts`` (n, 19), ``pdc``, ``tac``, ``tdc`` (n,), ``t_us`` (n,) device time.

    ``tares``: by the round from which on each holds; ``words``: HOST_HOLD, HOST_RELEASE or HOLD_LAPSED, likewise.
    ``wrench_map``: in force all along.
    """

    finger: int
    counts: NDArray[np.uint16]
    pdc: NDArray[np.uint16]
    tac: NDArray[np.uint16]
    tdc: NDArray[np.uint16]
    t_us: NDArray[np.int64]
    tares: dict[int, HostTare] = field(default_factory=dict)
    words: dict[int, wire.TareReason] = field(default_factory=dict)
    quantities: wire.QuantityFlags | None = None
    wrench_map: BoardMap | None = None


def with_silence(rounds: Rounds) -> Rounds:
    """``rounds`` with one without words wherever time jumps: the sensor was silent there, or was asked who it is.

    The trigger and the pressure's filter forget in such a round; how many there were is told by ``t_us`` alone.
    """
    late = np.flatnonzero(np.diff(rounds.t_us) > 3 * ROUND_US // 2) + 1

    def filled(words: NDArray[np.uint16]) -> NDArray[np.uint16]:
        return np.insert(words, late, np.uint16(wire.INVALID_COUNT), axis=0)

    def at(row: int) -> int:
        return row + int(np.searchsorted(late, row, "right"))

    return replace(
        rounds,
        counts=filled(rounds.counts),
        pdc=filled(rounds.pdc),
        tac=filled(rounds.tac),
        tdc=filled(rounds.tdc),
        t_us=np.insert(rounds.t_us, late, rounds.t_us[late] - ROUND_US),
        tares={at(row): tare for row, tare in rounds.tares.items()},
        words={at(row): word for row, word in rounds.words.items()},
    )


def frames_and_tares(
    rounds: Rounds, settings: dict[wire.Setting, int], show: Callable[[int], None] = lambda rows: None
) -> tuple[StructArray, dict[int, wire.Tare]]:
    """FRAME messages (m,) of the rounds in which a sensor answered, and TARE messages by row of those.

    ``show`` is told how many rounds were run, of twice their number.
    """
    finger = Finger(settings, index=rounds.finger, quantities=rounds.quantities, wrench_map=rounds.wrench_map)
    rows = np.concatenate(list(_run(rounds, finger, [], show)))
    changed = np.flatnonzero((rows["flags"] & wire.FrameFlags.TARE_CHANGED).astype(bool) & (rows["present"] != 0))
    # The tare's own 1/65536 count is in no row: a second run stops at each change to look.
    finger.reset()
    messages: dict[int, wire.Tare] = {}
    ends = [int(k) + 1 for k in changed]
    row = 0
    order = np.cumsum(rows["present"] != 0) - 1
    for part in _run(rounds, finger, ends, show) if ends else ():
        row += len(part)
        if row in ends:
            messages[int(order[row - 1])] = finger.tare_message()
    there = rows[rows["present"] != 0]
    frames = np.empty(len(there), DTYPES[wire.Frame.ID])
    for name in _FRAME_FIELDS:
        frames[name] = there[name]
    return frames, messages


def _run(rounds: Rounds, finger: Finger, ends: list[int], show: Callable[[int], None]) -> Iterator[StructArray]:
    """Rows in parts, which end at ``ends``, before tares from the host, and every _ROWS rounds."""
    n = len(rounds.counts)
    cuts = sorted({0, n, *ends, *rounds.tares, *rounds.words, *range(0, n, _ROWS)})
    for begin, end in pairwise(cuts):
        if begin in rounds.tares:
            rounds.tares[begin].give(finger)
        if begin in rounds.words:
            _WORDS[rounds.words[begin]](finger)
        part = slice(begin, end)
        yield finger.feed(
            rounds.counts[part], rounds.pdc[part], rounds.tac[part], rounds.tdc[part], t_us=rounds.t_us[part]
        )
        show(end - begin)
    if n == 0:
        yield np.empty(0, FINGER_DTYPE)
