"""Contact to electrode counts: a model of skin, fluid and electrodes with numbers fitted to real fingers.

The formulas are computed in C (host/binding/skin); their numbers stand here.

A contact squeezes the fluid gap over the electrodes under it, less with distance; the displaced volume widens the gap
elsewhere; shear and torsion drag the skin, which narrows the gap ahead of the core and widens it where skin piles up;
each electrode's resistance follows its gap, and a divider turns it into counts. ``biotac-lab finger`` fits the
numbers in skin.json to the counts and forces of two real fingers and to a plate of known normal on a third, and never
to a map; the file names the sources. Numbers that these recordings cannot give are free choices here: a probe
smaller than a plate squeezes as deep and less wide, up to the paper's 10 MOhm at 30 N; torsion; and the spreads of
``SimFinger``. sampling.py adds the effects of time and noise. host/docs/reference/sensor_model.md has all of it.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from importlib import resources
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from ..core import geometry as surface
from ..errors import InputError
from ..kernels.geometry import Floats
from ..wire import sensor_gen as _sensor
from ..wire.native import ffi, lib

Profile = Literal["new", "worn"]
PROFILES: tuple[Profile, ...] = ("new", "worn")
SEED_MAX = 2**31 - 1

ELECTRODES = len(_sensor.ELECTRODE_NAMES)
REST_CELSIUS = 30.0  # the model's reference temperature

GAP_MM = 2.0  # fluid thickness at rest
PLATE_MM = 3.5  # half width of a contact from which on it is as wide as the plate of the recordings
PLATE_N, FAINT_N = 4.5, 0.05  # where the footprint is skin.json's, and below which it does not change
PAD_MM, PAD_REACH_MM = -3.0, 4.0  # x of the pad's middle; towards the tip skin is softer
SKIN_MM = 2.0  # fluid and skin spread a pressing tip
# Skin is rounder than the core where cylinder and cap meet: a plate of a given normal touches it nearer to the pad.
LEAD_AT_MM, LEAD_REACH_MM = 0.5, 1.75  # along the surface
LEAD_FROM_MM = 1.0  # a flat of that half width touches where it is put
# Spreads of numbers that no recording fixes: a factor each way (host/docs/reference/sensor_model.md, Fingers).
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


_DOUBLES = ffi.typeof("double[]")


def doubles(numbers: npt.ArrayLike) -> Any:
    """An array as C has it; it lives as long as this."""
    return ffi.from_buffer(_DOUBLES, np.ascontiguousarray(numbers, np.float64))


def c_struct(kind: str, constants: Mapping[str, Any], given: Mapping[str, Any]) -> Any:
    """A struct of C with fields that are ``given`` or constants of the same name in capitals."""
    names = [name for name, _ in ffi.typeof(kind).fields]
    return ffi.new(f"{kind} *", {name: given[name] if name in given else constants[name.upper()] for name in names})


class _InC:
    """The C form of an object, made once. A copy makes it anew: memory of C can be neither copied nor pickled."""

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name not in ("in_c", "touched")}


@dataclass(frozen=True)
class Skin(_InC):
    """The part that fingers have in common, fitted: see deform() for the meaning of each number.

    A plate touches nearer to the pad than its normal says: by at most ``lead_mm`` along the finger, and on a flank by
    ``lead_roll``, a share of the roll.

    ``gain`` (4, 19) is each electrode's sensitivity to squeeze, bulge, drag and pile-up, mirror-symmetric, and
    ``r0_ohm`` (19,) are resistances at rest. Fingers differ from them by logs: one sigma of the one known difference,
    between two fingers, is ``gain_apart`` (19,) and ``r0_apart`` (19,).
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
    lead_roll: float
    gain: Floats
    r0_ohm: Floats
    gain_apart: Floats
    r0_apart: Floats

    @cached_property
    def in_c(self) -> Any:
        """This skin and the model's constants as C has them."""
        own = {name: value.tolist() if name == "gain" else value for name, value in vars(self).items()}
        sensor = {name.lower(): getattr(_sensor, name) for name in ("LOAD_OHM", "TDC_A", "TDC_B", "TDC_BETA_K")}
        points = {"points": len(_POINTS), "point": ffi.from_buffer("bt_skin_point[]", _POINTS)}
        return c_struct("bt_skin", globals(), own | sensor | points)


def shipped_skin() -> Skin:
    """The package's fit, skin.json."""
    document = json.loads(resources.files(__package__).joinpath("skin.json").read_text(encoding="utf-8"))
    fields: dict[str, Any] = document["numbers"]
    fields |= {name: np.array(values, dtype=np.float64) for name, values in document["electrodes"].items()}
    return Skin(**fields)


SKIN = shipped_skin()


