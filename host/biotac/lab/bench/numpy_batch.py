"""compute() written in NumPy in three ways, for comparison with biotac.compute.

All take counts (uint16, 0xFFFF where missing) and a tare (19,) float64 in counts, a multiple of 1/16. They use the
default settings and check nothing. Results are in mm, N, N*mm.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...core.compiled import FORCE_GAINS, NN_PER_N, TORQUE_GAINS, default_settings
from ...core.geometry import ELECTRODE_MM as R_MM
from ...core.geometry import ELECTRODE_NORMAL as NORMAL
from ...core.geometry import RADIUS_MM
from ...core.geometry import Floats as Array
from ...wire import messages_gen as wire

Three = tuple[Array, Array, Array]

ARM_MM = np.cross(R_MM, NORMAL)
_DEFAULTS = default_settings()
FORCE_GAIN = np.array([_DEFAULTS[s] for s in FORCE_GAINS]) / NN_PER_N
TORQUE_GAIN = np.array([_DEFAULTS[s] for s in TORQUE_GAINS]) / NN_PER_N


def whole_array(counts: NDArray[np.uint16], tare: Array) -> Three:
    """Matrix products over the whole recording, as in the formulas: counts (n, 19), results (n, 3)."""
    e = counts - tare
    e[counts == wire.INVALID_COUNT] = 0
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


def one_frame(counts: NDArray[np.uint16], tare: Array) -> Three:
    """The same for a single frame: counts (19,), results (3,)."""
    e = counts - tare
    e[counts == wire.INVALID_COUNT] = 0
    w = np.maximum(-e, 0)
    total = w.sum()
    if total > 0:
        poc = w @ R_MM / total
        if poc[0] > 0:
            poc *= RADIUS_MM / np.linalg.norm(poc)
        else:
            poc[1:] *= RADIUS_MM / np.hypot(poc[1], poc[2])
    else:
        poc = np.full(3, np.nan)
    force = FORCE_GAIN * (e @ NORMAL)
    torque = np.empty(3)
    torque[0] = poc[1] * force[2] - poc[2] * force[1]
    torque[1:] = TORQUE_GAIN * (e @ ARM_MM[:, 1:])
    return poc, force, torque


class Blocked:
    """The fastest NumPy float64 version found: blocks that stay in the cache, every buffer reused.

    One matrix product per operand, with frames as columns, so that the rest runs over adjacent numbers. Weights stay
    negated. Missing electrodes are looked for only in blocks that have any.
    """

    def __init__(self, block: int) -> None:
        self.block = block
        self._of_weights = np.ascontiguousarray(np.column_stack([np.ones(len(R_MM)), R_MM]).T)
        self._of_signals = np.ascontiguousarray(np.column_stack([NORMAL * FORCE_GAIN, ARM_MM[:, 1:] * TORQUE_GAIN]).T)
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
            if np.max(some) == wire.INVALID_COUNT:
                e[some.T == wire.INVALID_COUNT] = 0
            np.minimum(e, 0, out=w)
            np.matmul(self._of_weights, w, out=sums[:4])
            np.matmul(self._of_signals, e, out=sums[4:])
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
