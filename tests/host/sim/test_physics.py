"""The sensor model against closed forms, symmetries and the anchors of host/docs/reference/sensor_model.md."""

from dataclasses import replace

import numpy as np
import pytest

from biotac.core import geometry as surface
from biotac.sim import sampling
from biotac.sim.physics import RATTLE_PER_N_S, SKIN, SimFinger, States
from biotac.sim.timeline import Pose, Track
from biotac.wire import sensor_gen as _sensor
from biotac.wire import slots

NAMES = _sensor.ELECTRODE_NAMES


def index(name: str) -> int:
    return NAMES.index(name)


def touch(
    contact_mm: np.ndarray,
    force_n: float,
    *,
    shear_n: tuple[float, float, float] = (0.0, 0.0, 0.0),
    torsion_nmm: float = 0.0,
    tip_radius_mm: float = 1.0,
    warm_c: float = 0.0,
) -> States:
    """The same load at each of the contacts (n, 3)."""
    n = len(contact_mm)
    return States(
        contact_mm=np.asarray(contact_mm, dtype=np.float64),
        force_n=np.full(n, force_n),
        shear_n=np.tile(np.array(shear_n), (n, 1)),
        torsion_nmm=np.full(n, torsion_nmm),
        tip_radius_mm=np.full(n, tip_radius_mm),
        warm_c=np.full(n, warm_c),
    )


def over_electrodes(force_n: float) -> States:
    return touch(surface.project(surface.ELECTRODE_MM), force_n)


def at_rest(n: int, warm_c: float = 0.0) -> States:
    return touch(np.tile([0.0, 0.0, -surface.RADIUS_MM], (n, 1)), 0.0, warm_c=warm_c)


def change(finger: SimFinger, states: States) -> np.ndarray:
    return finger.counts(states) - finger.rest_counts(states.warm_c)


def quiet(seed: int) -> SimFinger:
    """A finger without noise, drift, creep or glitches."""
    finger = SimFinger(seed)
    finger.noise_counts = finger.glitch_share = finger.creep_share = 0.0
    finger.drift_per_min = np.zeros(19)
    return finger


# ---- closed forms ------------------------------------------------------------------------------


def test_rest_counts_are_the_divider_of_the_rest_resistance() -> None:
    finger = SimFinger(1)
    np.testing.assert_allclose(finger.counts(at_rest(1))[0], 4095 * 10e3 / (finger.r0_ohm + 10e3), rtol=1e-12)
    finger.r0_ohm = np.repeat([3e3, 4e3, 5e3, 10e6], [5, 5, 5, 4])
    expected = np.repeat([3150.0, 2925.0, 2730.0, 4.0909], [5, 5, 5, 4])  # host/docs/reference/sensor_model.md
    np.testing.assert_allclose(finger.counts(at_rest(1))[0], expected, atol=1e-4)


def test_warmth_lowers_the_resistance_by_two_percent_a_degree() -> None:
    finger = SimFinger(1)
    expected = 4095 * 10e3 / (finger.r0_ohm * np.exp(-0.02 * 7.0) + 10e3)
    np.testing.assert_allclose(finger.counts(at_rest(1, warm_c=7.0))[0], expected, rtol=1e-12)


