"""The corrected normal: the errors it mends, that contacts are held out whole, and the file."""

from dataclasses import replace

import numpy as np
import pytest

from biotac.calibrate.wrench import angles_deg
from biotac.core import geometry as surface
from biotac.errors import InputError
from biotac_lab.calibrate import normal


def looks(contacts: int = 12, frames: int = 20) -> normal.Looks:
    """A finger with published points that turn with the electrodes' signals."""
    rng = np.random.default_rng(9)
    contact = np.repeat(np.arange(contacts), frames)
    roll = np.repeat(rng.uniform(-0.8, 0.8, contacts), frames)
    e = rng.normal(-300.0, 100.0, (contacts * frames, 19))
    pattern = e / np.linalg.norm(e, axis=1, keepdims=True)
    seen = roll + 0.3 + pattern[:, 4]

    def at(angle: np.ndarray) -> np.ndarray:
        return np.column_stack([np.zeros_like(angle), np.sin(angle), -np.cos(angle)])

    points = surface.RADIUS_MM * at(seen) + [-5.0, 0.0, 0.0]
    return normal.Looks(points, e, at(roll), contact)


def test_what_the_electrodes_say_of_the_error_is_mended_on_contacts_that_were_not_trained_on() -> None:
    looked = looks()
    before = np.median(angles_deg(surface.normals_at(looked.points_mm), looked.normals))
    after = np.median(angles_deg(normal.held_out(looked), looked.normals))
    assert after < 0.25 * before
    turned = normal.fit(looked).point_mm(looked.points_mm, looked.e)
    truth = np.column_stack([looked.points_mm[:, 0], surface.RADIUS_MM * looked.normals[:, 1:]])
    was, left = (np.median(np.linalg.norm(points - truth, axis=1)) for points in (looked.points_mm, turned))
    assert left < 0.25 * was
    assert turned[:, 0] == pytest.approx(-5.0)  # a plate says nothing of where along the cylinder


def test_nothing_of_a_contact_reaches_its_own_prediction() -> None:
    looked = looks()
    spoilt = looked.normals.copy()
    spoilt[looked.contact == 3] = [1.0, 0.0, 0.0]
    one, other = normal.held_out(looked), normal.held_out(replace(looked, normals=spoilt))
    assert np.array_equal(one[looked.contact == 3], other[looked.contact == 3])
    assert not np.allclose(one[looked.contact == 4], other[looked.contact == 4])


def test_a_frame_without_a_point_has_no_normal() -> None:
    looked = looks()
    points = looked.points_mm.copy()
    points[5] = np.nan
    found = normal.fit(looked).corrected(points, looked.e)
    assert np.isnan(found[5]).all() and np.isfinite(found[6]).all()


def test_few_contacts_are_refused() -> None:
    with pytest.raises(InputError, match="7 contacts with the plate: expected 8"):
        normal.fit(looks(7))
