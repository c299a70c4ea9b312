"""Contact to electrode counts: the sensor model of reference/numerics.md, section 3.1.

A contact squeezes the fluid gap over the electrodes under it; the displaced volume bulges the gap
elsewhere, tangential force and torsion shift it sideways; each electrode's resistance follows its
gap, and a divider turns it into counts. The constants are the section's: anchored to the paper's
rest resistance, about 10 MOhm at 30 N and about 1000 count^2 at 0.5 N; the rest is a free choice,
so this is a sensor like a BioTac, not a given BioTac. sampling.py adds what time and noise do.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from ..core import geometry as surface
from ..core.geometry import Floats
from ..wire import sensor_gen as _sensor

if TYPE_CHECKING:
    from ..calibrate.press.few_shot import Scale

Profile = Literal["new", "worn"]
PROFILES: tuple[Profile, ...] = ("new", "worn")

ELECTRODES = len(_sensor.ELECTRODE_NAMES)
REST_CELSIUS = 30.0  # the model's reference temperature

GAP_MM = 2.0  # fluid thickness at rest
FOOTPRINT_GROWTH_MM = 0.35  # per cube root of a newton
SQUEEZE_AT_REFERENCE = 4.15  # log compression of the gap at 30 N under a 2 mm footprint
SQUEEZE_FORCE_N = 30.0
SQUEEZE_EXPONENT = 1.319  # fixed by 1000 count^2 at 0.5 N, mean over pokes on all electrodes
SQUEEZE_FOOTPRINT_MM = 2.0
SHEAR_N_PER_MM = np.array([4.0, 3.0, 3.0])
SHEAR_MAX_MM = 1.6
TORSION_NMM_PER_RAD = 25.0
TORSION_MAX_RAD = 0.6
SHEAR_REACH_MM = 7.0
ANCHOR_SHARE = 0.4  # the nail holds the skin: this much less compliance at z = 0 than at z = -r
SEAL_MM, SEAL_REACH_MM = -16.5, 3.0  # the proximal seal holds it at the other end
BULGE_SHARE = 0.8  # of the displaced volume shows up as bulge within the mesh
BULGE_HOLE = 1.5  # footprints around the contact do not bulge
FIXED_RESISTANCE_SHARE = 0.35  # path through fluid that no contact moves
TEMPERATURE_PER_C = -0.02  # of log resistance
PDC_REST = (1300, 2700)  # counts of static pressure at rest: real sensors' is 1326, 2412, and 2582 to 2695

_BLOCK = 256  # states at a time: keeps the (states x mesh points) arrays inside the cache


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


def compliance(points_mm: Floats) -> Floats:
    """How freely the skin over core points (n, 3) moves: (n,), 0 to 1."""
    anchored = 1.0 - ANCHOR_SHARE * (1.0 + points_mm[:, 2] / surface.RADIUS_MM)
    sealed = 1.0 - np.exp(-(points_mm[:, 0] - SEAL_MM) / SEAL_REACH_MM)
    return anchored * np.clip(sealed, 0.0, 1.0)


_MESH_MM, _MESH_NORMAL, _MESH_AREA_MM2 = surface.ventral_mesh()
_MESH_COMPLIANCE = compliance(_MESH_MM)
_ELECTRODE_COMPLIANCE = compliance(surface.ELECTRODE_MM)


def _distance2(points_mm: Floats, contact_mm: Floats) -> Floats:
    """Squared distances (contacts, points) in mm^2."""
    squared: Floats = (
        (contact_mm**2).sum(axis=1)[:, None] + (points_mm**2).sum(axis=1)[None, :] - 2.0 * contact_mm @ points_mm.T
    )
    return np.maximum(squared, 0.0)


def _squeeze_and_bulge(state: Floats) -> tuple[Floats, Floats]:
    """Log compression and relative bulge (n, 19) for touched states in _pack()'s columns."""
    contact, force, shear, torsion = state[:, 0:3], state[:, 3], state[:, 4:7], state[:, 7]
    normal = surface.normals_at(contact)
    footprint, ellipse = state[:, 8:9], state[:, 9:13]
    if not ellipse.shape[1]:
        footprint = footprint + FOOTPRINT_GROWTH_MM * np.cbrt(force)[:, None]
    # same area as a round footprint, so that the shape alone does not change the force
    size = footprint if not ellipse.shape[1] else np.sqrt(footprint * ellipse[:, :1])
    depth = (
        SQUEEZE_AT_REFERENCE * ((force / SQUEEZE_FORCE_N) ** SQUEEZE_EXPONENT)[:, None] * (SQUEEZE_FOOTPRINT_MM / size)
    )

    def footprints2(points_mm: Floats, distance2: Floats) -> Floats:
        """Squared distance (contacts, points) in footprints."""
        if not ellipse.shape[1]:
            return distance2 / footprint**2
        along = ellipse[:, 1:] @ points_mm.T - (ellipse[:, 1:] * contact).sum(axis=1)[:, None]
        along2 = np.minimum(along**2, distance2)
        result: Floats = (distance2 - along2) / footprint**2 + along2 / ellipse[:, :1] ** 2
        return result

    def squeeze(away2: Floats, facing: Floats) -> Floats:
        return depth * np.exp(-away2 / 2.0) * np.maximum(facing, 0.0)

    def outside(away2: Floats) -> Floats:
        return 1.0 - np.exp(-away2 / (2.0 * BULGE_HOLE**2))

    far = footprints2(_MESH_MM, _distance2(_MESH_MM, contact))
    pressed = squeeze(far, normal @ _MESH_NORMAL.T)
    volume_mm3 = (GAP_MM * (1.0 - np.exp(-pressed))) @ _MESH_AREA_MM2
    room_mm3 = (GAP_MM * outside(far)) @ (_MESH_COMPLIANCE * _MESH_AREA_MM2)

    near = _distance2(surface.ELECTRODE_MM, contact)
    away2 = footprints2(surface.ELECTRODE_MM, near)
    compression = squeeze(away2, normal @ surface.ELECTRODE_NORMAL.T)
    bulge = (BULGE_SHARE * volume_mm3 / room_mm3)[:, None] * _ELECTRODE_COMPLIANCE * outside(away2)

    shift = shear / SHEAR_N_PER_MM
    length = np.linalg.norm(shift, axis=1, keepdims=True)
    limited = SHEAR_MAX_MM * np.tanh(length / SHEAR_MAX_MM)
    shift = shift * np.divide(limited, length, out=np.ones_like(length), where=length > 0.0)
    angle = TORSION_MAX_RAD * np.tanh(torsion / (TORSION_NMM_PER_RAD * TORSION_MAX_RAD))
    arm = surface.ELECTRODE_MM[None, :, :] - contact[:, None, :]
    moved = shift[:, None, :] + np.cross((angle[:, None] * normal)[:, None, :], arm)
    outward = np.einsum("nec,ec->ne", moved, surface.ELECTRODE_NORMAL)
    sideways = outward / GAP_MM * np.exp(-near / (2.0 * SHEAR_REACH_MM**2)) * _ELECTRODE_COMPLIANCE
    return compression, bulge + sideways


