"""The features that the models are linear in: one row for each frame, block by block.

A block is a kind of column times a gate, e.g. the compressions times the contact's position along the finger
(protocol/map.toml). Every model is a choice of blocks, and a board's map is a list of them. Features are functions of
one frame's tared counts alone (and of PDC where there is one), so a frame can be checked by itself and at any drift.
Columns are scaled to be of the order of one. None is centred or standardised by the run itself, because a fitted map
must mean the same on the next run.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from ...core.geometry import Floats
from ...core.map_columns import Signals, gates, kinds
from ...wire import map_gen as _map
from ...wire.map_gen import Gate, Kind

STRAIGHT = (Gate.ONE, Gate.X, Gate.Y)


@dataclass(frozen=True)
class Block:
    """A range of columns: those of ``kind``, each times the scalar ``gate``."""

    kind: Kind
    gate: Gate

    @property
    def width(self) -> int:
        return _map.KINDS[self.kind].columns


def _blocks(kinds: Iterable[Kind], gates: Iterable[Gate] = (Gate.ONE,)) -> tuple[Block, ...]:
    several = tuple(kinds)
    return tuple(Block(kind, gate) for gate in gates for kind in several)


_SIGNAL = _blocks([Kind.SIGNAL])
_SIGNAL_PAIRS = _blocks([Kind.SIGNAL_PAIRS])
_CONDUCTANCE = _blocks([Kind.CONDUCTANCE])
_CONDUCTANCE_PAIRS = _blocks([Kind.CONDUCTANCE_PAIRS])
_SPLIT = (Kind.COMPRESSION, Kind.BULGE)  # different physics (biotac.md finding 4)
_PRESSURE = _blocks([Kind.PRESSURE], STRAIGHT)

# PRESSURE is last: a run without PDC has just the columns before it
BLOCKS = (*_SIGNAL, *_SIGNAL_PAIRS, *_CONDUCTANCE, *_CONDUCTANCE_PAIRS, *_blocks(_SPLIT, STRAIGHT), *_PRESSURE)


def blocks(*, with_pdc: bool) -> tuple[Block, ...]:
    """The blocks of columns(), in order."""
    return BLOCKS if with_pdc else BLOCKS[: -len(_PRESSURE)]


def width(*, with_pdc: bool) -> int:
    """Number of columns of columns()."""
    return sum(block.width for block in blocks(with_pdc=with_pdc))


@dataclass(frozen=True)
class Family:
    """The blocks that a model uses, in the order of BLOCKS; PRESSURE only where it was recorded."""

    blocks: tuple[Block, ...]

    def index(self, columns: int) -> npt.NDArray[np.intp]:
        """Indices of the family's columns; ``columns`` is the number of all columns of columns()."""
        own = [block for block in blocks(with_pdc=columns == width(with_pdc=True)) if block in self.blocks]
        return np.concatenate([_place(block) for block in own])


def columns(signals: Signals) -> Floats:
    """All features (n, 532), or (n, 535) with PDC, in the order of blocks()."""
    found, at = kinds(signals), gates(signals.e)
    parts = []
    for block in blocks(with_pdc=signals.pdc is not None):
        kind = found[block.kind]
        parts.append(kind if block.gate == Gate.ONE else kind * at[block.gate])
    return np.concatenate(parts, axis=1)


def _place(block: Block) -> npt.NDArray[np.intp]:
    start = sum(other.width for other in BLOCKS[: BLOCKS.index(block)])
    return np.arange(start, start + block.width)


LINEAR = Family(_SIGNAL)
GATED = Family(_blocks((*_SPLIT, Kind.PRESSURE), STRAIGHT))
QUADRATIC = Family((*_SIGNAL, *_SIGNAL_PAIRS, *_PRESSURE))
CONDUCTANCE_QUADRATIC = Family((*_CONDUCTANCE, *_CONDUCTANCE_PAIRS, *_PRESSURE))
JOINED = Family((*GATED.blocks, *_CONDUCTANCE, *_CONDUCTANCE_PAIRS))
