"""Vibration energy of dynamic pressure (PAC), in octaves.

Six smoothers in a row, each binomial (1 4 6 4 1) / 16 and twice as wide as the one before; what a smoother removes is a
band. The first sees 2200 samples a second, the others every second sample of that output, which is the same number in
every round. (The "a trous" wavelet transform with a B-spline: Starck, Murtagh and Bijaoui 1998.)
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..kernels.compiled import checked_words
from ..wire import sensor_gen as sensor
from ..wire.frames import BANDS_DTYPE, StructArray
from ..wire.messages_gen import INVALID_COUNT

#: The frequencies between which each band has at least half its power, Hz.
BANDS_HZ = ((11, 26), (22, 53), (45, 106), (91, 214), (190, 454), (527, 1100))
SAMPLES = sensor.SLOTS.count("PAC")  # of a round of 10 ms
# A smoother has two bits below the count; rounding to them is part of every band.
_PER_COUNT = 4
_PER_COUNT2 = _PER_COUNT**2


def bands_of(pac: StructArray) -> StructArray:
    """BANDS_DTYPE (n,) from one finger's PAC_DTYPE rows (n,).

    The filters restart where rounds are missing. Raises ValueError for rows of several fingers.
    """
    if len(np.unique(pac["finger"])) > 1:
        raise ValueError(f"rows are of fingers {np.unique(pac['finger']).tolist()}, expected one; select its rows")
    begins = np.flatnonzero(np.diff(pac["seq"].astype(np.int64)) != 1) + 1
    out = np.zeros(len(pac), BANDS_DTYPE)
    for name in ("finger", "seq", "t_us"):
        out[name] = pac[name]
    for part in np.split(np.arange(len(pac)), begins):
        out["good"][part], out["energy_count2"][part] = _energies(pac["pac"][part])
    return out


def pac_bands(pac: Any) -> NDArray[np.float64]:
    """Energy of each round and band (n, 6), in count^2, the lowest band first; NaN where a round has no valid word.

    The bands are BANDS_HZ. ``pac`` (n, 22) are integers 0..4095, or 0xFFFF where no valid word came; each row is a
    round of 10 ms, and no rounds are missing. An energy is the sum of squares over the round's 22 samples; the last
    good sample stands in for each missing one. Raises ValueError for another shape, type or range.
    """
    return _energies(checked_words("pac", pac, None, SAMPLES))[1]


def _energies(words: NDArray[np.uint16]) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    known = words != INVALID_COUNT
    good = known.sum(axis=1)
    energy_count2 = np.full((len(words), len(BANDS_HZ)), np.nan)
    if not known.any():
        return good, energy_count2
    flat, at = words.ravel().astype(np.int64), np.arange(words.size)
    first = flat[np.argmax(known)]
    held = np.maximum.accumulate(np.where(known.ravel(), at, -1))
    line = _PER_COUNT * np.where(held < 0, first, flat[held])
    before = _PER_COUNT * first  # as if the first sample had always been there
    line, removed = _smoothed(line, before, 1)
    energy_count2[:, -1] = _per_round(removed, len(words))
    line, apart = line[1::2], 1
    for band in range(len(BANDS_HZ) - 2, -1, -1):
        line, removed = _smoothed(line, before, apart)
        energy_count2[:, band] = 2 * _per_round(removed, len(words))  # each slow sample stands for two
        apart *= 2
    energy_count2[good == 0] = np.nan
    return good, energy_count2


def _smoothed(line: NDArray[np.int64], before: int, apart: int) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """The smoother's output and the rest, removed by it; the taps are ``apart`` samples apart."""
    padded = np.concatenate([np.full(4 * apart, before), line])
    taps = [padded[k * apart : k * apart + len(line)] for k in range(5)]
    left = (taps[0] + 4 * (taps[1] + taps[3]) + 6 * taps[2] + taps[4] + 8) >> 4
    return left, taps[2] - left


def _per_round(removed: NDArray[np.int64], rounds: int) -> NDArray[np.float64]:
    energy: NDArray[np.float64] = np.square(removed).reshape(rounds, -1).sum(axis=1) / _PER_COUNT2
    return energy
