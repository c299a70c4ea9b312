"""The map of the fingertip keeps lengths along the lines of the map."""

import numpy as np

from biotac.kernels.unroll import unroll
from biotac.wire import sensor_gen as sensor

R = 5.08


def test_angles_and_lengths_become_arcs() -> None:
    angle, x = np.radians(50), -7.0
    (across,), (along,) = unroll(np.array([[x, R * np.sin(angle), -R * np.cos(angle)]]))
    assert np.isclose(across, R * angle)
    assert along == x
    climb = np.radians(30)
    tip = R * np.array([[np.sin(climb), np.cos(climb) * np.sin(angle), -np.cos(climb) * np.cos(angle)]])
    (across,), (along,) = unroll(tip)
    assert np.isclose(across, R * angle)
    assert np.isclose(along, R * climb)


def test_the_sensor_is_symmetric_and_e11_is_on_the_right() -> None:
    across, along = unroll(np.array(sensor.ELECTRODE_UM) / 1000)
    place = {n: (a, b) for n, a, b in zip(sensor.ELECTRODE_NAMES, across, along, strict=True)}
    for left, right in (("E1", "E11"), ("E2", "E12"), ("E6", "E16"), ("E8", "E9")):
        assert np.allclose(place[left], np.multiply(place[right], (-1, 1)))
        assert place[right][0] > 0
    assert place["E17"] == (0.0, -2.8)


def test_nothing_is_nowhere() -> None:
    across, along = unroll(np.full((1, 3), np.nan))
    assert np.isnan(across).all() and np.isnan(along).all()