def _pack(states: States, footprints: Footprints | None) -> Floats:
    """The mechanical part of touched states as rows (n, 9), or (n, 13) with footprints in place of the tip."""
    load = [states.contact_mm, states.force_n, states.shear_n, states.torsion_nmm]
    if footprints is None:
        return np.column_stack([*load, states.tip_radius_mm])
    return np.column_stack([*load, footprints.short_mm, footprints.long_mm, footprints.along])


def deform(states: States, footprints: Footprints | None = None) -> tuple[Floats, Floats]:
    """Log compression and relative bulge of the gap over the electrodes, each (n, 19).

    Both are 0 without contact, and those of several contacts add: the logs of what each leaves of the gap, and the
    volumes each displaces. ``footprints`` take the place of ``tip_radius_mm``. Equal states are computed once: a
    scenario mostly holds still.
    """
    compression = np.zeros((len(states), ELECTRODES))
    bulge = np.zeros((len(states), ELECTRODES))
    touched = np.flatnonzero(states.force_n > 0.0)
    if len(touched):
        unique, inverse = np.unique(_pack(states, footprints)[touched], axis=0, return_inverse=True)
        parts = [_squeeze_and_bulge(unique[k : k + _BLOCK]) for k in range(0, len(unique), _BLOCK)]
        rows = inverse.reshape(-1)  # NumPy 2.0 alone returns it as a column
        compression[touched] = np.concatenate([part[0] for part in parts])[rows]
        bulge[touched] = np.concatenate([part[1] for part in parts])[rows]
    return compression, bulge


