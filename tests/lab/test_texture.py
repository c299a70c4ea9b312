"""Textures by band energies: of signals that were made to differ, and of real ones."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from biotac.errors import InputError
from biotac_lab.learn import texture


def rubbed(hz: float, seed: int, samples: int = 220) -> Any:
    """A tenth of a second of noise and of a buzz that comes and goes, above rest."""
    rng = np.random.default_rng(seed)
    k = np.arange(samples)
    buzz = 40 * np.sin(2 * np.pi * hz * k / 2200 + rng.uniform(0, 6)) * (k > rng.integers(20, 100))
    return np.rint(rng.normal(0.0, 4.0, samples) + rng.uniform(0.7, 1.3) * buzz)


def test_short_taps_are_told_apart() -> None:
    kinds = (60.0, 150.0, 400.0, 0.0)
    taps = [(hz, rubbed(hz, 10 * n + int(hz))) for hz in kinds for n in range(20)]
    rows, labels = texture.describe_all(pac for _, pac in taps), np.array([hz for hz, _ in taps])
    odd = np.arange(len(taps)) % 2 == 1
    assert texture.classifier().fit(rows[odd], labels[odd]).score(rows[~odd], labels[~odd]) > 0.95


def test_only_changes_count() -> None:
    pac = rubbed(150, 3)
    wanted = texture.energies(pac)
    assert np.array_equal(texture.energies(pac + 2038), wanted)
    assert np.array_equal(texture.energies(list(pac) + [7.0] * 21), wanted)  # no whole round
    assert np.array_equal(texture.energies(-pac)[2:] > 0, wanted[2:] > 0)


def test_what_cannot_be_described_is_refused() -> None:
    with pytest.raises(InputError, match="at least 22"):
        texture.energies(np.zeros(21))
    with pytest.raises(InputError, match="1 samples are not finite"):
        texture.energies([np.nan, *range(30)])
    with pytest.raises(InputError, match="none of 2 rounds"):
        texture.describe(np.full((2, 6), np.nan))


@pytest.mark.nightly
def test_what_is_held_is_told_by_real_taps(shared_data: Path) -> None:
    data = np.load(shared_data / "taps/handover.npz")
    from sklearn.model_selection import cross_val_score

    signals = {shape: data[f"handover_{shape}_signals"] for shape in ("rod", "box", "plate")}
    rows = texture.describe_all(pac for blocks in signals.values() for pac in blocks)
    labels = np.repeat(list(signals), [len(blocks) for blocks in signals.values()])
    assert cross_val_score(texture.classifier(), rows, labels, cv=5).mean() > 0.9
