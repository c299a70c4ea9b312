"""Which model, and what it is worth on rows it has never seen.

Nested: each of the blocks is held out once, and everything that is chosen for it - lag, smoothing,
lambda and model, per axis - is chosen by a second cross-validation inside the other blocks. What is
reported is therefore the procedure's error and not the luckiest of many.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from ...core.geometry import Floats
from ...core.map_columns import Signals
from . import features
from .blocks import BLOCKS, Blocks
from .lag import best_lag, check, lag_moments
from .models import AFFINE, GATED, LAMBDAS, MODELS, POOL, POOLED, TEMPLATE, solve, squared_errors, truth_variance, used
from .moments import Rows, air_moments, drifted, linear_columns, moments, smoothed, with_one
from .run import Run
from .template import Template

INNER_FOLDS = 5
WINDOWS_ROWS = (1, 5)  # as recorded, or the mean of five: half the noise for 20 ms of delay at 100 Hz
# What the frames in free air weigh against the run's. A finger that never rests leaves the map free to say half a
# newton in air; but where light presses are scarce, holding it at zero bends the map in contact. So: the most that
# costs no force axis more than a twentieth of its error.
AIR_SHARES = (0.05, 0.01, 0.003)
AIR_COST = 1.1  # in squared error
SHIFTS_COUNTS = (0.0, 100.0, -100.0)  # un-tared drift the result is tried with

Show = Callable[[str], None]
Strips = npt.NDArray[np.bool_]


@dataclass(frozen=True)
class Choice:
    """What predicts one axis: ``coefficients`` (p + 1,) of features.columns, the offset last.

    ``inner_mse`` is the mean squared error of the inner cross-validation, over drift, in the truth's
    unit squared. ``lam`` is NaN for the pool, whose parts have their own.
    """

    model: str
    lam: float
    inner_mse: float
    coefficients: Floats


@dataclass(frozen=True)
class Fit:
    """One training: the choice per axis for every model by name, and ``best`` of them per axis.

    ``air_share`` is the weight of the frames in free air, of the run's; 0 without any.
    """

    lag_rows: int
    window_rows: int
    air_share: float
    by_model: dict[str, tuple[Choice, ...]]

    @property
    def best(self) -> tuple[Choice, ...]:
        """The choice with the least inner error, per axis."""
        return tuple(
            min(axis, key=lambda choice: choice.inner_mse) for axis in zip(*self.by_model.values(), strict=True)
        )


@dataclass(frozen=True)
class Validation:
    """Everything held out; ``axes`` columns throughout.

    ``predicted`` (3, n, axes) at SHIFTS_COUNTS by the best choice of each row's own fold; ``by_model``
    name -> RMSE (3, axes), each with its own nested lambda, and TEMPLATE's; ``folds`` the 20 trainings;
    ``final`` the training on the whole run; ``lag_rows`` of the whole run before any correction;
    ``affine_r2`` held-out R2 of the affine model there.
    """

    run: Run
    blocks: Blocks
    predicted: Floats
    by_model: dict[str, Floats]
    folds: tuple[Fit, ...]
    final: Fit
    lag_rows: int
    affine_r2: float


class _Trainer:
    """Trains on any choice of blocks; sums are kept per window and lag."""

    def __init__(self, run: Run, blocks: Blocks, windows: tuple[int, ...]) -> None:
        self.run, self.blocks, self.windows = run, blocks, windows
        self.axes = run.truth.shape[1]
        self._full: dict[tuple[int, int], Floats] = {}
        self._linear: dict[tuple[int, int], Floats] = {}
        self._air = air_moments(run)

    def train(self, lag_rows: int, of: list[int], strips: Strips) -> Fit:
        """Fit all models on ``strips``, with inner folds over the blocks ``of``."""
        window = self._window(lag_rows, of, strips)
        key = (window, lag_rows)
        if key not in self._full:
            self._full[key] = moments(self.run, self.blocks, *key)
        sums = self._full[key]
        size = sums.shape[1]
        folds = self._folds(of, strips)
        total = sums[strips].sum(axis=0)
        # each is a sum over tens of large matrices: made once
        gone = [sums[strips].sum(axis=0) for strips, _ in folds]
        tested = [sums[out].sum(axis=0) for _, out in folds]
        air_share = self._air_share(total, gone, tested)
        if self._air is not None:
            # another recording than the run: it is in every training and in no test
            total = total + air_share * self._air
        kept = [total - out for out in gone]
        rows = sum(float(test[-self.axes - 1, -self.axes - 1]) for test in tested)
        by_model: dict[str, tuple[Choice, ...]] = {}
        inner: dict[str, list[Floats]] = {}
        for model in MODELS:
            index = used(model, size, self.axes)
            grid = np.ix_(index, index)
            fits = [solve(model, part[grid], self.axes, self.run.tare) for part in kept]
            errors = sum(squared_errors(f, test[grid], self.axes) for f, test in zip(fits, tested, strict=True))
            mse = np.asarray(errors) / rows
            best = np.argmin(mse, axis=0)
            whole = self._embed(solve(model, total[grid], self.axes, self.run.tare), best, index, size)
            lam = [float(LAMBDAS[k]) if model.how == "ridge" else 0.0 for k in best]
            by_model[model.name] = tuple(
                Choice(model.name, lam[a], float(mse[best[a], a]), whole[:, a]) for a in range(self.axes)
            )
            if model.name in POOL:
                inner[model.name] = [self._embed(f, best, index, size) for f in fits]
        pooled = [np.mean(parts, axis=0) for parts in zip(*inner.values(), strict=True)]
        errors = sum(squared_errors(f[None], test, self.axes)[0] for f, test in zip(pooled, tested, strict=True))
        by_model[POOLED] = tuple(
            Choice(
                POOLED,
                float("nan"),
                float(np.asarray(errors)[a] / rows),
                np.mean([by_model[name][a].coefficients for name in POOL], axis=0),
            )
            for a in range(self.axes)
        )
        return Fit(lag_rows, window, air_share, by_model)

    def _folds(self, of: list[int], strips: Strips) -> list[tuple[Strips, Strips]]:
        """Per inner fold the strips that are not trained on and those that are tested."""
        result = []
        for fold in range(INNER_FOLDS):
            out = of[fold::INNER_FOLDS]
            result.append((strips & ~self.blocks.kept_from(out), strips & self.blocks.own(out)))
        return result

    def _embed(self, fits: Floats, best: npt.NDArray[np.intp], index: npt.NDArray[np.intp], size: int) -> Floats:
        """The best of each axis of fits (k, p + 1, axes) as coefficients of all columns (P + 1, axes)."""
        whole = np.zeros((size - self.axes, self.axes))
        for axis, k in enumerate(best):
            whole[index[: -self.axes], axis] = fits[k, :, axis]
        return whole

    def _air_share(self, total: Floats, gone: list[Floats], tested: list[Floats]) -> float:
        """By a model that bends as the chosen one will, and costs a tenth."""
        if self._air is None:
            return 0.0
        index = used(GATED, len(total), self.axes)
        grid = np.ix_(index, index)
        air = self._air[grid]
        kept = [(total - out)[grid] for out in gone]
        tested = [test[grid] for test in tested]

        def error(share: float) -> Floats:
            fits = [solve(GATED, part + share * air, self.axes, self.run.tare) for part in kept]
            errors = sum(squared_errors(f, test, self.axes) for f, test in zip(fits, tested, strict=True))
            forces: Floats = np.asarray(errors).min(axis=0)[:3]
            return forces

        without = error(0.0)
        return next((share for share in AIR_SHARES if (error(share) <= AIR_COST * without).all()), 0.0)

    def _window(self, lag_rows: int, of: list[int], strips: Strips) -> int:
        """By the affine model, which costs little: noise is noise whatever is fitted to it."""
        error: dict[int, float] = {}
        for window in self.windows:
            key = (window, lag_rows)
            if key not in self._linear:
                self._linear[key] = moments(self.run, self.blocks, *key, linear_columns)
            sums = self._linear[key]
            total = sums[strips].sum(axis=0)
            errors = np.zeros((len(LAMBDAS), self.axes))
            for gone, out in self._folds(of, strips):
                fit = solve(AFFINE, total - sums[gone].sum(axis=0), self.axes, self.run.tare)
                errors += squared_errors(fit, sums[out].sum(axis=0), self.axes)
            error[window] = float((errors.min(axis=0) / np.maximum(truth_variance(total, self.axes), 1e-12)).mean())
        return min(error, key=lambda window: error[window])


def validate(
    run: Run, *, align: bool = True, windows: tuple[int, ...] = WINDOWS_ROWS, show: Show | None = None
) -> Validation:
    """Hold every block out once, then train on all. ``align`` False takes rows as they stand, lag 0.

    BLAS runs on one thread meanwhile, in the whole process. Raises RecordingError when force and counts
    do not follow each other.
    """
    # Thousands of small systems: OpenBLAS's threads wait for each other, and on a busy computer for much longer.
    with threadpool_limits(limits=1, user_api="blas"):
        return _validate(run, align, windows, show)


def _validate(run: Run, align: bool, windows: tuple[int, ...], show: Show | None) -> Validation:
    blocks = Blocks(run.rest, run.contact)
    axes = run.truth.shape[1]
    at_lags = lag_moments(run, blocks)
    lag_rows, affine_r2 = check(run, blocks, at_lags)
    trainer = _Trainer(run, blocks, windows)
    template = Template(run)
    predicted = np.full((len(SHIFTS_COUNTS), len(run.truth), axes), np.nan)
    errors: dict[str, Floats] = {}
    folds: list[Fit] = []
    for block in range(BLOCKS):
        if show is not None:
            show(f"{run.name}: block {block + 1} of {BLOCKS} held out")
        strips = blocks.kept_from([block])
        others = [other for other in range(BLOCKS) if other != block]
        fit = trainer.train(best_lag(run, at_lags, strips) if align else 0, others, strips)
        folds.append(fit)
        rows = blocks.rows(block)
        every_choice = [fit.best, *fit.by_model.values()]
        # side by side: their columns cost more than their sums
        said = np.split(predict(run, fit, tuple(chain(*every_choice)), rows), len(every_choice), axis=2)
        predicted[:, rows] = said[0]
        for name, guess in zip(fit.by_model, said[1:], strict=True):
            errors[name] = errors.get(name, 0.0) + ((guess - run.truth[rows]) ** 2).sum(axis=1)
        trained = np.concatenate([blocks.strips[k] for k in np.flatnonzero(strips)])
        guess = template.held_out(fit.window_rows, fit.lag_rows, trained, rows, SHIFTS_COUNTS)
        errors[TEMPLATE] = errors.get(TEMPLATE, 0.0) + ((guess - run.truth[rows]) ** 2).sum(axis=1)
    every = list(range(BLOCKS))
    final = trainer.train(lag_rows if align else 0, every, blocks.own(every))
    by_model = {name: np.sqrt(total / len(run.truth)) for name, total in errors.items()}
    return Validation(run, blocks, predicted, by_model, tuple(folds), final, lag_rows, affine_r2)


def predict(run: Run, fit: Fit, choices: tuple[Choice, ...], rows: Rows | None = None) -> Floats:
    """What ``choices`` make of the run's ``rows`` at every drift of SHIFTS_COUNTS: (3, n, choices)."""
    coefficients = np.column_stack([choice.coefficients for choice in choices])
    index = np.arange(len(run.counts)) if rows is None else rows

    def mapped(signals: Signals) -> Floats:
        wrench: Floats = with_one(features.columns(signals)) @ coefficients
        return wrench

    at_shifts = [
        smoothed(run, fit.window_rows, fit.lag_rows, index, drifted(run, counts, mapped)) for counts in SHIFTS_COUNTS
    ]
    return np.array(at_shifts)