class Finger:
    """One sensor with its own resistances and skin; the same seed and profile give the same sensor.

    ``profile``: "new" has the paper's rest resistance and a quiet converter, "worn" what the public
    recordings show (numerics.md 1.1 and 1.4: 1.4 to 3.9 kOhm, sigma 5, 0.5 % glitches).
    With ``scale`` it is a finger that the population map knows, but for that correction (known_finger.py).
    ``r0_ohm`` and ``gap_gain`` are (19,): resistance at rest and 30 C, and gap sensitivity. ``pdc_rest`` is in counts.
    """

    def __init__(self, seed: int, profile: Profile = "new", scale: Scale | None = None) -> None:
        worn = profile == "worn"
        rng = np.random.default_rng([seed, 0])
        low_ohm, high_ohm = (1400.0, 3900.0) if worn else (3000.0, 5000.0)
        self.seed = seed
        self.profile: Profile = profile
        self.scale = scale
        self.r0_ohm: Floats = rng.uniform(low_ohm, high_ohm, ELECTRODES)
        self.gap_gain: Floats = rng.normal(1.0, 0.06, ELECTRODES)
        # real drift is one-dimensional: one rate a finger, loadings 0.82 to 1.16 (biotac.md finding 6)
        self.drift_per_min: Floats = rng.uniform(-15.0, 15.0) * rng.uniform(0.82, 1.16, ELECTRODES)
        self.creep_share = float(rng.uniform(0.02, 0.05))
        self.pdc_rest = float(np.random.default_rng([seed, 6]).integers(*PDC_REST))
        self.noise_counts = 5.0 if worn else 1.5
        self.glitch_share = 0.005 if worn else 0.0

    def rest_counts(self, warm_c: Floats) -> Floats:
        """Counts (n, 19) without contact at temperatures (n,) above 30 C."""
        return _divider(self.r0_ohm * np.exp(TEMPERATURE_PER_C * warm_c)[:, None])

    def counts(self, states: States) -> Floats:
        """Counts (n, 19), not rounded, without noise, drift or creep."""
        counts, touched = self.counts_of(*states.deformation, states.warm_c), states.force_n > 0.0
        if self.scale is not None and touched.any():
            from .known_finger import answered  # with all that calibrates, which few fingers need

            at_rest = self.rest_counts(states.warm_c)[touched]
            load = np.column_stack([counts[touched] - at_rest, states.wrench()[0][touched]])
            unique, inverse = np.unique(load, axis=0, return_inverse=True)  # a scenario mostly holds still
            e = answered(unique[:, :ELECTRODES], self.rest_counts(np.zeros(1))[0], unique[:, ELECTRODES:], self.scale)
            counts[touched] = at_rest + e[inverse.reshape(-1)]
        return counts

    def counts_of(self, compression: Floats, bulge: Floats, warm_c: Floats) -> Floats:
        """counts() from the results of deform(), each (n, 19), at ``warm_c`` (n,) in C above 30 C."""
        change = bulge * self.gap_gain
        # a bulge opens the gap in proportion; a negative one must not close it past zero
        opened = np.where(change >= 0.0, 1.0 + change, np.exp(np.minimum(change, 0.0)))
        gap = np.exp(-compression * self.gap_gain) * opened
        share = FIXED_RESISTANCE_SHARE + (1.0 - FIXED_RESISTANCE_SHARE) / gap**2
        return _divider(self.r0_ohm * share * np.exp(TEMPERATURE_PER_C * warm_c)[:, None])


def _divider(resistance_ohm: Floats) -> Floats:
    return _sensor.FULL_SCALE_COUNT * _sensor.LOAD_OHM / (resistance_ohm + _sensor.LOAD_OHM)
