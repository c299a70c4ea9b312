"""Texture from the vibration of dynamic pressure (PAC) in pokes, taps and slides: band energies, linear classifier.

    found = classifier().fit(describe_all(recordings), labels)     # recordings: PAC of one poke, tap or slide each
    found.predict(describe_all(others))

A description holds logarithms, so that rubbing harder is only a shift, and quantiles over time, so that it does not
matter when the contact was or how long it lasted. A recording's bands give the same: describe(bands["energy_count2"]).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import numpy as np
import numpy.typing as npt

from biotac import InputError
from biotac.core import BANDS_HZ, SAMPLES, pac_bands
from biotac.wire import sensor

Floats = npt.NDArray[np.float64]

QUANTILES = (0.1, 0.5, 0.9, 1.0)  # over rounds
FLOOR_COUNT2 = 1.0  # added to the mean square, so that there is no logarithm of 0
_MIDDLE = (sensor.FULL_SCALE_COUNT + 1) // 2


def energies(pac: npt.ArrayLike) -> Floats:
    """Energy of each band in each round of 10 ms (n // 22, 6), in count^2, by the board's own code.

    ``pac`` is (n,) consecutive samples at 2200 Hz in counts, as read or tared, whole numbers or not. Samples after the
    last whole round are left out. Only changes matter. Samples more than 2047 counts from the median are clipped.
    Raises InputError for another shape, for less than a round, or if a sample is not finite.
    """
    samples = np.asarray(pac, dtype=np.float64)
    if samples.ndim != 1 or len(samples) < SAMPLES:
        raise InputError(f"pac has shape {samples.shape}: expected (n,), at least {SAMPLES} samples; flatten rounds")
    if not np.isfinite(samples).all():
        raise InputError(f"{(~np.isfinite(samples)).sum()} samples are not finite: drop or fill the missing ones")
    rounds = samples[: len(samples) // SAMPLES * SAMPLES]
    words = np.clip(np.rint(rounds - np.median(rounds)) + _MIDDLE, 0, sensor.FULL_SCALE_COUNT).astype(np.uint16)
    return pac_bands(words.reshape(-1, SAMPLES))


def describe(energy_count2: npt.ArrayLike) -> Floats:
    """Energies (n, 6) of one recording as a row (24,) for a classifier: quantiles over rounds of each band's log10.

    Rounds with a NaN are left out. Raises InputError for another shape or where no round is left.
    """
    energy = np.asarray(energy_count2, dtype=np.float64)
    if energy.ndim != 2 or energy.shape[1] != len(BANDS_HZ):
        raise InputError(f"energies have shape {energy.shape}: expected (n, {len(BANDS_HZ)})")
    known = energy[np.isfinite(energy).all(axis=1)]
    if not len(known):
        raise InputError(f"none of {len(energy)} rounds has all its energies: expected at least one; use more rounds")
    level = np.log10(known / SAMPLES + FLOOR_COUNT2)
    return np.quantile(level, QUANTILES, axis=0).ravel()


def describe_all(recordings: Iterable[npt.ArrayLike]) -> Floats:
    """describe() of each recording of PAC, (k, 24); they may have different lengths."""
    return np.array([describe(energies(pac)) for pac in recordings]).reshape(-1, len(QUANTILES) * len(BANDS_HZ))


def classifier() -> Any:
    """An unfitted linear classifier of such rows: logistic regression on columns scaled to unit variance."""
    from sklearn.linear_model import LogisticRegression  # half a second to import
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    return make_pipeline(StandardScaler(), LogisticRegression(C=1.0, max_iter=3000))
