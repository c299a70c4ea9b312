"""Footprints against Hertz's closed forms and symmetries; two contacts against their parts; the drawn data set."""

import numpy as np
import pytest
import scipy

from biotac.core import geometry as surface
from biotac.sim import physics
from biotac.sim.physics import SimFinger, States
from biotac_lab.learn import probes
from biotac_lab.learn.probes import BAR, PROBES, footprints

VENTER = np.array([[-8.0, 0.0, -surface.RADIUS_MM]])


def press(contact_mm: np.ndarray, force_n: float) -> States:
    n, none = len(contact_mm), np.zeros(len(contact_mm))
    return States(contact_mm, np.full(n, force_n), np.zeros((n, 3)), none, np.ones(n), none)


def radius_mm(sigma_mm: float) -> float:
    """The contact's half length behind a footprint: the part added by the skin's thickness taken away again."""
    return 2.0 * np.sqrt(sigma_mm**2 - probes.SKIN_MM**2)


@pytest.mark.parametrize("probe", PROBES[:2], ids=lambda probe: probe.name)
def test_a_ball_on_the_tip_is_hertz_s(probe: probes.Probe) -> None:
    cap = surface.on_surface(np.array([[2.0, 1.0]]))
    touch = footprints(probe, cap, np.array([4.0]))
    both = 1.0 / (1.0 / probe.radius_mm + 1.0 / (surface.RADIUS_MM + 2.0))  # Johnson 4.22: a^3 = 3 F R / 4 E*
    expected = (3.0 * 4.0 * both / (4.0 * 1.3)) ** (1.0 / 3.0)
    assert radius_mm(touch.short_mm[0]) == pytest.approx(expected, rel=1e-9)
    ended = 1.0 / np.hypot(1.0 / expected, 1.0 / probe.half_length_mm)
    assert radius_mm(touch.long_mm[0]) == pytest.approx(ended, rel=1e-9)


def test_slenderness_is_near_hertz_s_own_integrals() -> None:
    """Hertz without the closed form: B / A = ((a / b)^2 E(e) - K(e)) / (K(e) - E(e)), Johnson 4.25a."""
    for slender in (1.5, 2.5, 4.0):
        e2 = 1.0 - 1.0 / slender**2
        k, e = scipy.special.ellipk(e2), scipy.special.ellipe(e2)
        ratio = (slender**2 * e - k) / (k - e)
        assert ratio ** (2.0 / 3.0) == pytest.approx(slender, rel=0.03)


def test_a_bar_lies_as_it_is_turned() -> None:
    for degrees in (0.0, 20.0, 75.0, 90.0, 140.0):
        touch = footprints(BAR, VENTER, np.array([5.0]), np.radians([degrees]))
        x, y = touch.along[0, :2]
        assert np.degrees(np.arctan2(y, x)) % 180.0 == pytest.approx(degrees % 180.0, abs=4.0)  # the finger's own bend
        again = footprints(BAR, VENTER, np.array([5.0]), np.radians([degrees + 180.0]))
        assert again.long_mm == pytest.approx(touch.long_mm)
    mirror = [np.radians([30.0]), np.radians([-30.0])]
    counts = []
    for turned in mirror:
        finger = SimFinger(1)
        finger.r0_ohm[:], finger.gap_gain[:] = 4000.0, 1.0
        states = press(VENTER, 5.0)
        counts.append(probes.counts_of(finger, [(states, footprints(BAR, VENTER, states.force_n, turned))])[0])
    y = surface.ELECTRODE_MM * [1.0, -1.0, 1.0]
    partner = [int(np.argmin(((surface.ELECTRODE_MM - one) ** 2).sum(axis=1))) for one in y]
    assert counts[0][partner] == pytest.approx(counts[1], abs=1.0)


def test_two_contacts_add_squeeze_and_volume_and_nothing_adds_nothing() -> None:
    finger = SimFinger(2)
    one, other = press(VENTER, 3.0), press(surface.on_surface(np.array([[2.0, 0.0]])), 5.0)
    none = press(VENTER, 0.0)
    np.testing.assert_array_equal(probes.counts_of(finger, [(one, None), (none, None)]), finger.counts(one))
    both = probes.counts_of(finger, [(one, None), (other, None)])
    np.testing.assert_array_equal(both, probes.counts_of(finger, [(other, None), (one, None)]))
    parts = [physics.deform(state)[1] for state in (one, other)]
    assert (both != finger.counts(one)).any() and (parts[0] + parts[1] != 0).any()