def written_out(finger: SimFinger, c: np.ndarray, force_n: float, shear: np.ndarray, tau: float, half: float) -> list:
    """Counts of one contact: the model line by line, one electrode at a time."""
    k = SKIN
    radial = lambda p: np.array([max(p[0], 0.0), p[1], p[2]]) / np.linalg.norm([max(p[0], 0.0), p[1], p[2]])  # noqa: E731
    n_c, r = radial(c), surface.RADIUS_MM
    s = r * np.arcsin(c[0] / r) if c[0] > 0 else c[0]
    s -= k.lead_mm * np.exp(-(((s - 0.5) / 1.75) ** 2)) * np.clip((half - 1) / 2.5, 0, 1)
    roll = np.arctan2(c[1], -c[2]) * (1 - k.lead_roll * np.clip((half - 1) / 2.5, 0, 1))
    tilt = max(s, 0.0) / r
    m = np.array([r * np.sin(tilt) if s > 0 else s, r * np.cos(tilt) * np.sin(roll), -r * np.cos(tilt) * np.cos(roll)])
    n_m = radial(m)
    loud = finger.tip_gain ** np.clip((n_c[0] - 0.4) / 0.6, 0, 1) * finger.side_gain ** np.clip(
        (abs(n_c[1]) - 0.6) / 0.25, 0, 1
    )
    to_tip, to_side = (axis[0] for axis in surface.tangents_at(n_c[None]))
    grown = (min(half, 3.5) + 2.0) / 5.5 * (force_n / 4.5) ** k.growth
    strength = force_n**k.exponent * np.exp(k.taper * np.tanh((c[0] + 3.0) / 4.0))

    def away2(point: np.ndarray) -> float:
        along = (point - m) @ to_tip
        across2 = max(np.sum((point - m) ** 2) - along**2, 0.0)
        return float((along / (k.along_mm * grown)) ** 2 + across2 / (k.across_mm * grown) ** 2)

    volume = room = 0.0
    mesh_mm, _, areas_mm2 = surface.ventral_mesh(1.2)
    for point, area in zip(mesh_mm, areas_mm2, strict=True):
        depth = k.squeeze * strength * np.exp(-np.sqrt(away2(point))) * max(radial(point) @ n_m, 0.0)
        volume += (1 - np.exp(-depth)) * area
        room += (1 - np.exp(-away2(point) / k.hole)) * area
    x, y = shear @ to_tip / k.drag_along_n_mm, shear @ to_side / k.drag_across_n_mm
    size = np.hypot(x, y)
    x, y = (np.array([x, y]) / max(size, 1e-12)) * k.drag_max_mm * np.tanh(size / k.drag_max_mm)
    phi = 0.2 * np.tanh(tau / (75 * 0.2))
    counts = []
    for e, point in enumerate(surface.ELECTRODE_MM):
        facing = k.squeeze * k.gain[0][e] * max(radial(point) @ n_m, 0.0)
        squeeze = 2.0 * np.tanh(facing / 2.0) * strength * np.exp(-np.sqrt(away2(point)))
        bulge = k.bulge_share * volume / room * (1 - np.exp(-away2(point) / k.hole)) * k.gain[1][e]
        moved = x * to_tip + y * to_side + phi * np.cross(n_c, point - c)
        dragged = (
            moved @ radial(point) / 2.0 * k.gain[2][e] + k.pile_per_mm2 * x * ((point - c) @ to_tip) * k.gain[3][e]
        )
        bulge += dragged * np.exp(-np.sum((point - m) ** 2) / (2 * k.drag_reach_mm**2))
        gain = loud * finger.gap_gain[e]
        gap = np.exp(gain * bulge - 4.2 * np.tanh(gain * squeeze / 4.2))
        counts.append(4095 * 10e3 / (finger.r0_ohm[e] * (k.fixed_share + (1 - k.fixed_share) * gap**-2) + 10e3))
    return counts


@pytest.mark.parametrize(
    ("xy_mm", "force_n", "shear_n", "torsion_nmm", "tip_radius_mm"),
    [
        ((-7.0, 2.0), 4.0, (0.0, 0.0, 0.0), 0.0, 1.0),
        ((2.5, -1.5), 6.0, (1.0, -2.0, 0.5), 0.0, 3.5),
        ((-13.0, -4.0), 2.0, (-0.5, 1.0, 0.2), -12.0, 1.8),
    ],
)
def test_counts_are_those_of_the_formulas_written_out(
    xy_mm: tuple[float, float],
    force_n: float,
    shear_n: tuple[float, float, float],
    torsion_nmm: float,
    tip_radius_mm: float,
) -> None:
    finger = SimFinger(4)
    contact = surface.on_surface(np.array([xy_mm]))
    states = touch(contact, force_n, shear_n=shear_n, torsion_nmm=torsion_nmm, tip_radius_mm=tip_radius_mm)
    expected = written_out(finger, contact[0], force_n, np.array(shear_n), torsion_nmm, tip_radius_mm)
    np.testing.assert_allclose(finger.counts(states)[0], expected, rtol=1e-10)


