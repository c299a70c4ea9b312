"""The error of a calibration of this run on rows that it has never seen.

Nested cross-validation: each block is held out once, and all choices for it (lags, smoothing, and for each axis lambdas
and the models' weights) are made inside the other blocks. The reported error is therefore the procedure's, not the
luckiest of many.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from ...core.compute import compute
from ...kernels.geometry import Floats, grip_parts
from ...map.columns import GATED, PRESSURES, Signals, columns, index
from ...map.fitted import WrenchMap
from ...map.margin import UNKNOWN, Margin, fit_margin, published_parts
from ...wire.sensor_gen import FULL_SCALE_COUNT
from . import models
from .lag import Lags
from .lesson import lesson_of
from .models import LAMBDAS, LIN, LIN_OFFSET, MODELS, POOL, POOLED
from .moments import Rows, WeightedSums, air_sums, at, linear_columns, moved, row_weights, smoothed, stacked, strip_sums
from .plate_recording import Run
from .plausible import check_sense
from .splits import BLOCKS, Blocks

INNER_FOLDS = 5
FIRST_OF_POOL = len(MODELS) - len(POOL)
WINDOWS_ROWS = (1, 5, 9)  # as recorded, or a mean: over 9, a third of the noise for 40 ms of delay at 100 Hz
# Weight of the frames in free air against the run's. If a finger never rests, nothing stops the map from giving half a
# newton in air, or more; but where light presses are scarce, holding it at zero bends the map in contact. So the
# largest weight that costs no force axis more than a twentieth of its error is chosen, and never none.
AIR_SHARES = (0.05, 0.01)
AIR_COST = 1.1  # factor on the squared error
AIR_LAMBDA = 1e-4
SHIFTS_COUNTS = (0.0, 100.0, -100.0)  # un-tared drift that the result is tested with
TRAINING_SHARES = (0.25, 0.5)  # shares of the training blocks, to see what a longer recording would gain
THREADS = 2

Show = Callable[[str], None]
Strips = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class TrainedModels:
    """One training. ``by_model`` has each model's coefficients (p + 1, axes) of map.columns, the offset last.

    ``lag_rows`` are for each axis. ``weights`` (axes, m) are those of POOL's models with both LAMBDAS, and, if a map of
    other fingers is given, again with both OTHERS_LAMBDAS. ``air_share`` is the weight of the frames in free air as a
    share of the run's, 0 without any. ``less`` are the pool's coefficients (p + 1, axes) by TRAINING_SHARES.
    """

    lag_rows: tuple[int, ...]
    window_rows: int
    air_share: float
    by_model: dict[str, Floats]
    weights: Floats
    less: tuple[Floats, ...]

    @property
    def best(self) -> Floats:
        """The pool's coefficients (p + 1, axes)."""
        return self.by_model[POOLED]


@dataclass(frozen=True)
class Validation:
    """Held-out results, and the final training.

    ``predicted`` (3, n, axes) is at SHIFTS_COUNTS, for each row by the fold that holds it out. ``by_model`` gives by
    name the RMSE (3, axes) of each model with its own nested lambda. ``less`` (2, axes) is the RMSE by
    TRAINING_SHARES. ``folds`` are the 20 trainings, ``final`` is the training on the whole run. ``lag_rows`` is
    the lag common to all axes over the whole run, before any correction; ``affine_r2`` is the affine model's held-out
    R2 at that lag.
    """

    run: Run
    blocks: Blocks
    predicted: Floats
    by_model: dict[str, Floats]
    less: Floats
    folds: tuple[TrainedModels, ...]
    final: TrainedModels
    lag_rows: int
    affine_r2: float

    @property
    def wrench_map(self) -> WrenchMap:
        """The map trained on the whole run."""
        return _map_of(self.run, self.final, self.margin)

    @property
    def margin(self) -> Margin:
        """The interval's margin of the force on the held-out blocks."""
        return fit_margin(*self.parts(), self.run.truth[:, :3])

    def parts(self) -> tuple[Floats, Floats]:
        """Normal and shear (n, 2) in N as held out and in truth, at the contacts that a board finds."""
        run = self.run
        late = np.clip(np.arange(len(run.counts)) + self.final.lag_rows[2], 0, len(run.counts) - 1)
        counts = np.clip(np.rint(run.counts[late]), 0, FULL_SCALE_COUNT).astype(np.uint16)
        poc_mm = compute(counts, np.clip(run.tare, 0, FULL_SCALE_COUNT))["poc_mm"]
        return published_parts(self.predicted[0, :, :3], poc_mm), grip_parts(run.truth[:, :3], poc_mm)


