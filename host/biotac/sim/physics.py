"""Contact to electrode counts: a model of skin, fluid and electrodes whose numbers are fitted to real fingers.

A contact squeezes the fluid gap over the electrodes under it, less with distance; the displaced volume widens the gap
elsewhere; shear and torsion drag the skin, which narrows the gap ahead of the core and widens it where skin piles up;
each electrode's resistance follows its gap, and a divider turns it into counts. ``biotac-lab finger`` fits the
numbers in skin.json to the counts and forces of two real fingers and to a plate of known normal on a third, and never
to a map; the file names its sources. What these recordings cannot say is a free choice that stands here: a probe
smaller than a plate squeezes as deep and less wide, up to the paper's 10 MOhm at 30 N; torsion; and the spreads of
``Finger``. sampling.py adds what time and noise do. host/docs/reference/sensor_model.md has all of it.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from ..core import geometry as surface
from ..errors import InputError
from ..kernels.geometry import Floats
from ..kernels.unroll import roll_up, unroll
from ..wire import sensor_gen as _sensor

Profile = Literal["new", "worn"]
PROFILES: tuple[Profile, ...] = ("new", "worn")
SEED_MAX = 2**31 - 1

ELECTRODES = len(_sensor.ELECTRODE_NAMES)
REST_CELSIUS = 30.0  # the model's reference temperature

GAP_MM = 2.0  # fluid thickness at rest
PLATE_MM = 3.5  # half width of a contact from which on it is as wide as the plate of the recordings
PLATE_N, FAINT_N = 4.5, 0.05  # where the footprint is skin.json's, and below which it does not change
PAD_MM, PAD_REACH_MM = -3.0, 4.0  # x of the pad's middle; towards the tip skin is softer
SKIN_MM = 2.0  # fluid and skin spread what presses
# Skin is rounder than the core where cylinder and cap meet: a plate of a given normal touches it nearer to the pad.
LEAD_AT_MM, LEAD_REACH_MM = 0.5, 2.5  # along the surface
LEAD_FROM_MM = 1.0  # a flat of that half width touches where it is put
# Spreads of what no recording fixes: a factor each way (host/docs/reference/sensor_model.md, Fingers).
PRESSURE_SPREAD, PLACE_SPREAD = 1.5, 1.5
TIP_FROM, SIDE_FROM, SIDE_TO = 0.4, 0.6, 0.85  # the normal's x and |y|: where the tip begins, and the very side
SQUEEZE_MAX = 4.2  # log compression: 10 MOhm
SQUEEZE_MAX_PER_N = 2.0  # of an electrode that faces the contact: E1 of a third finger, 1.5 at about 1 N (trial_15330)
TORSION_NMM_PER_RAD = 75.0  # as stiff as skin that is dragged 5 mm from the middle
TORSION_MAX_RAD = 0.2
TEMPERATURE_PER_C = -0.02  # of log resistance
# How much skin vibrates while it is pressed harder or less: white noise of PAC, in counts for each N/s. Nobody has
# measured it; RATTLE_SPREAD times as much or as little may be right (host/docs/guides/features.md). Skin that is drawn
# sideways until it slides is as quiet as at rest (slides).
RATTLE_PER_N_S, RATTLE_SPREAD = 2.5, 2.0
PDC_REST = (1300, 2700)  # counts of static pressure at rest: real sensors' is 1326, 2412, and 2582 to 2695
MESH_MM = 1.2
R0_ALONE = 0.05  # of log resistance: no two mirror images of F1 and F2 rest alike
OTHERWISE = 0.03  # of log sensitivity, as alike in neighbours; the prior of the fit, as more cannot be known
SPREAD_REACH_MM = 6.0  # F1 and F2 differ alike in electrodes 5 mm apart, and by chance in those 7 mm apart
WORN_LEVEL = -0.53  # of log resistance: trial_15330's finger against F1 and F2

_BLOCK = 256  # states at a time: keeps the (states x mesh points) arrays inside the cache


@dataclass(frozen=True)
class Skin:
    """What fingers have in common, fitted: see deform() for what each number does.

    ``lead_mm`` is how far, at most, a plate touches nearer to the pad than its normal says.

    ``gain`` (4, 19) is each electrode's sensitivity to squeeze, bulge, drag and pile-up, mirror-symmetric, and
    ``r0_ohm`` (19,) are resistances at rest. Fingers differ from them by logs: one sigma of the one difference that is
    known, between two fingers, is ``gain_apart`` (19,) and ``r0_apart`` (19,).
    """

    along_mm: float
    across_mm: float
    squeeze: float
    exponent: float
    growth: float
    taper: float
    fixed_share: float
    bulge_share: float
    hole: float
    drag_along_n_mm: float
    drag_across_n_mm: float
    drag_max_mm: float
    drag_reach_mm: float
    pile_per_mm2: float
    lead_mm: float
    gain: Floats
    r0_ohm: Floats
    gain_apart: Floats
    r0_apart: Floats


def shipped_skin() -> Skin:
    """The package's fit, skin.json."""
    document = json.loads(resources.files(__package__).joinpath("skin.json").read_text(encoding="utf-8"))
    fields: dict[str, Any] = document["numbers"]
    fields |= {name: np.array(values, dtype=np.float64) for name, values in document["electrodes"].items()}
    return Skin(**fields)


