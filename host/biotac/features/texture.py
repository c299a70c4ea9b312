"""What is rubbed, tapped or poked, by how dynamic pressure (PAC) vibrates: band energies and a linear classifier.

    found = classifier().fit(describe_all(recordings), labels)     # recordings: PAC of one poke, tap or slide each
    found.predict(describe_all(others))

A description is of logarithms, so that how hard it was rubbed is a shift; and of quantiles over time, so that it does
not matter when it was, nor how long. The same comes of BANDS messages: describe(bands["energy_count2"]).
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from ..core.bands import BANDS_HZ, SAMPLES, pac_bands
from ..errors import InputError
from ..wire.sensor_gen import FULL_SCALE_COUNT

if TYPE_CHECKING:
    from sklearn.pipeline import Pipeline

Floats = npt.NDArray[np.float64]

QUANTILES = (0.1, 0.5, 0.9, 1.0)  # over rounds
FLOOR_COUNT2 = 1.0  # added to the mean square: no logarithm of nothing
_MIDDLE = (FULL_SCALE_COUNT + 1) // 2


def energies(pac: npt.ArrayLike) -> Floats:
    """Energy of each band in each round of 10 ms (n // 22, 6), count^2, by the board's own code.

    ``pac`` is (n,) samples at 2200 Hz in counts, one after the other, as read or tared, whole or not; a rest behind the
    last whole round is left out. Only changes count. What lies more than 2047 counts from the median is cut off. Raises
    InputError for another shape, for less than a round, or where a sample is NaN.
    """
    samples = np.asarray(pac, dtype=np.float64)
    if samples.ndim != 1 or len(samples) < SAMPLES:
        raise InputError(f"pac is of shape {samples.shape}: expected (n,) samples, at least {SAMPLES}; flatten rounds")
    if not np.isfinite(samples).all():
        raise InputError(f"{(~np.isfinite(samples)).sum()} samples are not finite: leave out, or fill, what is missing")
    rounds = samples[: len(samples) // SAMPLES * SAMPLES]
    words = np.clip(np.rint(rounds - np.median(rounds)) + _MIDDLE, 0, FULL_SCALE_COUNT).astype(np.uint16)
    return pac_bands(words.reshape(-1, SAMPLES))


def describe(energy_count2: npt.ArrayLike) -> Floats:
    """Energies (n, 6) of one recording as a row for a classifier (24,): each band's quantiles over rounds, log10.

    Rounds with a NaN are left out. Raises InputError for another shape or where no round is left.
    """
    energy = np.asarray(energy_count2, dtype=np.float64)
    if energy.ndim != 2 or energy.shape[1] != len(BANDS_HZ):
        raise InputError(f"energies are of shape {energy.shape}: expected (n, {len(BANDS_HZ)})")
    known = energy[np.isfinite(energy).all(axis=1)]
    if not len(known):
        raise InputError(f"none of {len(energy)} rounds has all its energies: expected one at least")
    level = np.log10(known / SAMPLES + FLOOR_COUNT2)
    row: Floats = np.quantile(level, QUANTILES, axis=0).ravel()
    return row


def describe_all(recordings: Iterable[npt.ArrayLike]) -> Floats:
    """A row of describe() for each of some recordings of PAC, (k, 24); they may be of different lengths."""
    return np.array([describe(energies(pac)) for pac in recordings]).reshape(-1, len(QUANTILES) * len(BANDS_HZ))


def classifier(**options: Any) -> Pipeline:
    """A linear classifier of such rows, to be fitted: logistic regression on columns scaled to one deviation.

    ``options`` are LogisticRegression's. Needs the extra ``features``.
    """
    from sklearn.linear_model import LogisticRegression
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import StandardScaler

    return make_pipeline(StandardScaler(), LogisticRegression(**{"C": 1.0, "max_iter": 3000, **options}))
