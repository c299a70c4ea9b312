"""Footprints of the probes of Wettels and Loeb 2011 (tips of 1, 3.6 and 10 mm radius, a flat) and of a bar.

Two bodies that touch are apart by h(u) = u.C u / 2 around the first point, C the sum of their curvatures in the tangent
plane (Johnson, Contact Mechanics, 1985, 4.1). With its eigenvalues c1 <= c2, Hertz's ellipse has, to 4 % up to a
slenderness of 5 (Johnson 4.26 and 4.28),

    sqrt(a b) = (3 F / (4 E* sqrt(c1 c2)))^(1/3),    a / b = (c2 / c1)^(2/3),    a along c1's eigenvector.

The finger is curved across only on the cylinder and both ways on the cap, SKIN_RADIUS_MM; a tip has 1/R both ways, a
flat none, a bar 1/R across itself and none along. No probe is longer than its half length, and the skin passes on
nothing finer than the skin's thickness: both are added as squares. E* is silicone's of Shore A 26, a free choice like
the rest of the emulated finger: like a BioTac and not a given one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from biotac.core import geometry as surface
from biotac.sim import GAP_MM, Footprints, SimFinger, States, deform

Floats = npt.NDArray[np.float64]

E_STAR_MPA = 1.3  # E / (1 - nu^2) of silicone with E = 1 MPa, nu = 0.5
SKIN_RADIUS_MM = surface.RADIUS_MM + GAP_MM
SKIN_MM = 0.6  # half length of a point's footprint
FLATTEST_PER_MM = 1.0 / 60.0  # bounds slenderness: a flat along a cylinder ends at an edge, not at infinity


@dataclass(frozen=True)
class Probe:
    """A probe. ``radius_mm``: radius of curvature, inf for a flat. ``half_length_mm``: distance to the end.

    A ``bar`` is a cylinder of that radius lying on the skin, rotated by an angle; see footprints().
    """

    name: str
    radius_mm: float
    half_length_mm: float
    bar: bool = False


#: The paper's four: classes 1 to 4 of figure 7.
PROBES = (Probe("1 mm", 1.0, 5.0), Probe("3.6 mm", 3.6, 5.0), Probe("10 mm", 10.0, 10.0), Probe("flat", np.inf, 10.0))
BAR = Probe("bar", 1.0, 10.0, bar=True)


def footprints(probe: Probe, contact_mm: Floats, force_n: Floats, turned_rad: Floats | None = None) -> Footprints:
    """Footprints of ``probe`` on core points (n, 3) under normal forces (n,) in N.

    ``turned_rad`` (n,) is a bar's direction in the tangent plane, 0 to the tip and pi/2 to E11's side.
    """
    n = len(contact_mm)
    to_tip, to_side = surface.tangents_at(surface.normals_at(contact_mm))
    sphere = contact_mm[:, 0] > 0.0
    # across the finger's axis it is curved everywhere, along it on the cap only
    curvature = np.zeros((n, 2, 2))
    curvature[:, 1, 1] = 1.0 / SKIN_RADIUS_MM
    curvature[:, 0, 0] = np.where(sphere, 1.0 / SKIN_RADIUS_MM, 0.0)
    if probe.bar:
        angle = np.zeros(n) if turned_rad is None else np.asarray(turned_rad, dtype=np.float64)
        across = np.column_stack([-np.sin(angle), np.cos(angle)])
        curvature += across[:, :, None] * across[:, None, :] / probe.radius_mm
    else:
        curvature += np.eye(2) / probe.radius_mm
    value, vector = np.linalg.eigh(curvature)
    value = np.maximum(value, FLATTEST_PER_MM)
    size = np.cbrt(3.0 * force_n / (4.0 * E_STAR_MPA * np.sqrt(value[:, 0] * value[:, 1])))
    slender = np.cbrt(value[:, 1] / value[:, 0])
    # the end of the probe cuts the long half length; a Gaussian's sigma is half a paraboloid's radius
    ended = 1.0 / np.sqrt(1.0 / (size * slender) ** 2 + 1.0 / probe.half_length_mm**2) if n else size
    along = vector[:, 0, :1] * to_tip + vector[:, 1, :1] * to_side
    return Footprints(np.hypot(SKIN_MM, size / slender / 2.0), np.hypot(SKIN_MM, ended / 2.0), along)


def counts_of(finger: SimFinger, contacts: Sequence[tuple[States, Footprints | None]]) -> Floats:
    """Counts (n, 19), not rounded, of simultaneous contacts: their squeezes and volumes add.

    Each contact has n states; the temperature is that of the first contact.
    """
    parts = [deform(states, footprint) for states, footprint in contacts]
    compression, bulge = (np.sum([part[k] for part in parts], axis=0) for k in (0, 1))
    return finger.counts_of(compression, bulge, contacts[0][0].warm_c)
