"""tools/bench/front without the emulators: each kernel's errors are within the bounds of the kernel's arithmetic."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import kernel_errors
from biotac.kernels.compiled import FORCE_GAINS, default_settings
from biotac.wire.messages_gen import PocWeights
from kernel_errors import MILLI, NAMES, QUANTITIES

ROOT = Path(__file__).resolve().parents[2]
# The double only rounds; a float is off by 26 half units of 2^-23 of a sum, which the projection magnifies by
# up to 4.6; exact rounds to nm; the shipped kernel's bound is in firmware/reference/kernel_bounds.h. The quick one
# takes the root in the middle of a step of 2^-7, so it is off by 2^-9 of 7 mm, and cuts components of 14 bits.
POC_BOUNDS_UM = {"double": 1e-8, "float": 0.17, "exact int64": 0.002, "shipped": 1.5, "quick": 7000 / 2**9 + 3}


@pytest.mark.nightly  # by day tests/core/solve/test_kernels.c judges the shipped one
@pytest.mark.parametrize("weights", PocWeights)
@pytest.mark.parametrize("name", POC_BOUNDS_UM)
def test_a_kernel_is_within_its_bound(name: str, weights: PocWeights) -> None:
    error = kernel_errors.errors(name, weights, kernel_errors.frames(weights, 500))[:, 0]
    assert not np.isinf(error).any()
    assert max(np.nanmax(error), kernel_errors.climbed_um(name, weights, 50)) <= POC_BOUNDS_UM[name]


@pytest.mark.parametrize("weights", PocWeights)
def test_one_step_of_the_adc_is_what_rounding_does(weights: PocWeights) -> None:
    """The force's bound from theory: each electrode's rounding is uniform, so the sum's variance is known."""
    gains = np.array([default_settings()[gain] for gain in FORCE_GAINS]) * 1e-9
    step = dict(zip(QUANTITIES, kernel_errors.one_adc_step(weights), strict=True))
    largest = np.sqrt(((MILLI * gains) ** 2).sum(axis=0) / 12).max()
    assert step["force"] == pytest.approx(largest, rel=0.1)
    assert 0 < step["PoC"] < 200


@pytest.mark.nightly
def test_errors_alone_need_no_board() -> None:
    words = [sys.executable, ROOT / "tools/bench/front", "--errors", "--frames", "50", "--steps", "5"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (0, "")
    for name in NAMES:
        assert done.stdout.count(f"| {name} |") == len(PocWeights)
