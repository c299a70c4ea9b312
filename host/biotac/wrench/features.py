"""What the models are linear in: one row of features a frame, block by block.

A block is a kind of column times a gate, e.g. the compressions times how far along the finger the contact
lies. Every model is a choice of blocks, and a board's map is a list of them. Features are functions of one
frame's tared counts alone (and of PDC where there is one), so a frame can be checked by itself and at any
drift. Columns are scaled to be of the order of one; none is centred or standardised by the run itself,
because a fitted map has to mean the same on the next run.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from .. import _sensor
from ..sim import surface
from .recorded import Floats

ELECTRODES = len(_sensor.ELECTRODE_NAMES)
SIGNAL_COUNTS = 500.0  # a firm press; only sets the columns' size
PRESSURE_COUNTS = 100.0
GATE_FLOOR_COUNTS = 5.0  # per electrode: noise must not throw the centroid about when nothing is compressed
GATE_MM = (8.0, 4.0)  # half the pad along and across
MIN_COUNT, MAX_COUNT = 1.0, 4090.0  # numerics.md 1.3: 0 is taken for 10 MOhm
MIN_CONDUCTANCE, MAX_CONDUCTANCE = -1.0, 3.0  # change over rest; a wet or shorted electrode must not square to anything

Kind = Literal["SIGNAL", "COMPRESSION", "BULGE", "SIGNAL_PAIRS", "CONDUCTANCE", "CONDUCTANCE_PAIRS", "PRESSURE"]
Gate = Literal["ONE", "X", "Y", "XX", "XY", "YY"]

_UPPER = np.triu_indices(ELECTRODES)
WIDTHS: dict[Kind, int] = {
    "SIGNAL": ELECTRODES,
    "COMPRESSION": ELECTRODES,
    "BULGE": ELECTRODES,
    "SIGNAL_PAIRS": len(_UPPER[0]),
    "CONDUCTANCE": ELECTRODES,
    "CONDUCTANCE_PAIRS": len(_UPPER[0]),
    "PRESSURE": 1,
}
STRAIGHT: tuple[Gate, ...] = ("ONE", "X", "Y")
GATES: tuple[Gate, ...] = (*STRAIGHT, "XX", "XY", "YY")


@dataclass(frozen=True)
class Block:
    """A range of columns: those of ``kind``, each times the scalar ``gate``."""

    kind: Kind
    gate: Gate

    @property
    def width(self) -> int:
        """Columns."""
        return WIDTHS[self.kind]


def _blocks(kinds: tuple[Kind, ...], gates: tuple[Gate, ...] = ("ONE",)) -> tuple[Block, ...]:
    return tuple(Block(kind, gate) for gate in gates for kind in kinds)


# PRESSURE last: a run without PDC has the columns before it
BLOCKS: tuple[Block, ...] = (
    *_blocks(("SIGNAL", "SIGNAL_PAIRS", "CONDUCTANCE", "CONDUCTANCE_PAIRS")),
    *_blocks(("COMPRESSION", "BULGE"), GATES),
    *_blocks(("PRESSURE",), GATES),
)


def blocks(*, with_pdc: bool) -> tuple[Block, ...]:
    """The blocks of columns(), in their order."""
    return BLOCKS if with_pdc else tuple(block for block in BLOCKS if block.kind != "PRESSURE")


def width(*, with_pdc: bool) -> int:
    """Columns of columns()."""
    return sum(block.width for block in blocks(with_pdc=with_pdc))


@dataclass(frozen=True)
class Signals:
    """One row a frame: ``e`` (n, 19) counts above ``tare`` (19,), ``pdc`` (n,) counts above rest or None."""

    e: Floats
    tare: Floats
    pdc: Floats | None = None

    def drifted(self, counts: Floats) -> Signals:
        """As if every row had drifted by ``counts`` (19,)."""
        return Signals(self.e + counts, self.tare, self.pdc)


@dataclass(frozen=True)
class Family:
    """The blocks that a model uses, in the order of BLOCKS; PRESSURE only where it was recorded.

    The columns of ``straight``, blocks whose gate is ONE, are to first order e divided by ``scale(tare)``
    (19,) counts; that is how Lin's sums are written in them, which is what ridge shrinks toward.
    """

    blocks: tuple[Block, ...]
    straight: tuple[Block, ...]
    scale: Callable[[Floats], Floats]

    def index(self, columns: int) -> npt.NDArray[np.intp]:
        """Places of the family's columns among all ``columns`` of columns()."""
        own = self._own(with_pdc=columns == width(with_pdc=True))
        return np.concatenate([_place(block) for block in own])

    def unit(self, tare: Floats, columns: int) -> Floats:
        """(columns, 19): the family's own ``columns`` @ this is e in counts, to first order."""
        with_pdc = columns == sum(block.width for block in self.blocks)
        parts = [
            np.diag(self.scale(tare)) if block in self.straight else np.zeros((block.width, ELECTRODES))
            for block in self._own(with_pdc=with_pdc)
        ]
        return np.concatenate(parts)

    def _own(self, *, with_pdc: bool) -> list[Block]:
        return [block for block in blocks(with_pdc=with_pdc) if block in self.blocks]


