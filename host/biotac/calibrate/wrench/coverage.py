"""The parts of a finger's surface and the directions of force that a calibration has seen, and the missing ones.

The reference alone decides: the wrench says where and how the finger is touched, without any model of the sensor
that is being calibrated.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from ...core import geometry as surface
from ...kernels.geometry import Floats
from . import contact

REGIONS = ("tip", "pad", "side of E11", "side of E1")
CELLS_PER_REGION = 8
WAYS = ("shear to the tip", "shear from the tip", "shear to E11's side", "shear to E1's side", "twist one way",
        "twist the other way")  # fmt: skip
FORCES = ("light press", "firm press")

SIDE_DEG = 30.0  # angle around the finger from the pad's middle, beyond which it is a side
EDGE_DEG = 85.0
TIP_UP_DEG = 32.0  # half of what a flat plate can reach of the tip

# When a place, a direction or a force counts as seen ...
TOUCH_N = 1.0
LIGHT_N = 3.0  # a light press is from TOUCH_N to this
FIRM_N = 4.0
SHEAR_N = 0.4
TWIST_NMM = 1.5
SEEN_S = 0.25  # time needed in a cell, or for a direction in a region
# ... and when that is enough: cells of the 8 in each region, and cells with a light press and with a firm one.
ENOUGH_CELLS = 6
ENOUGH_FORCE_CELLS = 4


@dataclass
class Coverage:
    """Seconds seen of every cell (4 regions, 8 cells), direction (4, 6) and force in a cell (4, 8, 2)."""

    cells_s: Floats = field(default_factory=lambda: np.zeros((len(REGIONS), CELLS_PER_REGION)))
    ways_s: Floats = field(default_factory=lambda: np.zeros((len(REGIONS), len(WAYS))))
    forces_s: Floats = field(default_factory=lambda: np.zeros((len(REGIONS), CELLS_PER_REGION, len(FORCES))))

    def add(self, wrench: Floats, step_s: float) -> None:
        """Take wrenches (n, 6) on the finger in Lin's frame, each lasting ``step_s``."""
        wrench = wrench[np.isfinite(wrench).all(axis=1)]
        wrench = wrench[np.linalg.norm(wrench[:, :3], axis=1) > TOUCH_N]
        if not len(wrench):
            return
        found = contact.locate(wrench[:, :3], wrench[:, 3:])
        touched = found.on_skin & ~found.missed & (found.normal_force_n > TOUCH_N)
        region, cell = cell_of(found.point_mm[touched], found.normal[touched])
        np.add.at(self.cells_s, (region, cell), step_s)
        normal, pressed = found.normal[touched], found.normal_force_n[touched]
        to_tip, to_side = surface.tangents_at(normal)
        along, across = ((wrench[touched, :3] * way).sum(axis=1) for way in (to_tip, to_side))
        twist = found.torsion_nmm[touched]
        seen = [along > SHEAR_N, along < -SHEAR_N, across > SHEAR_N, across < -SHEAR_N]
        seen += [twist > TWIST_NMM, twist < -TWIST_NMM]
        for way, hit in enumerate(seen):
            np.add.at(self.ways_s[:, way], region[hit], step_s)
        for force, hit in enumerate((pressed < LIGHT_N, pressed > FIRM_N)):
            np.add.at(self.forces_s[:, :, force], (region[hit], cell[hit]), step_s)

    @property
    def cells(self) -> npt.NDArray[np.int64]:
        """How many of the 8 cells of each region (4,) have been seen."""
        result: npt.NDArray[np.int64] = (self.cells_s >= SEEN_S).sum(axis=1)
        return result

    @property
    def complete(self) -> bool:
        return not self.missing()

    def missing(self) -> list[str]:
        """A line for each region that lacks something, the one with the fewest cells first."""
        lines: list[tuple[int, str]] = []
        for region, (name, have) in enumerate(zip(REGIONS, self.cells.tolist(), strict=True)):
            parts = [f"{have} of {CELLS_PER_REGION} cells"] if have < ENOUGH_CELLS else []
            if have:  # for an untouched region, the line above is enough
                pressed = (self.forces_s[region] >= SEEN_S).sum(axis=0).tolist()
                for word, count in zip(FORCES, pressed, strict=True):
                    if count < ENOUGH_FORCE_CELLS:
                        parts.append(f"{word} in {count} of {ENOUGH_FORCE_CELLS} cells" if count else f"no {word}")
                seen = zip(WAYS, self.ways_s[region], strict=True)
                parts += [f"no {word}" for word, seconds in seen if seconds < SEEN_S]
            if parts:
                lines.append((have, f"{name}: {'; '.join(parts)}"))
        return [line for _, line in sorted(lines, key=lambda entry: entry[0])]

    def summary(self) -> str:
        """One line: the cells seen in each region."""
        return ", ".join(f"{name} {k}/{CELLS_PER_REGION}" for name, k in zip(REGIONS, self.cells, strict=True))


def cell_of(point_mm: Floats, normal: Floats) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Region and cell, (n,) each, of contacts (n, 3) on the ventral surface with outward normals (n, 3).

    Pad and sides are cut into four cells along and two across, the tip into two up and four around.
    """
    around = np.degrees(np.arctan2(normal[:, 1], -normal[:, 2]))
    up = np.degrees(np.arcsin(np.clip(normal[:, 0], 0.0, 1.0)))
    tip = point_mm[:, 0] > 0.0
    region = np.where(tip, 0, np.where(np.abs(around) <= SIDE_DEG, 1, np.where(around > 0.0, 2, 3)))
    along = np.clip((point_mm[:, 0] / surface.PROXIMAL_END_MM * 4.0).astype(np.intp), 0, 3)
    half = (SIDE_DEG + EDGE_DEG) / 2.0
    across = np.where(region == 1, around > 0.0, np.abs(around) > half).astype(np.intp)
    quarter = np.clip((around / SIDE_DEG / 1.2 + 2.0).astype(np.intp), 0, 3)
    cell = np.where(tip, 4 * (up > TIP_UP_DEG) + quarter, 2 * along + across)
    return region.astype(np.intp), cell.astype(np.intp)