@dataclass(frozen=True)
class States(_InC):
    """The load on one finger at n instants; all arrays float64.

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

    @classmethod
    def of_poses(cls, poses: Floats) -> States:
        """The states of poses (n, 9), with the fields of timeline.Pose in order as columns."""
        n, contact = len(poses), ffi.new("bt_contact *")
        numbers = np.empty(lib.BT_CONTACT_NUMBERS * n)
        lib.bt_contact_of_poses(n, doubles(poses), REST_CELSIUS, doubles(numbers), contact)
        numbers.flags.writeable = False  # results computed from them once would not follow a change
        states = cls(
            numbers[: 3 * n].reshape(n, 3), numbers[3 * n : 4 * n], numbers[4 * n : 7 * n].reshape(n, 3),
            *numbers[7 * n :].reshape(4, n),
        )  # fmt: skip
        states.__dict__["in_c"] = contact, numbers
        return states

    @cached_property
    def in_c(self) -> tuple[Any, ...]:
        """These states as C has them, and the objects that they need alive."""
        load = self.contact_mm, self.force_n, self.shear_n, self.torsion_nmm, self.tip_radius_mm, self.warm_c
        kept = [doubles(numbers) for numbers in load]
        kept.append(ffi.NULL if self.slip_mm_s is None else doubles(self.slip_mm_s))  # a pointer holds no object
        return ffi.new("bt_contact *", kept), kept

    @cached_property
    def touched(self) -> tuple[Any, ...]:
        """These states with the deformation as C has them, and the objects that they need alive."""
        kept = self.in_c[0], *map(doubles, self.deformation)
        return ffi.new("bt_touched *", kept), kept

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
_POINTS = np.column_stack([
    _POINTS_MM, (_POINTS_MM**2).sum(axis=1),
    surface.normals_at(_POINTS_MM),  # Table 1's normals at the tip are one flat facet
    np.append(np.zeros(ELECTRODES), _MESH_AREA_MM2),
])  # fmt: skip
_BETWEEN_MM2 = ((surface.ELECTRODE_MM[:, None] - surface.ELECTRODE_MM[None]) ** 2).sum(axis=2)
_SMOOTH = np.linalg.cholesky(np.exp(_BETWEEN_MM2 / (-2.0 * SPREAD_REACH_MM**2)) + 1e-9 * np.eye(ELECTRODES))


def deform(states: States, footprints: Footprints | None = None, skin: Skin = SKIN) -> tuple[Floats, Floats]:
    """Log compression and log bulge of the gap over the electrodes, each (n, 19).

    Both are 0 without contact. Those of several contacts add: the logs of the gap after each, and the volumes each
    displaces. ``footprints`` replace ``tip_radius_mm``. A state like the one before is not computed again: a scenario
    mostly holds still.
    """
    both = np.empty((2, len(states), ELECTRODES))
    shape, kept = ffi.NULL, [] if footprints is None else [doubles(numbers) for numbers in vars(footprints).values()]
    if kept:
        shape = ffi.new("bt_footprints *", kept)
    into = doubles(both)
    lib.bt_deform(skin.in_c, shape, len(states), states.in_c[0], into, into + both.size // 2)
    return both[0], both[1]


def counts_of(
    r0_ohm: Floats, gap_gain: Floats, deformation: tuple[Floats, Floats] | None, warm_c: Floats, skin: Skin = SKIN
) -> Floats:
    """Counts (n, 19), not rounded, at ``warm_c`` (n,) in C above 30 C, from deform()'s results; None: at rest.

    ``r0_ohm`` and ``gap_gain`` (19,) are as SimFinger's.
    """
    counts = np.empty((len(warm_c), ELECTRODES))
    squeezed, widened = (ffi.NULL, ffi.NULL) if deformation is None else map(doubles, deformation)
    own = doubles(r0_ohm), doubles(gap_gain)
    lib.bt_skin_counts(skin.in_c, *own, len(counts), squeezed, widened, doubles(warm_c), doubles(counts))
    return counts


class SimFinger:
    """One finger of the population; the same seed and profile give the same finger.

    Resistances and sensitivities are drawn about those that two real fingers share, as far apart as these are
    (skin.json). ``profile``: "new" has a quiet converter, "worn" the low resistances of trial_15330's finger with the
    noise of F1 and F2 and the glitches of btd_biotacsp. ``r0_ohm`` and ``gap_gain`` are (19,): resistance at rest and
    30 C, and gap sensitivity. ``pdc_rest`` is in counts. ``rattle_per_n_s`` is drawn between half and twice the
    RATTLE_PER_N_S of PAC, log-uniformly; set it to try another.

    Numbers that no recording fixes are drawn log-uniformly, too, and may be set: ``pressure_gain``, of the counts of
    pressure per newton; ``tip_gain`` and ``side_gain``, of all effects of a newton at the tip's end and at the very
    side, so that signals per pressure stay those of a real plate. ``at_spread`` sets all three.
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
        """Put the numbers that no recording fixes at places of their spread, -1 to 1: 0 is the middle."""
        self.pressure_gain = PRESSURE_SPREAD**pressure
        self.tip_gain, self.side_gain = PLACE_SPREAD**tip, PLACE_SPREAD**side

    def loudness(self, contact_mm: Floats) -> Floats:
        """The effect of a newton at ``contact_mm`` (n, 3), over that in the middle of the spread, (n,)."""
        share = np.empty(len(contact_mm))
        lib.bt_loudness(SKIN.in_c, self.tip_gain, self.side_gain, len(share), doubles(contact_mm), doubles(share))
        return share

    def rest_counts(self, warm_c: Floats) -> Floats:
        """Counts (n, 19) without contact at temperatures (n,) above 30 C."""
        return counts_of(self.r0_ohm, self.gap_gain, None, warm_c)

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
        return counts_of(self.r0_ohm, self.gap_gain, (compression, bulge), warm_c)


def resistance_at(counts: Floats) -> Floats:
    """The resistances in ohm of counts above 0."""
    return (_sensor.FULL_SCALE_COUNT / counts - 1.0) * _sensor.LOAD_OHM
