"""The force plate's own point of contact: closed form and mesh against the forward computation."""

import numpy as np
import pytest

from biotac.calibrate.wrench.contact import MESH_STEP_MM, locate, locate_on_mesh, moment

R = 5.08  # mm, Lin 2013: written here because the geometry under test is the package's


def contacts(n: int, seed: int = 0) -> tuple[np.ndarray, ...]:
    """Points, outward normals, forces that press, torsions: by hand from the shape."""
    rng = np.random.default_rng(seed)
    x, angle = rng.uniform(-16.0, 0.95 * R, n), rng.uniform(-1.5, 1.5, n)
    radius = np.sqrt(R**2 - np.maximum(x, 0.0) ** 2)
    point = np.column_stack([x, radius * np.sin(angle), -radius * np.cos(angle)])
    normal = point * [[1.0, 1.0, 1.0]]
    normal[:, 0] = np.maximum(normal[:, 0], 0.0)
    normal /= R
    shear = rng.normal(0.0, 2.0, (n, 3))
    shear -= (shear * normal).sum(axis=1, keepdims=True) * normal
    force = shear - normal * rng.uniform(0.2, 20.0, (n, 1))
    return point, normal, force, rng.normal(0.0, 10.0, n)


@pytest.mark.parametrize("torsion", ["some", "none", "a trace"])
def test_the_closed_form_undoes_the_forward_computation(torsion: str) -> None:
    point, normal, force, twist = contacts(4000)
    twist = twist * {"some": 1.0, "none": 0.0, "a trace": 1e-9}[torsion]
    torque = np.cross(point, force) + twist[:, None] * normal
    np.testing.assert_allclose(moment(point, force, twist), torque, atol=1e-12)
    found = locate(force, torque)
    # rounding is 1e-11 mm; a slip in a sign or branch is millimetres
    assert np.abs(found.point_mm - point).max() < 1e-9
    assert np.abs(found.normal - normal).max() < 1e-9
    assert np.abs(found.normal_force_n + (force * normal).sum(axis=1)).max() < 1e-9
    assert np.abs(found.torsion_nmm - twist).max() < 1e-9
    assert not found.missed.any()
    assert found.on_skin.all()


def test_what_has_no_contact_is_nan_and_flagged() -> None:
    force = np.array([[0.0, 0.0, 0.0], [np.nan, 0.0, 1.0], [0.0, 0.0, 2.0], [0.0, 0.0, 2.0], [0.0, 0.0, -2.0]])
    # third: pulls the line of action 20 mm aside; fourth: 40 mm behind the origin; fifth: pushed from the nail's side
    torque = np.array([[0.0] * 3, [0.0] * 3, [40.0, 10.0, 0.0], [0.0, 80.0, 0.0], [0.0, -10.0, 0.0]])
    found = locate(force, torque)
    assert np.isnan(found.point_mm[:3]).all()
    assert np.isnan(found.torsion_nmm[:2]).all()
    assert not found.on_skin.any()
    assert found.missed.tolist() == [False, False, True, False, False]
    assert np.isnan(locate_on_mesh(force[4:], torque[4:])).all()


def test_the_papers_mesh_is_the_coarser_of_the_two() -> None:
    point, normal, force, twist = contacts(300, seed=1)
    torque = np.cross(point, force) + twist[:, None] * normal
    off = np.linalg.norm(locate_on_mesh(force, torque) - point, axis=1)
    # half a cell's diagonal is the best a mesh can promise; the objective is flat, so a few lie a cell or more away
    assert np.median(off) < MESH_STEP_MM * np.sqrt(0.5)
    assert np.median(np.linalg.norm(locate(force, torque).point_mm - point, axis=1)) < 1e-6 * np.median(off)
