"""Two clocks aligned by the load: the rest of an error after a jump, and a reference as slow as may be."""

import numpy as np
import pytest

from biotac import RecordingError
from biotac.clock.alignment import align, means


def loads() -> tuple[np.ndarray, np.ndarray]:
    """Four minutes of irregular presses at 100 Hz: times, and the load at each."""
    rng = np.random.default_rng(4)
    t_s = np.arange(0.0, 240.0, 0.01)
    return t_s, np.interp(t_s, np.cumsum(rng.uniform(0.2, 0.8, 600)), rng.uniform(0.0, 5.0, 600))


@pytest.mark.parametrize("jump_s", [0.7, -0.7])
def test_a_clock_that_jumps_is_told_with_its_time(jump_s: float) -> None:
    t_s, load = loads()
    align("x", t_s, load, t_s + 50.0, load)
    late = t_s + 50.0 + np.where(t_s > 150.0, jump_s, 0.0)
    with pytest.raises(RecordingError, match="5 of 15 pieces, 158 to 218 s after the start, match at no shift"):
        align("x", t_s, load, late, load)


def test_a_reference_of_the_stated_minimum_has_no_gaps() -> None:
    t_s = np.arange(100) / 20.0 + np.random.default_rng(2).normal(0.0, 1e-3, 100)
    assert np.isfinite(means(t_s, np.ones((100, 1)), np.arange(0.1, 4.8, 0.01))).all()
    assert np.isnan(means(np.delete(t_s, 50), np.ones((99, 1)), np.array([2.5]))).all()