SKIN = shipped_skin()


@dataclass(frozen=True)
class States:
    """What touches one finger at n instants; all arrays float64.

    ``contact_mm`` (n, 3) lies on the core surface; ``force_n`` (n,) >= 0 is the normal force, 0 for
    no contact; ``shear_n`` (n, 3) is tangential; ``torsion_nmm`` (n,) is about the outward normal;
    ``tip_radius_mm`` (n,) is half the width of the flat that presses; ``warm_c`` (n,) is the
    temperature above 30 C. ``slip_mm_s`` (n,) is how fast the surface slides over the skin; None: nowhere.
    """

    contact_mm: Floats
    force_n: Floats
    shear_n: Floats
    torsion_nmm: Floats
    tip_radius_mm: Floats
    warm_c: Floats
    slip_mm_s: Floats | None = None

    def __len__(self) -> int:
        return len(self.force_n)

    @cached_property
    def deformation(self) -> tuple[Floats, Floats]:
        """Result of deform() for these states, the same for every finger."""
        return deform(self)

    def of(self, rows: npt.NDArray[Any]) -> States:
        """The states at the instants ``rows``, a NumPy index."""
        return States(
            self.contact_mm[rows], self.force_n[rows], self.shear_n[rows], self.torsion_nmm[rows],
            self.tip_radius_mm[rows], self.warm_c[rows], None if self.slip_mm_s is None else self.slip_mm_s[rows],
        )  # fmt: skip

    def wrench(self) -> tuple[Floats, Floats]:
        """Force (n, 3) in N on the finger and torque (n, 3) in N mm about the origin."""
        touched = self.force_n > 0.0
        force = np.zeros((len(self), 3))
        torque = np.zeros((len(self), 3))
        if touched.any():
            contact = self.contact_mm[touched]
            normal = surface.normals_at(contact)
            force[touched] = self.shear_n[touched] - self.force_n[touched, None] * normal
            torque[touched] = np.cross(contact, force[touched]) + self.torsion_nmm[touched, None] * normal
        return force, torque


@dataclass(frozen=True)
class Footprints:
    """Footprints of n contacts that are not round: half lengths (n,) in mm of an elliptic Gaussian's axes.

    ``along`` (n, 3) is the unit vector of the long axis, in the tangent plane. probes.py makes them.
    """

    short_mm: Floats
    long_mm: Floats
    along: Floats


_MESH_MM, _, _MESH_AREA_MM2 = surface.ventral_mesh(MESH_MM)
_POINTS_MM = np.concatenate([surface.ELECTRODE_MM, _MESH_MM])  # electrodes first
_POINTS_MM2 = (_POINTS_MM**2).sum(axis=1)
_RADIAL = surface.normals_at(_POINTS_MM)  # Table 1's normals at the tip are one flat facet
_ELECTRODES, _MESH = np.s_[:, :ELECTRODES], np.s_[:, ELECTRODES:]
_BETWEEN_MM2 = ((surface.ELECTRODE_MM[:, None] - surface.ELECTRODE_MM[None]) ** 2).sum(axis=2)
_SMOOTH = np.linalg.cholesky(np.exp(_BETWEEN_MM2 / (-2.0 * SPREAD_REACH_MM**2)) + 1e-9 * np.eye(ELECTRODES))