def test_the_mesh_covers_half_a_cylinder_and_a_quarter_sphere() -> None:
    points, normals, areas = surface.ventral_mesh()
    r = 5.08
    assert areas.sum() == pytest.approx(np.pi * r * 16.0 + np.pi * r**2, rel=1e-12)
    # a closed form that weighs places: integral of n_z over the half-cylinder and the quarter sphere
    assert areas @ normals[:, 2] == pytest.approx(-2 * r * 16.0 - np.pi * r**2 / 2, rel=2e-3)
    assert (points[:, 2] < 0).all()


# ---- symmetry ----------------------------------------------------------------------------------


def test_what_is_on_the_surface_is_what_the_mesh_covers() -> None:
    mesh, _, _ = surface.ventral_mesh()
    assert all(surface.is_on_surface(x, y) for x, y, _ in mesh)
    assert not any(surface.is_on_surface(*xy) for xy in ((-16.1, 0), (-8, 5.2), (4, 4), (5.2, 0)))


# ---- signs -------------------------------------------------------------------------------------


def test_a_poke_lowers_the_electrode_under_it_most() -> None:
    signal = change(SimFinger(2), over_electrodes(2.0))
    assert (signal.argmin(axis=1) == np.arange(19)).all()
    assert (signal.min(axis=1) < -50.0).all()


def test_torsion_turns_the_skin_about_the_outward_normal() -> None:
    contact = surface.project(surface.ELECTRODE_MM[[index("E17")]])
    finger = SimFinger(2)
    still = finger.counts(touch(contact, 5.0))[0]
    moved = finger.counts(touch(contact, 5.0, torsion_nmm=10.0))[0] - still
    # right-handed about -z: skin distal of the contact moves to -y, proximal of it to +y
    assert moved[index("E11")] < -5 and moved[index("E1")] > 5
    assert moved[index("E14")] > 5 and moved[index("E4")] < -5


# ---- anchors -----------------------------------------------------------------------------------


def test_a_plate_gives_as_much_signal_per_newton_as_on_real_fingers() -> None:
    """F1 gave 318 counts per newton (root of the energy, median) at about 4 N, F2 377 at 5.2 N; 200 to 500 is wide."""
    for force_n, seed in ((4.0, 1), (5.2, 2), (4.5, 3)):
        pressed = touch(np.array([[-3.0, 0.0, -surface.RADIUS_MM]]), force_n, tip_radius_mm=3.5)
        assert 200.0 < np.linalg.norm(change(SimFinger(seed), pressed)) / force_n < 500.0


# ---- truth -------------------------------------------------------------------------------------


def test_torque_is_lever_times_force_plus_torsion() -> None:
    track = Track()
    pose = Pose(x_mm=-2.8, y_mm=0.0, force_n=5.0, shear_x_n=1.0, shear_y_n=2.0, torsion_nmm=3.0, tip_mm=2.0)
    track.ramp(1.0, pose, start=pose)
    force, torque = track.states(np.array([0.5])).wrench()
    np.testing.assert_allclose(force[0], [1.0, 2.0, 5.0], atol=1e-12)
    # c = (-2.8, 0, -5.08); c x f = (10.16, 8.92, -5.6); outward normal (0, 0, -1)
    np.testing.assert_allclose(torque[0], [10.16, 8.92, -8.6], atol=1e-12)


