"""Torsion with shear: Lin, Fishel and Loeb 2013, figure 10.

Region II is the torsion trial of figure 9; regions I and III are the same torsions while the weight is also
pushed to E11's side (+y) and to E1's (-y). The paper's estimates of the two are "substantially convolved".
"""

from __future__ import annotations

from ..core import Settings
from ..sim import surface
from ..sim.physics import Profile
from ..sim.timeline import Pose
from .trial import Script, Trial, play

WEIGHT_N = 4.905  # 500 g
SHEAR_N = 1.5  # the paper gives none; numerics.md 3.4 replays the figure with this
TORSION_NMM = 6.0  # nor for this: as much as a flat under 5 N holds at moderate friction
FLAT_MM = 7.0  # numerics.md 3.1: a flat surface leaves a footprint of 3.5 mm radius
E17_MM = (float(surface.ELECTRODE_MM[16, 0]), float(surface.ELECTRODE_MM[16, 1]))
REGIONS = {"I": 1.0, "II": 0.0, "III": -1.0}  # shear along +y
RAMP_S, HOLD_S = 0.5, 2.5

# Phases of a region. The finger lies pad up and the torque is turned seen from above, along the inward normal,
# so clockwise is negative about the outward one.
TURNS = (("rest", 0.0), ("clockwise", -1.0), ("between", 0.0), ("counter", 1.0), ("after", 0.0))


def replay(
    at_mm: tuple[float, float] = E17_MM,
    *,
    seed: int = 5,
    profile: Profile = "new",
    force_n: float = WEIGHT_N,
    shear_n: float = SHEAR_N,
    torsion_nmm: float = TORSION_NMM,
    tip_mm: float = FLAT_MM,
    settings: Settings | None = None,
    noiseless: bool = False,
    mirrored: bool = False,
) -> Trial:
    """Figure 10 on an emulated finger: states, counts, the truth and the board's results.

    ``at_mm`` places the weight; ``force_n`` > 0 is its normal force, ``shear_n`` the push to +y in region I and
    to -y in III, ``torsion_nmm`` the torque's size. Phases are called "I clockwise", "II counter", ... after
    REGIONS and TURNS; `mirrored` is the same trial as its mirror image sees it.
    """
    side = -1.0 if mirrored else 1.0
    x_mm, y_mm = at_mm[0], side * at_mm[1]
    script = Script()
    start = Pose(x_mm=x_mm, y_mm=y_mm, tip_mm=tip_mm)
    script.phase("A", 0.1, 1.9, start, start)
    script.phase("B", RAMP_S, HOLD_S, Pose(x_mm, y_mm, force_n, tip_mm=tip_mm))
    for region, push in REGIONS.items():
        for turn, sign in TURNS:
            pose = Pose(
                x_mm,
                y_mm,
                force_n,
                shear_y_n=side * push * shear_n,
                torsion_nmm=side * sign * torsion_nmm,
                tip_mm=tip_mm,
            )
            script.phase(f"{region} {turn}", RAMP_S, HOLD_S, pose)
    script.phase("G", RAMP_S, HOLD_S, start)
    return play(
        "torsion-shear", script, seed=seed, profile=profile, settings=settings, noiseless=noiseless, mirrored=mirrored
    )