def _map_of(run: Run, fit: TrainedModels, margin: Margin = UNKNOWN) -> WrenchMap:
    plain = WrenchMap(POOLED, run.axes, run.tare, fit.window_rows, fit.lag_rows, fit.best, margin)
    return replace(plain, lesson=lesson_of(run, plain))


@dataclass(frozen=True)
class _Training:
    """The training data: inner folds over the ``blocks``, and lags and window chosen on ``strips`` alone."""

    blocks: list[int]
    strips: Strips
    lag_rows: tuple[int, ...]
    window_rows: int


def validate(
    run: Run,
    *,
    align: bool = True,
    windows: tuple[int, ...] = WINDOWS_ROWS,
    others: Floats | None = None,
    show: Show | None = None,
) -> Validation:
    """Hold every block out once, then train on all. ``align`` False trains with lag 0.

    ``others`` (q + 1, 3) are coefficients of a map of other fingers, to pull the force towards.

    BLAS runs on one thread meanwhile, in the whole process. Raises RecordingError when force and counts do not match.
    """
    with _trained(run, align, windows, others, [*range(BLOCKS), None]) as (blocks, (lag_rows, affine_r2), fitted):
        axes = run.truth.shape[1]
        predicted = np.full((len(SHIFTS_COUNTS), len(run.truth), axes), np.nan)
        errors: dict[str, Floats] = {}
        less = np.zeros((len(TRAINING_SHARES), axes))
        fits: list[TrainedModels] = []
        for block, fit in enumerate(fitted):
            fits.append(fit)
            if block == BLOCKS:
                break
            if show is not None:
                show(f"{run.name}: block {block + 1} of {BLOCKS} held out")
            rows = blocks.rows(block)
            # all at once: computing the columns costs more than the products
            by_each = predict(run, fit, [*fit.by_model.values(), *fit.less], rows)
            predicted[:, rows] = by_each[:, :, list(fit.by_model).index(POOLED)]
            error = ((by_each - run.truth[rows][:, None]) ** 2).sum(axis=1)
            for k, name in enumerate(fit.by_model):
                errors[name] = errors.get(name, 0.0) + error[:, k]
            less += error[0, len(fit.by_model) :]
    n = len(run.truth)
    by_model, less = {name: np.sqrt(total / n) for name, total in errors.items()}, np.sqrt(less / n)
    return Validation(run, blocks, predicted, by_model, less, tuple(fits[:-1]), fits[-1], lag_rows, affine_r2)


def fit_alone(run: Run, *, align: bool = True, others: Floats | None = None) -> WrenchMap:
    """The map of ``validate`` in half of the time: no block is held out, so the margin is UNKNOWN."""
    with _trained(run, align, WINDOWS_ROWS, others, [None]) as (_, _, fitted):
        return _map_of(run, next(fitted))


@contextmanager
def _trained(
    run: Run, align: bool, windows: tuple[int, ...], others: Floats | None, held_out: list[int | None]
) -> Iterator[tuple[Blocks, tuple[int, float], Iterator[TrainedModels]]]:
    """The blocks, the common lag with the R2, and a training for each block that is held out, None for none."""
    # Thousands of small systems: OpenBLAS's threads wait for each other, and much longer on a busy computer.
    threads = min(THREADS, os.cpu_count() or 1)
    with threadpool_limits(limits=1, user_api="blas"), ThreadPoolExecutor(threads) as pool:
        blocks = Blocks(run.rest, run.contact)
        lags = Lags(run, blocks)
        common = lags.check()
        check_sense(run)
        every = list(range(BLOCKS))
        timing = _Timing(run, blocks, windows)
        trainings = []
        for block in held_out:
            strips = blocks.own(every) if block is None else blocks.training_strips([block])
            kept = [other for other in every if other != block]
            late = lags.of_axes(strips) if align else (0,) * run.truth.shape[1]
            trainings.append(_Training(kept, strips, late, timing.window(late, kept, strips)))
        trainer = _Trainer(run, blocks, trainings, others, pool)
        yield blocks, common, pool.map(trainer.train, trainings)