def test_shear_is_tangential_and_keeps_its_size_everywhere() -> None:
    xy = np.array([[-8.0, 4.0], [3.0, 2.0], [-12.0, -5.0], [5.08, 0.0]])
    contact = surface.on_surface(xy)
    normal = surface.normals_at(contact)
    to_tip, to_side = surface.tangents_at(normal)
    for tangent in (to_tip, to_side):
        np.testing.assert_allclose(np.linalg.norm(tangent, axis=1), 1.0, rtol=1e-12)
        np.testing.assert_allclose((tangent * normal).sum(axis=1), 0.0, atol=1e-12)
    np.testing.assert_allclose((to_tip * to_side).sum(axis=1), 0.0, atol=1e-12)
    assert (to_side[:3, 1] > 0).all() and to_tip[0, 0] == 1.0


def test_without_contact_there_is_no_wrench_and_no_signal() -> None:
    states = touch(surface.ELECTRODE_MM[[16]], 0.0, shear_n=(1.0, 1.0, 0.0), torsion_nmm=5.0)
    force, torque = states.wrench()
    assert not force.any() and not torque.any()
    np.testing.assert_array_equal(change(SimFinger(1), states), np.zeros((1, 19)))


# ---- sampling ----------------------------------------------------------------------------------


def ramp_states(frames: int, force_n: float) -> States:
    track = Track()
    start = Pose(x_mm=-2.8, tip_mm=7.0)
    track.ramp(frames * 0.01, Pose(x_mm=-2.8, tip_mm=7.0, force_n=force_n), start=start)
    return track.states(np.arange(frames + 1) * 0.01)


def test_each_electrode_is_sampled_at_its_own_slot() -> None:
    finger, states = quiet(1), ramp_states(10, 20.0)
    words = sampling.sample(finger, states)
    boundary = finger.counts(states)
    for name, slot in [("E1", 7), ("E17", 39), ("E19", 43)]:
        assert _sensor.SLOTS[slot] == name
        column = boundary[:, index(name)]
        expected = column[:-1] + (column[1:] - column[:-1]) * slot / 44
        np.testing.assert_allclose(words[:, slot], expected, atol=0.5000001)
    assert np.ptp(words[:, 39].astype(int)) > 200  # the ramp is steep enough to tell slots apart


def test_the_same_seed_gives_the_same_words_and_a_longer_run_begins_with_them() -> None:
    states = ramp_states(60, 6.0)
    words = sampling.sample(SimFinger(7, "worn"), states)
    assert words.dtype == np.uint16 and words.shape == (60, 44)
    np.testing.assert_array_equal(words, sampling.sample(SimFinger(7, "worn"), states))
    assert (words != sampling.sample(SimFinger(8, "worn"), states)).any()
    shorter = States(*(getattr(states, name)[:31] for name in States.__dataclass_fields__))
    np.testing.assert_array_equal(sampling.sample(SimFinger(7, "worn"), shorter), words[:30])


@pytest.mark.parametrize(("profile", "rest_counts", "sigma"), [("new", 2862, 1.5), ("worn", 3256, 5.0)])
def test_profiles_rest_where_real_fingers_do(profile: str, rest_counts: int, sigma: float) -> None:
    """The mean of the electrodes' rest counts of F1 and F2, and of trial_15330's finger for "worn"."""
    rest = np.array([SimFinger(seed, profile).rest_counts(np.zeros(1))[0] for seed in range(50)])
    assert rest.mean() == pytest.approx(rest_counts, abs=25)
    assert (rest.std(axis=0) < 250).all() and (rest.std(axis=0) > 2).all()
    finger = SimFinger(1, profile)
    finger.drift_per_min, finger.glitch_share = np.zeros(19), 0.0
    words = sampling.sample(finger, at_rest(2001))[:, slots.ELECTRODE_SLOT]
    # rounding adds 1/12; 38 000 samples know sigma to 0.4 %
    assert words.std(axis=0).mean() == pytest.approx(np.sqrt(sigma**2 + 1 / 12), rel=0.02)


