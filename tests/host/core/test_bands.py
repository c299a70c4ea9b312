"""Bands of dynamic pressure, computed of PAC."""

import zlib
from typing import Any

import numpy as np
import pytest

import biotac
from biotac.core.bands import BANDS_HZ, bands_of, pac_bands
from biotac.wire import messages_gen as wire

PER_S = 2200


def sine(hz: float, counts: float, rounds: int = 40) -> Any:
    k = np.arange(22 * rounds)
    return np.rint(2038 + counts * np.sin(2 * np.pi * hz * k / PER_S)).astype(int).reshape(-1, 22)


def test_a_band_has_half_its_power_at_its_ends() -> None:
    for band, (low_hz, high_hz) in enumerate(BANDS_HZ):
        power = {hz: pac_bands(sine(hz, 1500, 200))[50:, band].mean() for hz in (*range(low_hz - 3, 1100, 5), high_hz)}
        half = max(power.values()) / 2
        inside = [hz for hz, share in power.items() if share > half * 1.03]
        assert low_hz - 3 <= min(inside) <= low_hz + 5 and high_hz - 5 <= max(inside) <= max(high_hz + 3, 1100)


def test_energies_are_to_the_bit_those_that_boards_sent() -> None:
    """Bands of 300 rounds with a fifth of the words missing, as the firmware had computed them in C."""
    random = np.random.default_rng(64)
    pac = random.integers(0, 4096, (300, 22))
    pac = np.where(random.random((300, 22)) < 0.2, wire.INVALID_COUNT, pac)
    pac[:2] = pac[77] = pac[2, :5] = wire.INVALID_COUNT
    assert zlib.crc32(pac_bands(pac).tobytes()) == 3571742587


def test_it_begins_anew_behind_lost_rounds() -> None:
    rows = np.zeros(40, biotac.PAC_DTYPE)
    rows["seq"] = np.arange(40)
    rows["pac"] = sine(60, 900)
    left = np.delete(rows, slice(10, 13))
    assert bands_of(left)[10:].tobytes() == bands_of(rows[13:]).tobytes()


def test_rounds_without_a_word_have_no_energy() -> None:
    pac = sine(100, 300)
    pac[7] = wire.INVALID_COUNT
    assert np.flatnonzero(np.isnan(pac_bands(pac)).any(axis=1)).tolist() == [7]


@pytest.mark.parametrize(
    ("pac", "words"),
    [
        (np.zeros((3, 21), int), r"pac have shape \(3, 21\), expected \(n, 22\)"),
        (np.zeros((3, 22)), "pac are float64, expected integers"),
        (np.full((3, 22), 5000), "pac row 0 holds 5000, expected 0..4095"),
    ],
)
def test_what_is_no_pac_is_refused(pac: Any, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        pac_bands(pac)
