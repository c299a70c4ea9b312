"""A trial of an experiment: counts, what was applied, and what the board made of the counts.

Every result is the compiled core's (biotac.Finger), tare machine and all, so it is what a board would
publish. The truth of an emulated trial is what its scenario applied (sim/physics.py States.wrench), never
anything computed from counts.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from ...core import geometry as surface
from ...core.compiled import Settings
from ...core.finger import Finger, to_frames
from ...core.geometry import Floats
from ...sim import physics, sampling
from ...sim.physics import Profile, States
from ...sim.timeline import Pose, Track
from ...wire import messages_gen as wire
from ...wire import slots
from ...wire.frames import StructArray, to_units

Bools = npt.NDArray[np.bool_]
Words = npt.NDArray[np.uint16]

_TAKE_SEED_STEP = 100_003
TARE_Q4_PER_COUNT = 16
SETTLE_S = 0.3  # after a ramp: what is averaged over a phase begins this late


@dataclass(frozen=True)
class Phase:
    """A lettered stretch of a trial; ``begin_s`` is where its ramp ends and the load holds still."""

    name: str
    begin_s: float
    end_s: float


@dataclass(frozen=True)
class Trial:
    """n frames of one finger, 10 ms each.

    ``counts`` uint16 (n, 19) and ``pdc`` uint16 (n,), 0xFFFF where missing; ``rows`` FINGER_DTYPE (n,), the
    board's; ``tare`` (n, 19) counts in 1/16 and ``pdc_rest`` (n,) counts, the board's tare at each frame, NaN
    until there is one. ``force_n`` (n, 3) on the finger and ``torque_nmm`` (n, 3) about Lin's origin are the
    truth; ``torsion_nmm`` (n,) is about the outward normal of the contact, ``at_mm`` (n, 3) the true contact,
    NaN without one. What a recording does not hold is None. ``states`` are those of an emulated trial;
    ``given`` (19,) is a tare that the board was told at the start.
    """

    name: str
    time_s: Floats
    phases: tuple[Phase, ...]
    counts: Words
    pdc: Words
    rows: StructArray
    tare: Floats
    pdc_rest: Floats
    force_n: Floats | None
    torque_nmm: Floats | None
    torsion_nmm: Floats | None = None
    at_mm: Floats | None = None
    states: States | None = None
    given: Floats | None = None

    def __len__(self) -> int:
        return len(self.counts)

    @property
    def signal(self) -> Floats:
        """e (n, 19) in counts above the board's tare; NaN where there is none."""
        known = self.counts != wire.INVALID_COUNT
        result: Floats = np.where(known, self.counts - self.tare, np.nan)
        return result

    @property
    def pressure(self) -> Floats:
        """PDC (n,) in counts above its rest; NaN where missing."""
        return np.where(self.pdc != wire.INVALID_COUNT, self.pdc - self.pdc_rest, np.nan)

    @property
    def frames(self) -> StructArray:
        """The board's results in mm, N and N mm (FRAME_DTYPE), a row for each of ``rows``."""
        return to_frames(self.rows)

    @property
    def touched(self) -> Bools:
        """Frames (n,) in which the board says that the finger is touched."""
        return np.asarray(self.rows["flags"] & wire.FrameFlags.CONTACT != 0)

    def during(self, phase: Phase) -> Bools:
        """Frames (n,) of a phase in which its load holds still."""
        return (self.time_s >= phase.begin_s + SETTLE_S) & (self.time_s < phase.end_s)

    def again(self, settings: Settings) -> Trial:
        """The same counts through a board with other weights and gains, which the tare does not depend on."""
        return replace(self, rows=_board(settings, self.given).feed(self.counts, self.pdc))


class Script:
    """What is done to a finger, phase by phase; times in s."""

    def __init__(self) -> None:
        self.track = Track()
        self.phases: list[Phase] = []

    def phase(self, name: str, ramp_s: float, hold_s: float, end: Pose, start: Pose | None = None) -> None:
        """Go straight to ``end`` in ``ramp_s``, then hold it; ``start`` jumps there first, unloaded."""
        self.track.ramp(ramp_s, end, start)
        begin_s = self.track.seconds
        self.track.ramp(hold_s, end)
        self.phases.append(Phase(name, begin_s, self.track.seconds))


def play(
    name: str,
    script: Script,
    *,
    seed: int,
    profile: Profile = "new",
    take: int = 0,
    noiseless: bool = False,
    mirrored: bool = False,
) -> Trial:
    """An emulated finger goes through ``script`` and a board reads it.

    ``take`` counts how often the same finger was used before: noise differs, the sensor does not.
    ``noiseless`` leaves out noise, glitches, drift and creep. ``mirrored`` swaps the two sides of the sensor
    (E1 and E11, ...), as a finger of the other hand: with the mirrored script, results mirror.
    """
    finger = physics.Finger(seed, profile)
    finger.seed += _TAKE_SEED_STEP * take  # by now it only seeds the noise
    if noiseless:
        finger.noise_counts = finger.glitch_share = finger.creep_share = 0.0
        finger.drift_per_min = np.zeros_like(finger.drift_per_min)
    if mirrored:
        for own in (finger.r0_ohm, finger.gap_gain, finger.drift_per_min):
            own[:] = own[MIRROR]
    frames = round(script.track.seconds / slots.FRAME_S)
    boundary_s: Floats = np.arange(frames + 1, dtype=np.float64) * slots.FRAME_S
    words = sampling.sample(finger, script.track.states(boundary_s))
    time_s: Floats = boundary_s[:-1] + slots.FRAME_S / 2.0
    states = script.track.states(time_s)
    counts, pdc = words[:, slots.ELECTRODE_SLOT], words[:, slots.PDC_SLOT]
    rows, tare, pdc_rest = on_board(counts, pdc)
    force, torque = states.wrench()
    touched = states.force_n > 0.0
    return Trial(
        name=name,
        time_s=time_s,
        phases=tuple(script.phases),
        counts=counts,
        pdc=pdc,
        rows=rows,
        tare=tare,
        pdc_rest=pdc_rest,
        force_n=force,
        torque_nmm=torque,
        torsion_nmm=states.torsion_nmm,
        at_mm=np.where(touched[:, None], states.contact_mm, np.nan),
        states=states,
    )


def on_board(counts: Words, pdc: Words, *, given: Floats | None = None) -> tuple[StructArray, Floats, Floats]:
    """A board's rows (n,), its electrode tare (n, 19) and its PDC tare (n,), in counts, NaN while unknown.

    ``given`` (19,) counts is the tare it is told before the first round; by default it finds its own.
    """
    rows = _board(None, given).feed(counts, pdc)
    tare, pdc_rest = (to_units(rows[name], TARE_Q4_PER_COUNT) for name in ("tare_q4", "pdc_tare_q4"))
    return rows, tare, pdc_rest


def _board(settings: Settings | None, given: Floats | None) -> Finger:
    # The papers' own formulas are what is tried here; the population map knows real fingers on flat plates.
    board = Finger({wire.Setting.FORCE_MODEL: wire.ForceModel.LIN} | (settings or {}))
    if given is not None:
        board.set_tare(given)
    return board


def _mirror() -> npt.NDArray[np.intp]:
    flipped = surface.ELECTRODE_MM * np.array([1.0, -1.0, 1.0])
    apart = np.linalg.norm(surface.ELECTRODE_MM[None] - flipped[:, None], axis=2)
    return np.asarray(np.argmin(apart, axis=1))


#: Electrode (19,) that lies where each one's mirror image does.
MIRROR = _mirror()
