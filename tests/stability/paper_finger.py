"""The finger of Lin 2013's anchors: about 10 MOhm at 30 N, about 1000 count^2 at 0.5 N.

The courses, holds and faults of these tests are judged on it. biotac.sim's finger is fitted to two real ones, and
gives several times the signal; on that finger these courses would not test the firmware's rules.
"""

import numpy as np

from biotac.core import geometry as surface
from biotac.kernels.geometry import Floats
from biotac.sim import physics
from biotac.sim.physics import ELECTRODES, Profile, States
from biotac.wire import sensor_gen as _sensor

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
_BLOCK = 256  # states at a time: the (states x mesh points) arrays stay in the cache


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
    footprint = state[:, 8:9] + FOOTPRINT_GROWTH_MM * np.cbrt(force)[:, None]
    depth = (
        SQUEEZE_AT_REFERENCE
        * ((force / SQUEEZE_FORCE_N) ** SQUEEZE_EXPONENT)[:, None]
        * (SQUEEZE_FOOTPRINT_MM / footprint)
    )

    def squeeze(away2: Floats, facing: Floats) -> Floats:
        return depth * np.exp(-away2 / 2.0) * np.maximum(facing, 0.0)

    def outside(away2: Floats) -> Floats:
        return 1.0 - np.exp(-away2 / (2.0 * BULGE_HOLE**2))

    far = _distance2(_MESH_MM, contact) / footprint**2
    pressed = squeeze(far, normal @ _MESH_NORMAL.T)
    volume_mm3 = (GAP_MM * (1.0 - np.exp(-pressed))) @ _MESH_AREA_MM2
    room_mm3 = (GAP_MM * outside(far)) @ (_MESH_COMPLIANCE * _MESH_AREA_MM2)

    near = _distance2(surface.ELECTRODE_MM, contact)
    away2 = near / footprint**2
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


def deform(states: States) -> tuple[Floats, Floats]:
    """Log compression and relative bulge of the gap over the electrodes, each (n, 19); 0 without contact."""
    compression, bulge = (np.zeros((len(states), ELECTRODES)) for _ in range(2))
    touched = np.flatnonzero(states.force_n > 0.0)
    load = [states.contact_mm, states.force_n, states.shear_n, states.torsion_nmm, states.tip_radius_mm]
    if len(touched):
        loads = np.column_stack(load)[touched]
        number: dict[bytes, int] = {}  # of each load; np.unique, which sorts, takes several times as long
        rows = [number.setdefault(load, len(number)) for load in loads.view(f"V{loads[0].nbytes}").ravel().tolist()]
        unlike = np.frombuffer(b"".join(number)).reshape(-1, loads.shape[1])
        parts = [_squeeze_and_bulge(unlike[k : k + _BLOCK]) for k in range(0, len(unlike), _BLOCK)]
        compression[touched] = np.concatenate([part[0] for part in parts])[rows]
        bulge[touched] = np.concatenate([part[1] for part in parts])[rows]
    return compression, bulge


class PaperFinger(physics.SimFinger):
    """One sensor with random resistances and skin; the same seed and profile give the same sensor."""

    def __init__(self, seed: int, profile: Profile = "new") -> None:
        super().__init__(seed, profile)
        rng = np.random.default_rng([seed, 0])
        low_ohm, high_ohm = (1400.0, 3900.0) if profile == "worn" else (3000.0, 5000.0)
        self.r0_ohm: Floats = rng.uniform(low_ohm, high_ohm, ELECTRODES)
        self.gap_gain: Floats = rng.normal(1.0, 0.06, ELECTRODES)
        self.drift_per_min: Floats = rng.uniform(-15.0, 15.0) * rng.uniform(0.82, 1.16, ELECTRODES)
        self.creep_share = float(rng.uniform(0.02, 0.05))

    def rest_counts(self, warm_c: Floats) -> Floats:
        return _divider(self.r0_ohm * np.exp(TEMPERATURE_PER_C * warm_c)[:, None])

    def counts(self, states: States) -> Floats:
        return self.counts_of(*deform(states), states.warm_c)

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