def columns(signals: Signals) -> Floats:
    """All features (n, 646), or (n, 652) with PDC, in the order of blocks()."""
    kinds, gates = _kinds(signals), _gates(signals.e)
    parts = []
    for block in blocks(with_pdc=signals.pdc is not None):
        kind = kinds[block.kind]
        parts.append(kind if block.gate == "ONE" else kind * gates[block.gate])
    return np.concatenate(parts, axis=1)


def centroid_mm(e: Floats) -> Floats:
    """Centroid (n, 3) of the compressed electrodes in mm; the middle of all when none is compressed."""
    weights = np.maximum(-e, 0.0) + GATE_FLOOR_COUNTS
    centre: Floats = weights @ surface.ELECTRODE_MM / weights.sum(axis=1, keepdims=True)
    return centre


def conductance_change(e: Floats, tare: Floats) -> Floats:
    """Electrodes' conductance (n, 19) over that at rest, less one."""
    change = _conductance(np.clip(e + tare, MIN_COUNT, MAX_COUNT)) / _conductance(np.clip(tare, MIN_COUNT, MAX_COUNT))
    return np.clip(change - 1.0, MIN_CONDUCTANCE, MAX_CONDUCTANCE)


def _kinds(signals: Signals) -> dict[Kind, Floats]:
    e = signals.e / SIGNAL_COUNTS
    conductance = conductance_change(signals.e, signals.tare)
    kinds: dict[Kind, Floats] = {
        "SIGNAL": e,
        # compression and bulge are different physics (biotac.md finding 4)
        "COMPRESSION": np.minimum(e, 0.0),
        "BULGE": np.maximum(e, 0.0),
        "SIGNAL_PAIRS": _products(e),
        "CONDUCTANCE": conductance,
        "CONDUCTANCE_PAIRS": _products(conductance),
    }
    if signals.pdc is not None:
        kinds["PRESSURE"] = signals.pdc[:, None] / PRESSURE_COUNTS
    return kinds


def _gates(e: Floats) -> dict[Gate, Floats]:
    centre = centroid_mm(e)
    x, y = centre[:, :1] / GATE_MM[0], centre[:, 1:2] / GATE_MM[1]
    return {"X": x, "Y": y, "XX": x * x, "XY": x * y, "YY": y * y}


def _place(block: Block) -> npt.NDArray[np.intp]:
    start = sum(other.width for other in BLOCKS[: BLOCKS.index(block)])
    return np.arange(start, start + block.width)


def _conductance(count: Floats) -> Floats:
    return count / (_sensor.FULL_SCALE_COUNT - count)


def _products(of: Floats) -> Floats:
    products: Floats = of[:, _UPPER[0]] * of[:, _UPPER[1]]
    return products


def _counts_scale(tare: Floats) -> Floats:
    return np.full(ELECTRODES, SIGNAL_COUNTS)


def _conductance_scale(tare: Floats) -> Floats:
    # d ln(c / (4095 - c)) / dc, turned over
    return np.clip(tare, MIN_COUNT, MAX_COUNT) * (1.0 - np.clip(tare, MIN_COUNT, MAX_COUNT) / _sensor.FULL_SCALE_COUNT)


_SIGNAL = _blocks(("SIGNAL",))
_SPLIT = _blocks(("COMPRESSION", "BULGE"))
_CONDUCTANCE = _blocks(("CONDUCTANCE",))
_CONDUCTANCE_PAIRS = _blocks(("CONDUCTANCE", "CONDUCTANCE_PAIRS"))

LINEAR = Family(_SIGNAL, _SIGNAL, _counts_scale)
SIGN_SPLIT = Family(_SPLIT, _SPLIT, _counts_scale)
GATED = Family(_blocks(("COMPRESSION", "BULGE", "PRESSURE"), STRAIGHT), _SPLIT, _counts_scale)
GATED_TWICE = Family(_blocks(("COMPRESSION", "BULGE", "PRESSURE"), GATES), _SPLIT, _counts_scale)
QUADRATIC = Family((*_SIGNAL, *_blocks(("SIGNAL_PAIRS",)), *_blocks(("PRESSURE",), GATES)), _SIGNAL, _counts_scale)
CONDUCTANCE_QUADRATIC = Family((*_CONDUCTANCE_PAIRS, *_blocks(("PRESSURE",), GATES)), _CONDUCTANCE, _conductance_scale)
JOINED = Family((*GATED_TWICE.blocks, *_CONDUCTANCE_PAIRS), _SPLIT, _counts_scale)
