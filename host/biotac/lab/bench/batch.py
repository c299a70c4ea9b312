"""biotac.compute against NumPy in one run: interleaved rounds, warmed buffers, medians.

Ratios are of wall time: compute() uses one core, OpenBLAS may use all. CPU time would be unfair, because OpenBLAS's
threads keep spinning after their work, at the expense of whoever runs next. Absolute times hold for this machine
only.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...core.compute import RESULT_DTYPE, compute, per_frame
from ...wire import messages_gen as wire
from .numpy_batch import Blocked, one_frame, whole_array
from .timing import Contestant, Ratio, Row, timed

ROUNDS = 15
SINGLE_FRAMES = 1000
BLOCK_SIZES = (2048, 4096, 8192, 16384, 32768)
EQUAL = 1e-9  # mm, N, N*mm
LIN = {wire.Setting.FORCE_MODEL: wire.ForceModel.LIN}  # what all contestants compute

WARM, FRESH = "compute, out= reused", "compute, new result"
WHOLE, BEST = "NumPy, whole-array matrix products", "NumPy, blocked, buffers reused"
ONE_PREPARED, ONE_WARM = "per_frame, one frame per call", "compute, out= reused, one frame per call"
ONE_WHOLE, ONE_OWN = "NumPy, whole-array code, one frame per call", "NumPy, written for one frame, one frame per call"

#: (faster, slower, smallest ratio); None where there is no requirement.
ASKED: tuple[tuple[str, str, float | None], ...] = (
    (WARM, WHOLE, 6.0),
    (WARM, BEST, 2.0),
    (ONE_PREPARED, ONE_WHOLE, 50.0),
    (ONE_WARM, ONE_WHOLE, 50.0),
    (ONE_PREPARED, ONE_OWN, None),
)


@dataclass(frozen=True)
class Outcome:
    """The figures of one run."""

    frames: int
    block: int
    rows: list[Row]
    ratios: list[Ratio]


def recording(frames: int) -> tuple[NDArray[np.uint16], NDArray[np.float64]]:
    """Synthetic counts (frames, 19), one in ten thousand missing, and their tare (19,)."""
    random = np.random.default_rng(20130)
    tare = np.round(random.normal(2000, 200, 19) * 16) / 16
    counts = np.clip(tare + random.normal(-30, 150, (frames, 19)), 0, 4095).astype(np.uint16)
    counts[random.random(counts.shape) < 1e-4] = wire.INVALID_COUNT
    return counts, tare


def measure(frames: int, rounds: int = ROUNDS) -> Outcome:
    """Check that all contestants agree on ``frames`` frames, then time them. Raises RuntimeError if they do not."""
    counts, tare = recording(frames)
    out = np.zeros(frames, RESULT_DTYPE)
    arrays = (np.zeros((frames, 3)), np.zeros((frames, 3)), np.zeros((frames, 3)))
    block = _best_block(counts, tare, arrays)
    best = Blocked(block)
    many = [
        Contestant(WARM, frames, lambda: compute(counts, tare, LIN, out)),
        Contestant(FRESH, frames, lambda: compute(counts, tare, LIN)),
        Contestant(WHOLE, frames, lambda: whole_array(counts, tare)),
        Contestant(BEST, frames, lambda: best(counts, tare, arrays)),
    ]
    singles = list(counts[:SINGLE_FRAMES])  # taking a row out of the array must not be timed
    one_out = np.zeros((), RESULT_DTYPE)
    prepared = per_frame(tare, LIN)
    ones: list[tuple[str, Callable[[NDArray[np.uint16]], Any]]] = [
        (ONE_PREPARED, prepared),
        (ONE_WARM, lambda row: compute(row, tare, LIN, one_out)),
        (ONE_WHOLE, lambda row: whole_array(row[None], tare)),
        (ONE_OWN, lambda row: one_frame(row, tare)),
    ]
    _check([c.run() for c in many], "all frames")
    for row in singles[:50]:
        _check([run(row) for _, run in ones], "one frame")
    contestants = many + [Contestant(name, len(singles), _looped(run, singles)) for name, run in ones]
    rows = timed(contestants, rounds)
    time_of = {row.name: row.median_ns for row in rows}
    ratios = [Ratio(fast, slow, time_of[slow] / time_of[fast], asked) for fast, slow, asked in ASKED]
    return Outcome(frames, block, rows, ratios)


def _looped(run: Callable[[NDArray[np.uint16]], Any], rows: list[NDArray[np.uint16]]) -> Callable[[], None]:
    def loop() -> None:
        for row in rows:
            run(row)

    return loop


def _best_block(counts: NDArray[np.uint16], tare: NDArray[np.float64], arrays: Any) -> int:
    """NumPy's best block size on this machine; it depends on the cache."""
    trials = [Contestant(str(size), len(counts), partial(Blocked(size), counts, tare, arrays)) for size in BLOCK_SIZES]
    return int(min(timed(trials, 5), key=lambda row: row.median_ns).name)


def _check(results: list[Any], what: str) -> None:
    """Compare all results with the first, which is compute()'s. Raises RuntimeError if one differs."""
    for other in results[1:]:
        for k, name in enumerate(RESULT_DTYPE.names or ()):
            values = other[k] if isinstance(other, tuple) else other[name]
            if not np.allclose(np.squeeze(values), results[0][name], rtol=0, atol=EQUAL, equal_nan=True):
                raise RuntimeError(f"{what}: two contestants differ in {name}; do not compare their times")
