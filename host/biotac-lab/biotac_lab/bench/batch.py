"""biotac.compute against NumPy in one run: interleaved rounds, warmed buffers, medians.

Ratios are of wall time: compute() uses one core, OpenBLAS may use all. CPU time would be unfair, because OpenBLAS's
threads spin on after their work, at the expense of the next contestant. Absolute times hold for this machine only.
NumPy's versions have counts (uint16, 0xFFFF where missing) and a tare (19,) in counts as input, use the default
settings and check nothing.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from biotac import RESULT_DTYPE, ForceModel, Setting, compute, per_frame
from biotac.core import geometry
from biotac.wire import messages

from ..report import Show, Table
from .contest import Asked, Contestant, tables, timed

ROUNDS = 15
SINGLE_FRAMES = 1000
BLOCK_SIZES = (1024, 2048, 4096, 8192, 16384)
EQUAL = 1e-9  # mm, N, N*mm
COMPARED = ("poc_mm", "force_n", "torque_nmm")
LIN = {Setting.FORCE_MODEL: ForceModel.LIN}  # the model of all contestants

WARM, FRESH = "compute, out= reused", "compute, new result"
WHOLE, BLOCKS = "NumPy, all frames at once", "NumPy, in blocks that stay in the cache"
FRAMEWISE, NUMPY_FRAMEWISE = "per_frame, one frame per call", "NumPy, one frame per call"
ASKED: Asked = ((WARM, WHOLE, None), (WARM, BLOCKS, None), (FRAMEWISE, NUMPY_FRAMEWISE, 50.0))

Array = NDArray[np.float64]
Three = tuple[Array, Array, Array]

R_MM, NORMAL, RADIUS_MM = geometry.ELECTRODE_MM, geometry.ELECTRODE_NORMAL, geometry.RADIUS_MM
FORCE_GAIN, TORQUE_GAIN = (
    np.array([messages.SETTINGS[Setting[f"{quantity}_GAIN_{axis}_NN"]].default for axis in axes]) / 1e9
    for quantity, axes in (("FORCE", "XYZ"), ("TORQUE", "YZ"))
)
WEIGHT_SUMS = np.column_stack([np.ones(len(R_MM)), R_MM]).T
SIGNAL_SUMS = np.column_stack([NORMAL * FORCE_GAIN, np.cross(R_MM, NORMAL)[:, 1:] * TORQUE_GAIN]).T


def by_numpy(counts: NDArray[np.uint16], tare: Array) -> Three:
    """Point, force and torque (n, 3) of counts (n, 19): a matrix product for weights and one for signals.

    Frames are columns within, so that everything after the products runs over adjacent numbers.
    """
    e = counts.T - tare[:, None]
    e[counts.T == messages.INVALID_COUNT] = 0
    total, x, y, z = WEIGHT_SUMS @ np.maximum(-e, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        to_core = RADIUS_MM / np.sqrt(np.maximum(x, 0) ** 2 + y * y + z * z)
        poc = np.array([np.where(x > 0, x * to_core, x / total), y * to_core, z * to_core])
    x_n, y_n, z_n, *torque_yz = SIGNAL_SUMS @ e
    torque = np.array([poc[1] * z_n - poc[2] * y_n, *torque_yz])
    return poc.T, np.array([x_n, y_n, z_n]).T, torque.T


def by_blocks(block: int, counts: NDArray[np.uint16], tare: Array, out: Three) -> Three:
    """The same into ``out``, ``block`` frames at a time."""
    for first in range(0, len(counts), block):
        rows = slice(first, first + block)
        for whole, part in zip(out, by_numpy(counts[rows], tare), strict=True):
            whole[rows] = part
    return out


def recording(frames: int) -> tuple[NDArray[np.uint16], Array]:
    """Synthetic counts (frames, 19), one in ten thousand missing, and their tare (19,)."""
    random = np.random.default_rng(20130)
    tare = np.round(random.normal(2000, 200, 19) * 16) / 16
    counts = np.clip(tare + random.normal(-30, 150, (frames, 19)), 0, 4095).astype(np.uint16)
    counts[random.random(counts.shape) < 1e-4] = messages.INVALID_COUNT
    return counts, tare


def measure(frames: int = 200_000, show: Show = lambda text: None, rounds: int = ROUNDS) -> list[Table]:
    """Check that all contestants agree on ``frames`` frames, then time them. Raises RuntimeError if they do not."""
    counts, tare = recording(frames)
    out, single = np.zeros(frames, RESULT_DTYPE), list(counts[:SINGLE_FRAMES])
    arrays = (np.zeros((frames, 3)), np.zeros((frames, 3)), np.zeros((frames, 3)))
    trials = timed([Contestant(str(n), frames, partial(by_blocks, n, counts, tare, arrays)) for n in BLOCK_SIZES], 5)
    block = int(min(trials, key=lambda name: trials[name]))  # it depends on the cache
    prepared = per_frame(tare, LIN)
    many: list[Contestant] = [
        Contestant(WARM, frames, lambda: compute(counts, tare, LIN, out)),
        Contestant(FRESH, frames, lambda: compute(counts, tare, LIN)),
        Contestant(WHOLE, frames, lambda: by_numpy(counts, tare)),
        Contestant(BLOCKS, frames, lambda: by_blocks(block, counts, tare, arrays)),
    ]
    ones: list[tuple[str, Callable[[NDArray[np.uint16]], Any]]] = [
        (FRAMEWISE, prepared), (NUMPY_FRAMEWISE, lambda row: by_numpy(row[None], tare)),
    ]  # fmt: skip
    check([contestant.run() for contestant in many], "all frames")
    for row in single[:50]:
        check([run(row) for _, run in ones], "one frame")
    many += [Contestant(name, len(single), partial(_each, run, single)) for name, run in ones]
    times = timed(many, rounds)
    return tables(f"{frames} frames, NumPy's best block here {block}", "frame", times, times, ASKED)


def _each(run: Callable[[NDArray[np.uint16]], Any], rows: list[NDArray[np.uint16]]) -> None:
    for row in rows:
        run(row)


def check(results: list[Any], scope: str) -> None:
    """Compare all results with the first, which is compute()'s. Raises RuntimeError if one differs."""
    for other in results[1:]:
        for k, name in enumerate(COMPARED):
            values = other[k] if isinstance(other, tuple) else other[name]
            if not np.allclose(np.squeeze(values), results[0][name], rtol=0, atol=EQUAL, equal_nan=True):
                raise RuntimeError(f"{scope}: two contestants differ in {name}; do not compare their times")
