"""Running recorded counts through the board's own code: a finger's rounds in, the board's messages out."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from ..core.finger import FINGER_DTYPE, ROUND_US, Finger
from ..map.board_map import BoardMap
from ..wire import messages_gen as wire
from ..wire.dtypes_gen import DTYPES
from ..wire.frames import StructArray

_FRAME_FIELDS = list(DTYPES[wire.FrameMessage.ID].names or ())
_ROWS = 2000  # between two calls of show

#: A host's command to a finger, or the end of a hold by the host's silence.
Command = Callable[[Finger], object]


@dataclass(frozen=True)
class FingerRounds:
    """A finger's rounds: ``counts`` (n, 19), ``pdc``, ``tac``, ``tdc``, device time ``t_us`` (n,), ``pac`` (n, 22).

    ``commands``: by the round before which they came, in order. ``wrench_map``: in force throughout. ``foreign``: the
    sensor is no BioTac with 19 electrodes.
    """

    finger: int
    counts: NDArray[np.uint16]
    pdc: NDArray[np.uint16]
    tac: NDArray[np.uint16]
    tdc: NDArray[np.uint16]
    pac: NDArray[np.uint16]
    t_us: NDArray[np.int64]
    commands: dict[int, list[Command]] = field(default_factory=dict)
    quantities: wire.QuantityFlags | None = None
    wrench_map: BoardMap | None = None
    foreign: bool = False

    def fresh(self, settings: dict[wire.Setting, int]) -> Finger:
        """The finger before the first round."""
        own_map, foreign = self.wrench_map, self.foreign
        return Finger(settings, index=self.finger, quantities=self.quantities, wrench_map=own_map, foreign=foreign)


def with_silence(rounds: FingerRounds) -> FingerRounds:
    """``rounds`` with an empty round inserted wherever time jumps: the sensor did not answer, or was being identified.

    The trigger and the pressure filter reset in such a round. Only ``t_us`` tells how many of them there were.
    """
    late = np.flatnonzero(np.diff(rounds.t_us) > 3 * ROUND_US // 2) + 1

    words = {name: getattr(rounds, name) for name in ("counts", "pdc", "tac", "tdc", "pac")}
    filled = {name: np.insert(own, late, np.uint16(wire.INVALID_COUNT), axis=0) for name, own in words.items()}
    t_us = np.insert(rounds.t_us, late, rounds.t_us[late] - ROUND_US)
    rows = {row: row + int(np.searchsorted(late, row, "right")) for row in rounds.commands}
    return replace(rounds, **filled, t_us=t_us, commands={rows[row]: own for row, own in rounds.commands.items()})


def frames_and_tares(
    rounds: FingerRounds, settings: dict[wire.Setting, int], show: Callable[[int], None] = lambda rows: None
) -> tuple[StructArray, dict[int, wire.Tare]]:
    """FRAME messages (m,) of the rounds in which a sensor answered, and TARE messages by row of these.

    ``show`` is called with the number of rounds just run; at most twice their number are run in all.
    """
    finger = rounds.fresh(settings)
    rows = np.concatenate(list(run(rounds, finger, [], show)))
    changed = np.flatnonzero((rows["flags"] & wire.FrameFlags.TARE_CHANGED).astype(bool) & (rows["present"] != 0))
    # Rows do not hold the tare in 1/65536 count: a second run stops at each change to read it.
    finger.reset()
    messages: dict[int, wire.Tare] = {}
    ends = [int(k) + 1 for k in changed]
    row = 0
    order = np.cumsum(rows["present"] != 0) - 1
    for part in run(rounds, finger, ends, show) if ends else ():
        row += len(part)
        if row in ends:
            messages[int(order[row - 1])] = finger.tare_message()
    present = rows[rows["present"] != 0]
    frames = np.empty(len(present), DTYPES[wire.FrameMessage.ID])
    for name in _FRAME_FIELDS:
        frames[name] = present[name]
    return frames, messages


def run(
    rounds: FingerRounds, finger: Finger, ends: Iterable[int], show: Callable[[int], None] = lambda rows: None
) -> Iterator[StructArray]:
    """FINGER_DTYPE rows in parts that end at ``ends``, before commands, and every _ROWS rounds."""
    n = len(rounds.counts)
    cuts = sorted({0, n, *ends, *rounds.commands, *range(0, n, _ROWS)})
    for begin, end in pairwise(cuts):
        for command in rounds.commands.get(begin, ()):
            command(finger)
        part = slice(begin, end)
        channels = (rounds.counts, rounds.pdc, rounds.tac, rounds.tdc, rounds.pac)
        yield finger.feed(*(words[part] for words in channels), t_us=rounds.t_us[part])
        show(end - begin)
    if n == 0:
        yield np.empty(0, FINGER_DTYPE)