def _squeeze_and_bulge(state: Floats, skin: Skin) -> tuple[Floats, Floats]:
    """Log compression and log bulge (n, 19) for touched states in _pack()'s columns."""
    contact, force, shear, torsion = state[:, 0:3], state[:, 3], state[:, 4:7], state[:, 7]
    normal, middle = surface.normals_at(contact), contact
    to_tip, to_side = surface.tangents_at(normal)
    plate = np.array([skin.along_mm, skin.across_mm])
    if state.shape[1] == 9:
        share = _probe(state[:, 8:9]) * plate
        along = to_tip
        if skin.lead_mm:
            middle = _middle(contact, state[:, 8], skin.lead_mm)
            normal = surface.normals_at(middle)
    else:
        share = _probe(state[:, 9:7:-1]) * math.sqrt(plate.prod())
        along = state[:, 10:13]
    firm = np.exp(skin.taper * np.tanh((contact[:, 0] - PAD_MM) / PAD_REACH_MM))
    strength = (force**skin.exponent * firm)[:, None]
    long2, short2 = (share * (np.maximum(force, FAINT_N) / PLATE_N)[:, None] ** skin.growth).T[:, :, None] ** 2

    distance2 = np.maximum((middle**2).sum(axis=1)[:, None] + _POINTS_MM2 - 2.0 * middle @ _POINTS_MM.T, 0.0)
    part2 = (along @ _POINTS_MM.T - (along * middle).sum(axis=1)[:, None]) ** 2
    away2 = part2 / long2 + np.maximum(distance2 - part2, 0.0) / short2  # in footprints
    outside = 1.0 - np.exp(away2 / -skin.hole)
    under = strength * np.exp(-np.sqrt(away2))
    facing = skin.squeeze * np.maximum(normal @ _RADIAL.T, 0.0)

    volume_mm3 = (1.0 - np.exp(-under[_MESH] * facing[_MESH])) @ _MESH_AREA_MM2
    widened = skin.bulge_share * volume_mm3 / (outside[_MESH] @ _MESH_AREA_MM2)
    limited = SQUEEZE_MAX_PER_N * np.tanh(facing[_ELECTRODES] * (skin.gain[0] / SQUEEZE_MAX_PER_N))
    compression = under[_ELECTRODES] * limited
    bulge = widened[:, None] * outside[_ELECTRODES] * skin.gain[1]

    along_mm = (shear * to_tip).sum(axis=1)[:, None] / skin.drag_along_n_mm
    across_mm = (shear * to_side).sum(axis=1)[:, None] / skin.drag_across_n_mm
    length = np.maximum(np.hypot(along_mm, across_mm), 1e-12)
    limited = skin.drag_max_mm * np.tanh(length / skin.drag_max_mm) / length
    along_mm, across_mm = limited * along_mm, limited * across_mm
    radial = _RADIAL[:ELECTRODES]
    outward = (along_mm * to_tip + across_mm * to_side) @ radial.T
    if torsion.any():
        angle = TORSION_MAX_RAD * np.tanh(torsion / (TORSION_NMM_PER_RAD * TORSION_MAX_RAD))
        arm = surface.ELECTRODE_MM[None, :, :] - contact[:, None, :]
        outward += np.einsum(
            "nec,ec->ne", np.cross((angle[:, None] * surface.normals_at(contact))[:, None, :], arm), radial
        )
    ahead_mm = to_tip @ surface.ELECTRODE_MM.T - (to_tip * contact).sum(axis=1)[:, None]
    sideways = outward / GAP_MM * skin.gain[2] + skin.pile_per_mm2 * along_mm * ahead_mm * skin.gain[3]
    return compression, bulge + sideways * np.exp(distance2[_ELECTRODES] / (-2.0 * skin.drag_reach_mm**2))