def predict(run: Run, fit: TrainedModels, coefficients: Sequence[Floats], rows: Rows) -> Floats:
    """Wrenches (3, n, m, axes) at SHIFTS_COUNTS for the run's ``rows`` (n,), by each of m ``coefficients``."""
    axes = len(fit.lag_rows)
    late = np.clip(rows[:, None] + np.array(fit.lag_rows), 0, len(run.counts) - 1)
    needed, index = np.unique(late, return_inverse=True)
    index = index.reshape(late.shape)
    signals = at(smoothed(run, fit.window_rows), needed)
    every = np.concatenate(coefficients, axis=1)
    found = np.empty((len(SHIFTS_COUNTS), len(rows), len(coefficients), axes))
    for shift, counts in zip(found, SHIFTS_COUNTS, strict=True):
        wrench = columns(signals.drifted(counts * run.drift)) @ every[:-1] + every[-1]
        for axis in range(axes):
            shift[:, :, axis] = wrench[index[:, axis], axis::axes]
    return found


def _folds(blocks: Blocks, numbers: list[int], strips: Strips) -> list[tuple[Strips, Strips]]:
    """For each inner fold, the strips to train on and those to test on."""
    outs = [numbers[fold::INNER_FOLDS] for fold in range(INNER_FOLDS)]
    return [(strips & blocks.training_strips(out), strips & blocks.own(out)) for out in outs]


class _Timing:
    """Chooses how many rows to average, by the affine model, which is cheap: the noise is the same for any model."""

    def __init__(self, run: Run, blocks: Blocks, windows: tuple[int, ...]) -> None:
        # rows that are not in order of time have no neighbours to average with
        self._run, self._blocks, self._windows = run, blocks, windows if run.contact is None else windows[:1]
        self._sums: dict[tuple[int, tuple[int, ...]], WeightedSums] = {}

    def window(self, lag_rows: tuple[int, ...], numbers: list[int], strips: Strips) -> int:
        """The window in rows with the least inner error for a training."""
        error = {}
        for window in self._windows if len(self._windows) > 1 else ():
            sums = self._sums_of(window, lag_rows)
            total = np.zeros(len(lag_rows))
            for kept, out in _folds(self._blocks, numbers, strips):
                total += sums.over(out).errors(models.solve(sums.over(kept), LAMBDAS[0]))
            error[window] = float((total / np.maximum(sums.over(strips).variance(), 1e-12)).mean())
        return min(error, key=lambda window: error[window], default=self._windows[0])

    def _sums_of(self, window: int, lag_rows: tuple[int, ...]) -> WeightedSums:
        key = (window, lag_rows)
        if key not in self._sums:
            run = self._run
            signals, truth = smoothed(run, window), _late(run, list(enumerate(lag_rows)))
            self._sums[key] = stacked(
                strip_sums(at(signals, rows), truth[rows], run.drift, linear_columns) for rows in self._blocks.strips
            )
        return self._sums[key]


def _late(run: Run, which: Sequence[tuple[int, int]]) -> Floats:
    """Axes of the truth, each shifted by its lag in rows; ``which`` has (axis, lag)."""
    return np.column_stack([moved(run.truth[:, axis], lag) for axis, lag in which])