def test_worn_glitches_are_single_dips() -> None:
    finger = quiet(1)
    finger.glitch_share = SimFinger(1, "worn").glitch_share
    words = sampling.sample(finger, at_rest(4001))[:, slots.ELECTRODE_SLOT]
    dips = finger.rest_counts(np.zeros(1)) - words
    hit = dips > 1.0
    assert hit.mean() == pytest.approx(0.005, rel=0.2)
    assert dips[hit].min() > 29.0 and dips[hit].max() < 67.0
    assert not (hit[1:] & hit[:-1]).any()
    assert SimFinger(1, "new").glitch_share == 0.0


def test_pressure_temperature_and_flux_channels() -> None:
    pressed = touch(np.tile([-2.8, 0.0, -5.08], (2001, 1)), 5.0, warm_c=2.5)
    words = sampling.sample(SimFinger(1), pressed)
    pdc, tac, tdc = (words[:, _sensor.SLOTS.index(name)] for name in ("PDC", "TAC", "TDC"))
    # The model's law for a load that is there from the first round on, in closed form: undershoot and creep.
    t_s = 0.01 * np.arange(1, 2002)
    load = 500 * SimFinger(1).pressure_gain * (1 + 0.15 * np.tanh(-2.8 / 8))
    low = 9.0 * np.tanh(load * (1 - np.exp(-t_s / 0.8)) / 200)
    creep = 0.15 * load * (1 - np.exp(-t_s / 60.0))
    assert pdc.mean() == pytest.approx(SimFinger(1).pdc_rest + (load - low + creep).mean(), abs=0.1)
    assert tac.mean() == pytest.approx(2045, abs=0.1)
    share = tdc.mean() / 4095
    celsius = 4025 / np.log((155183 - 46555 * share) / share) - 273.15  # SPM 5.1, as printed
    assert celsius == pytest.approx(32.5, abs=0.01)


def test_dynamic_pressure_answers_to_changes_of_force_only() -> None:
    held = touch(np.tile([-2.8, 0.0, -5.08], (501, 1)), 5.0)
    rest_pac = sampling.sample(SimFinger(1), at_rest(501))[:, slots.PAC_SLOT].astype(float)
    held_pac = sampling.sample(SimFinger(1), held)[:, slots.PAC_SLOT].astype(float)
    for pac in (rest_pac, held_pac[300:]):  # the undershoot is over after 3 s
        assert pac.std() == pytest.approx(4.0, rel=0.05)
    assert rest_pac.mean() == pytest.approx(2038, abs=0.2)
    slow = sampling.sample(SimFinger(1), ramp_states(50, 1.0))[:, slots.PAC_SLOT].mean() - 2038
    fast = sampling.sample(SimFinger(1), ramp_states(50, 2.0))[:, slots.PAC_SLOT].mean() - 2038
    assert slow > 50 and fast == pytest.approx(2 * slow, rel=0.1)
    assert abs(held_pac.mean() - 2038) < slow / 50  # undershoot and creep: 2 counts/s of 100


def test_words_stay_within_the_converter() -> None:
    words = sampling.sample(SimFinger(1, "worn"), ramp_states(5, 50.0))
    assert words.max() <= 4095  # PAC would be far beyond
    assert (words[:, slots.PAC_SLOT] == 4095).any()


def test_fingers_rattle_half_to_twice_as_much_and_as_their_rate_says() -> None:
    drawn = np.array([SimFinger(seed).rattle_per_n_s for seed in range(400)]) / RATTLE_PER_N_S
    assert 0.5 <= drawn.min() < 0.52 and 1.9 < drawn.max() <= 2.0
    assert abs(np.median(np.log2(drawn))) < 0.15
    finger = SimFinger(1)
    finger.rattle_per_n_s = 10.0
    at = np.tile(surface.project(surface.ELECTRODE_MM[16:17]), (301, 1))
    pushed = replace(touch(at, 0.0), force_n=np.linspace(0.0, 6.0, 301))
    pac = sampling.sample(finger, pushed)[100:, slots.PAC_SLOT].astype(float)  # 2 N/s: 20 counts besides the noise of 4
    assert np.std(np.diff(pac)) / np.sqrt(2) == pytest.approx(24.0, rel=0.05)