def _middle(contact: Floats, half_mm: Floats, lead_mm: float) -> Floats:
    """Where the footprint's middle lies (n, 3), of flats of half width ``half_mm`` (n,) at ``contact`` (n, 3)."""
    flat = np.clip((half_mm - LEAD_FROM_MM) / (PLATE_MM - LEAD_FROM_MM), 0.0, 1.0)
    across, along = unroll(contact)
    return roll_up(across, along - lead_mm * flat * np.exp(-(((along - LEAD_AT_MM) / LEAD_REACH_MM) ** 2)))


def _probe(half_mm: Floats) -> Floats:
    """How wide a probe presses, as a share of a plate."""
    return (np.minimum(half_mm, PLATE_MM) + SKIN_MM) / (PLATE_MM + SKIN_MM)


def _pack(states: States, footprints: Footprints | None) -> Floats:
    """The mechanical part of touched states as rows (n, 9), or (n, 13) with footprints in place of the tip."""
    load = [states.contact_mm, states.force_n, states.shear_n, states.torsion_nmm]
    if footprints is None:
        return np.column_stack([*load, states.tip_radius_mm])
    return np.column_stack([*load, footprints.short_mm, footprints.long_mm, footprints.along])


def deform(states: States, footprints: Footprints | None = None, skin: Skin = SKIN) -> tuple[Floats, Floats]:
    """Log compression and log bulge of the gap over the electrodes, each (n, 19).

    Both are 0 without contact, and those of several contacts add: the logs of what each leaves of the gap, and the
    volumes each displaces. ``footprints`` take the place of ``tip_radius_mm``. Equal states are computed once: a
    scenario mostly holds still.
    """
    compression = np.zeros((len(states), ELECTRODES))
    bulge = np.zeros((len(states), ELECTRODES))
    touched = np.flatnonzero(states.force_n > 0.0)
    if len(touched):
        unique, inverse = _pack(states, footprints)[touched], np.arange(len(touched))
        if len(touched) > 1:
            unique, inverse = np.unique(unique, axis=0, return_inverse=True)
        parts = [_squeeze_and_bulge(unique[k : k + _BLOCK], skin) for k in range(0, len(unique), _BLOCK)]
        rows = inverse.reshape(-1)  # NumPy 2.0 alone returns it as a column
        compression[touched] = np.concatenate([part[0] for part in parts])[rows]
        bulge[touched] = np.concatenate([part[1] for part in parts])[rows]
    return compression, bulge


