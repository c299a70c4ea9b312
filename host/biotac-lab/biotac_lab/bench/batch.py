"""biotac.compute against NumPy in one run: interleaved rounds, warmed buffers, medians.

Ratios are of wall time: compute() uses one core, OpenBLAS may use all. CPU time would be unfair, because OpenBLAS's
threads keep spinning after their work, at the expense of whoever runs next. Absolute times hold for this machine
only. NumPy's versions take counts (uint16, 0xFFFF where missing) and a tare (19,) in counts, use the default settings
and check nothing.
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
BLOCK_SIZES = (2048, 4096, 8192, 16384, 32768)
EQUAL = 1e-9  # mm, N, N*mm
COMPARED = ("poc_mm", "force_n", "torque_nmm")
LIN = {Setting.FORCE_MODEL: ForceModel.LIN}  # what all contestants compute

WARM, FRESH = "compute, out= reused", "compute, new result"
WHOLE, BEST = "NumPy, whole-array matrix products", "NumPy, blocked, buffers reused"
FRAMEWISE, WHOLE_FRAMEWISE = "per_frame, one frame per call", "NumPy, whole-array code, one frame per call"
ASKED: Asked = ((WARM, WHOLE, None), (WARM, BEST, None), (FRAMEWISE, WHOLE_FRAMEWISE, 50.0))

Array = NDArray[np.float64]
Three = tuple[Array, Array, Array]

R_MM, NORMAL, RADIUS_MM = geometry.ELECTRODE_MM, geometry.ELECTRODE_NORMAL, geometry.RADIUS_MM
ARM_MM = np.cross(R_MM, NORMAL)
FORCE_GAIN, TORQUE_GAIN = (
    np.array([messages.SETTINGS[Setting[f"{quantity}_GAIN_{axis}_NN"]].default for axis in axes]) / 1e9
    for quantity, axes in (("FORCE", "XYZ"), ("TORQUE", "YZ"))
)


def whole_array(counts: NDArray[np.uint16], tare: Array) -> Three:
    """Matrix products over the whole recording, as in the formulas: counts (n, 19), results (n, 3)."""
    e = counts - tare
    e[counts == messages.INVALID_COUNT] = 0
    w = np.maximum(-e, 0)
    with np.errstate(invalid="ignore", divide="ignore"):
        c = w @ R_MM / w.sum(axis=1, keepdims=True)
        sphere = c * (RADIUS_MM / np.linalg.norm(c, axis=1, keepdims=True))
        around = RADIUS_MM / np.hypot(c[:, 1], c[:, 2])
    cylinder = np.column_stack([c[:, 0], c[:, 1] * around, c[:, 2] * around])
    poc = np.where(c[:, :1] > 0, sphere, cylinder)
    force = FORCE_GAIN * (e @ NORMAL)
    torque = np.empty_like(force)
    torque[:, 0] = poc[:, 1] * force[:, 2] - poc[:, 2] * force[:, 1]
    torque[:, 1:] = TORQUE_GAIN * (e @ ARM_MM[:, 1:])
    return poc, force, torque


class Blocked:
    """The fastest NumPy float64 version found: blocks that stay in the cache, every buffer reused.

    One matrix product per operand, with frames as columns, so that the rest runs over adjacent numbers. Weights stay
    negated. Missing electrodes are looked for only in blocks that have any.
    """

    def __init__(self, block: int) -> None:
        self.block = block
        self._weight_rows = np.ascontiguousarray(np.column_stack([np.ones(len(R_MM)), R_MM]).T)
        self._signal_rows = np.ascontiguousarray(np.column_stack([NORMAL * FORCE_GAIN, ARM_MM[:, 1:] * TORQUE_GAIN]).T)
        self._e = np.empty((len(R_MM), block))
        self._w = np.empty((len(R_MM), block))
        self._sums = np.empty((9, block))
        self._scratch = np.empty((2, block))
        self._tip = np.empty(block, bool)

    def __call__(self, counts: NDArray[np.uint16], tare: Array, out: Three) -> Three:
        """Compute counts (n, 19) into ``out``, three arrays (n, 3)."""
        column = tare[:, None]
        for first in range(0, len(counts), self.block):
            some = counts[first : first + self.block]
            n = len(some)
            e, w, sums = self._e[:, :n], self._w[:, :n], self._sums[:, :n]
            np.copyto(e, some.T)
            np.subtract(e, column, out=e)
            if np.max(some) == messages.INVALID_COUNT:
                e[some.T == messages.INVALID_COUNT] = 0
            np.minimum(e, 0, out=w)
            np.matmul(self._weight_rows, w, out=sums[:4])
            np.matmul(self._signal_rows, e, out=sums[4:])
            self._finish(sums, n, *(array[first : first + n] for array in out))
        return out

    def _finish(self, sums: Array, n: int, poc: Array, force: Array, torque: Array) -> None:
        total, x, y, z = sums[:4]
        a, b = self._scratch[:, :n]
        tip = self._tip[:n]
        np.minimum(x, 0, out=b)
        np.multiply(b, b, out=a)
        np.multiply(y, y, out=b)
        a += b
        np.multiply(z, z, out=b)
        a += b
        with np.errstate(invalid="ignore", divide="ignore"):
            np.sqrt(a, out=a)
            np.divide(-RADIUS_MM, a, out=a)
            np.divide(x, total, out=b)
            np.less(x, 0, out=tip)
            np.multiply(x, a, out=b, where=tip)
            y *= a
            z *= a
        poc[:, 0], poc[:, 1], poc[:, 2] = b, y, z
        np.copyto(force, sums[4:7].T)
        np.multiply(y, sums[6], out=a)
        np.multiply(z, sums[5], out=b)
        a -= b
        torque[:, 0] = a
        torque[:, 1:] = sums[7:].T


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
    blocks = [Contestant(str(size), frames, partial(Blocked(size), counts, tare, arrays)) for size in BLOCK_SIZES]
    trials = timed(blocks, 5)
    best = Blocked(int(min(trials, key=lambda name: trials[name])))  # it depends on the cache
    prepared = per_frame(tare, LIN)
    many: list[Contestant] = [
        Contestant(WARM, frames, lambda: compute(counts, tare, LIN, out)),
        Contestant(FRESH, frames, lambda: compute(counts, tare, LIN)),
        Contestant(WHOLE, frames, lambda: whole_array(counts, tare)),
        Contestant(BEST, frames, lambda: best(counts, tare, arrays)),
    ]
    ones: list[tuple[str, Callable[[NDArray[np.uint16]], Any]]] = [
        (FRAMEWISE, prepared), (WHOLE_FRAMEWISE, lambda row: whole_array(row[None], tare)),
    ]  # fmt: skip
    check([contestant.run() for contestant in many], "all frames")
    for row in single[:50]:
        check([run(row) for _, run in ones], "one frame")
    many += [Contestant(name, len(single), partial(_each, run, single)) for name, run in ones]
    times = timed(many, rounds)
    return tables(f"{frames} frames, NumPy's best block here {best.block}", "frame", times, times, ASKED)


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
