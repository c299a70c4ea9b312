"""`biotac-lab finger`: its measures, on signals whose gain and hysteresis are known."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from biotac_lab.calibrate.finger_command import Touched, _memory, _pressed


def test_straight_presses_mend_some_of_a_gain() -> None:
    truth = np.column_stack([np.zeros((60, 2)), np.linspace(1.0, 7.0, 60)])
    weak = SimpleNamespace(force=lambda counts, tare: 0.7 * truth)
    left_n = _pressed(weak, Touched(np.zeros((60, 19)), np.zeros(19), truth), seed=1)
    assert left_n[2] < np.sqrt(((0.3 * truth[:, 2]) ** 2).mean())


def test_a_signal_that_is_higher_as_force_falls_remembers() -> None:
    t_s = np.arange(0, 20, 0.01)
    size_n = 4.0 - 2.0 * np.cos(t_s)
    assert _memory(3.0 * size_n, size_n) == pytest.approx(1.0)
    assert _memory(size_n * np.where(np.sin(t_s) > 0, 1.0, 1.1), size_n) == pytest.approx(1.1, abs=1e-3)