class Finger:
    """One finger of the population; the same seed and profile give the same finger.

    Resistances and sensitivities are drawn about what two real fingers have in common, as far apart as these are
    (skin.json). ``profile``: "new" has a quiet converter, "worn" the low resistances of trial_15330's finger with the
    noise of F1 and F2 and the glitches of btd_biotacsp. ``r0_ohm`` and ``gap_gain`` are (19,): resistance at rest and
    30 C, and gap sensitivity. ``pdc_rest`` is in counts. ``rattle_per_n_s`` is drawn between half and twice the
    RATTLE_PER_N_S of PAC, log-uniformly; set it to try another.

    What no recording fixes is drawn log-uniformly, too, and may be set: ``pressure_gain``, of the counts of pressure
    per newton; ``tip_gain`` and ``side_gain``, of all that a newton does at the tip's end and at the very side, so that
    signals per pressure stay what a real plate showed. ``at_spread`` sets all three.
    """

    def __init__(self, seed: int, profile: Profile = "new") -> None:
        if profile not in PROFILES:
            raise InputError(f"a finger's profile is {profile!r}, expected one of: {', '.join(PROFILES)}")
        if not isinstance(seed, (int, np.integer)) or not 0 <= seed <= SEED_MAX:
            raise InputError(f"a finger's seed is {seed!r}, expected a whole number from 0 to {SEED_MAX}")
        worn = profile == "worn"
        rng = np.random.default_rng([seed, 0])
        self.seed = seed
        self.profile: Profile = profile
        # along the line through the two fingers that are known, and a little in all directions
        apart, rest = rng.normal(), OTHERWISE * _SMOOTH @ rng.normal(0.0, 1.0, ELECTRODES)
        alone = R0_ALONE * rng.normal(0.0, 1.0, ELECTRODES)
        self.r0_ohm: Floats = SKIN.r0_ohm * np.exp(WORN_LEVEL * worn + apart * SKIN.r0_apart + alone)
        self.gap_gain: Floats = np.exp(apart * SKIN.gain_apart + rest)
        # real drift is one-dimensional: one rate a finger, loadings 0.82 to 1.16
        self.drift_per_min: Floats = rng.uniform(-15.0, 15.0) * rng.uniform(0.82, 1.16, ELECTRODES)
        self.creep_share = float(rng.uniform(0.02, 0.05))
        self.pdc_rest = float(np.random.default_rng([seed, 6]).integers(*PDC_REST))
        spread = float(np.random.default_rng([seed, 7]).uniform(-1.0, 1.0))
        self.rattle_per_n_s = RATTLE_PER_N_S * RATTLE_SPREAD**spread
        self.at_spread(*np.random.default_rng([seed, 8]).uniform(-1.0, 1.0, 3).tolist())
        self.noise_counts = 5.0 if worn else 1.5
        self.glitch_share = 0.005 if worn else 0.0

    def at_spread(self, pressure: float = 0.0, tip: float = 0.0, side: float = 0.0) -> None:
        """Put what no recording fixes at places of its spread, -1 to 1: 0 is the middle."""
        self.pressure_gain = PRESSURE_SPREAD**pressure
        self.tip_gain, self.side_gain = PLACE_SPREAD**tip, PLACE_SPREAD**side

    def loudness(self, contact_mm: Floats) -> Floats:
        """What a newton at ``contact_mm`` (n, 3) does, over what it does in the middle of the spread, (n,)."""
        normal = surface.normals_at(contact_mm)
        tip = np.clip((normal[:, 0] - TIP_FROM) / (1.0 - TIP_FROM), 0.0, 1.0)
        side = np.clip((np.abs(normal[:, 1]) - SIDE_FROM) / (SIDE_TO - SIDE_FROM), 0.0, 1.0)
        share: Floats = self.tip_gain**tip * self.side_gain**side
        return share

    def rest_counts(self, warm_c: Floats) -> Floats:
        """Counts (n, 19) without contact at temperatures (n,) above 30 C."""
        return counts_at(self.r0_ohm * np.exp(TEMPERATURE_PER_C * warm_c)[:, None])

    def counts(self, states: States) -> Floats:
        """Counts (n, 19), not rounded, without noise, drift or creep."""
        return self.counts_of(*self.deformation(states), states.warm_c)

    def deformation(self, states: States) -> tuple[Floats, Floats]:
        """Log compression and log bulge (n, 19) of the gap, as loud as this finger is where ``states`` touch."""
        loud = self.loudness(states.contact_mm)[:, None]
        compression, bulge = states.deformation
        return loud * compression, loud * bulge

    def counts_of(self, compression: Floats, bulge: Floats, warm_c: Floats) -> Floats:
        """counts() from the results of deform(), each (n, 19), at ``warm_c`` (n,) in C above 30 C."""
        share = resistance_share(compression * self.gap_gain, bulge * self.gap_gain, SKIN.fixed_share)
        return counts_at(self.r0_ohm * share * np.exp(TEMPERATURE_PER_C * warm_c)[:, None])


def resistance_share(compression: Floats, bulge: Floats, fixed_share: float) -> Floats:
    """Resistance as a share of that at rest, from the log compression and the log bulge of the gap."""
    squeezed = SQUEEZE_MAX * np.tanh(compression / SQUEEZE_MAX)
    return fixed_share + (1.0 - fixed_share) * np.exp(2.0 * (squeezed - bulge))


def counts_at(resistance_ohm: Floats) -> Floats:
    """The divider's counts, not rounded, at resistances in ohm."""
    return _sensor.FULL_SCALE_COUNT * _sensor.LOAD_OHM / (resistance_ohm + _sensor.LOAD_OHM)


def resistance_at(counts: Floats) -> Floats:
    """The resistances in ohm of counts above 0."""
    return (_sensor.FULL_SCALE_COUNT / counts - 1.0) * _sensor.LOAD_OHM