class _Trainer:
    """Trains on any choice of blocks; sums are computed once for each window, for all axes at all lags in use."""

    def __init__(
        self, run: Run, blocks: Blocks, trainings: list[_Training], others: Floats | None, pool: ThreadPoolExecutor
    ) -> None:
        self._blocks, self._others = blocks, others
        self._late = sorted({late for training in trainings for late in enumerate(training.lag_rows)})
        truth, weights = _late(run, self._late), row_weights(run)
        self._sums: dict[int, WeightedSums] = {}
        self._air: dict[int, WeightedSums | None] = {}
        for window in sorted({training.window_rows for training in trainings}):
            signals = smoothed(run, window)

            def sums_of(rows: Rows, signals: Signals = signals) -> WeightedSums:
                return strip_sums(at(signals, rows), truth[rows], run.drift, weights=weights[rows])

            self._sums[window] = stacked(pool.map(sums_of, blocks.strips))
            self._air[window] = air_sums(run, window)

    def train(self, training: _Training) -> TrainedModels:
        every, air = self._sums[training.window_rows], self._air[training.window_rows]
        every = every.axes([self._late.index(late) for late in enumerate(training.lag_rows)])
        strips, numbers = training.strips, training.blocks
        folds = _folds(self._blocks, numbers, strips)
        parts = [strips & self._blocks.own(numbers[:: round(1 / part)]) for part in TRAINING_SHARES]
        total, *each = every.over_each([strips, *(mask for fold in folds for mask in fold), *parts])
        kept, tested, less = each[: 2 * len(folds) : 2], each[1 : 2 * len(folds) : 2], each[2 * len(folds) :]
        share = 0.0
        if air is not None:
            # it is a separate recording: part of every training and of no test, a row of it as heavy as the mean
            # trained row. With the mean of all rows, the force of a held-out block would reach its prediction.
            trained = sum(len(rows) for rows, is_in in zip(self._blocks.strips, strips, strict=True) if is_in)
            air = air.times(total.rows / trained)
            share = self._air_share(kept, tested, air)
            total, *with_air = (sums.plus(air, share) for sums in (total, *kept, *less))
            kept, less = with_air[: len(kept)], with_air[len(kept) :]
        rows = sum(fold.rows for fold in tested)
        by_fold = (models.pulled(fold, MODELS, self._others) for fold in kept)
        inner = [np.array(fits) for fits in zip(*by_fold, strict=True)]
        alone = models.pulled(total, MODELS, self._others)
        by_model = {LIN: models.lin(total, offset=False), LIN_OFFSET: models.lin(total)}
        for model, fits, whole in zip(MODELS, inner, alone, strict=False):
            mse = np.sum([out.errors(fit) for fit, out in zip(fits, tested, strict=True)], axis=0) / rows
            # for comparison: one lambda for all axes
            best = int((mse / np.maximum(mse.min(axis=0), 1e-12)).mean(axis=1).argmin())
            by_model[model.name] = whole[best]
        weights = _weights(np.concatenate(inner[FIRST_OF_POOL:], axis=1), tested, rows)
        by_model[POOLED] = _mean(weights, alone[FIRST_OF_POOL:])
        fewer = tuple(_mean(weights, models.pulled(sums, POOL, self._others)) for sums in less)
        return TrainedModels(training.lag_rows, training.window_rows, share, by_model, weights, fewer)

    def _air_share(self, kept: list[WeightedSums], tested: list[WeightedSums], air: WeightedSums) -> float:
        """The weight of the free-air frames, chosen with a cheap model that bends as the pool does."""
        own = index((*GATED, *PRESSURES), len(air.gram) - 1)
        air = air.part(own)

        def error(share: float) -> Floats:
            fits = [models.solve(fold.plus(air, share), AIR_LAMBDA) for fold in small]
            errors = [out.errors(fit) for fit, out in zip(fits, outs, strict=True)]
            forces: Floats = np.sum(errors, axis=0)[:3]
            return forces

        small, outs = [fold.part(own) for fold in kept], [fold.part(own) for fold in tested]
        without = error(0.0)
        return next((share for share in AIR_SHARES if (error(share) <= AIR_COST * without).all()), AIR_SHARES[-1])


def _mean(weights: Floats, members: Sequence[Floats]) -> Floats:
    """Weighted mean of the members' coefficients (p + 1, axes)."""
    mean: Floats = np.einsum("am,mpa->pa", weights, np.concatenate(members))
    return mean


def _weights(inner: Floats, tested: list[WeightedSums], rows: float) -> Floats:
    """Weights of the members (axes, m) from their errors in the inner folds.

    ``inner`` (folds, m, p + 1, axes) are their coefficients, ``tested`` the sums of each fold's test rows.
    """
    axes = inner.shape[3]
    product = np.zeros((axes, inner.shape[1], inner.shape[1]))
    for members, out in zip(inner, tested, strict=True):
        for axis in range(axes):
            coefficients = members[:, :, axis]
            cross = coefficients @ out.cross[:, axis]
            product[axis] += coefficients @ out.gram @ coefficients.T - cross[:, None] - cross + out.square[axis]
    return np.array([models.weights(errors) for errors in product / rows])
