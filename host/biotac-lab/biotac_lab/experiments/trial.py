"""A trial of an experiment: counts, the load applied, and the board's results from the counts.

Every result is from the compiled core (biotac.Finger), tare machine included, as a board would publish it. The truth of
an emulated trial is the script's load (biotac.sim.States.wrench), never computed from counts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt

from biotac import Finger, ForceModel, FrameFlags, Setting, sim
from biotac.core import to_frames
from biotac.sim import Pose, Profile, States, Track
from biotac.wire import messages, slots

Floats = npt.NDArray[np.float64]
Bools = npt.NDArray[np.bool_]
Rows = npt.NDArray[np.void]
Settings = Mapping[Setting, int]
Words = npt.NDArray[np.uint16]

_REPEAT_SEED_STEP = 100_003
SETTLE_S = 0.3  # means over a phase begin this late after the ramp


@dataclass(frozen=True)
class Phase:
    """A lettered stretch of a trial; ``begin_s`` is where the ramp ends and the load holds still."""

    name: str
    begin_s: float
    end_s: float


@dataclass(frozen=True)
class Trial:
    """n frames of one finger, 10 ms each.

    ``counts`` uint16 (n, 19) and ``pdc`` uint16 (n,) are 0xFFFF where missing; ``rows`` FINGER_DTYPE (n,) are the
    board's. The truth is ``force_n`` (n, 3) on the finger and ``torque_nmm`` (n, 3) about Lin's origin; ``torsion_nmm``
    (n,) about the contact's outward normal; ``at_mm`` (n, 3) the true contact, NaN without one; ``plate_normal`` (n, 3)
    the unit normal of a plate that touches. Values that a recording lacks are NaN. ``states`` are those of an emulated
    trial; ``given`` (19,) is a tare that the board got at the start; ``notes`` say what was assumed about a recording.
    """

    name: str
    time_s: Floats
    phases: tuple[Phase, ...]
    counts: Words
    pdc: Words
    rows: Rows
    force_n: Floats
    torque_nmm: Floats
    torsion_nmm: Floats
    at_mm: Floats
    plate_normal: Floats
    states: States | None = None
    given: Floats | None = None
    notes: tuple[str, ...] = ()

    @property
    def has_torque(self) -> bool:
        """Whether the true torque is known."""
        return bool(np.isfinite(self.torque_nmm).any())

    @property
    def is_recorded(self) -> bool:
        """Whether it is a laboratory's trial and not an emulated one."""
        return self.states is None

    def __len__(self) -> int:
        return len(self.counts)

    @cached_property
    def tare(self) -> Floats:
        """The board's tare at each frame (n, 19) in counts, in steps of 1/16; NaN until there is one."""
        return np.asarray(self.frames["tare"], np.float64)

    @property
    def signal(self) -> Floats:
        """e (n, 19) in counts above the board's tare; NaN where there is none."""
        known = self.counts != messages.INVALID_COUNT
        result: Floats = np.where(known, self.counts - self.tare, np.nan)
        return result

    @property
    def pressure(self) -> Floats:
        """PDC (n,) in counts above rest; NaN where missing."""
        return np.where(self.pdc != messages.INVALID_COUNT, self.pdc - self.frames["pdc_tare"], np.nan)

    @cached_property
    def frames(self) -> Rows:
        """The board's results in mm, N and N mm (FRAME_DTYPE), a row for each of ``rows``."""
        return to_frames(self.rows)

    @property
    def touched(self) -> Bools:
        """Frames (n,) in which the board reports contact."""
        return np.asarray(self.rows["flags"] & FrameFlags.CONTACT != 0)

    def during(self, phase: Phase) -> Bools:
        """Frames (n,) of a phase while the load is held still."""
        return (self.time_s >= phase.begin_s + SETTLE_S) & (self.time_s < phase.end_s)

    def again(self, settings: Settings) -> Trial:
        """The same counts through a board with other weights and gains, which do not affect the tare."""
        return replace(self, rows=on_board(self.counts, self.pdc, settings, given=self.given))


class Script:
    """The loads on a finger, phase by phase; times in s."""

    def __init__(self) -> None:
        self.track = Track()
        self.phases: list[Phase] = []

    def phase(self, name: str, ramp_s: float, hold_s: float, end: Pose, start: Pose | None = None) -> None:
        """Go straight to ``end`` in ``ramp_s``, then hold it; ``start`` is an unloaded pose to jump to first."""
        self.track.ramp(ramp_s, end, start)
        begin_s = self.track.seconds
        self.track.ramp(hold_s, end)
        self.phases.append(Phase(name, begin_s, self.track.seconds))


def play(name: str, script: Script, *, seed: int, profile: Profile = "new", repeat: int = 0) -> Trial:
    """The trial of an emulated finger that goes through ``script`` and is read by a board.

    ``repeat`` counts how often the same finger was used before: the noise differs, the sensor does not.
    """
    finger = sim.SimFinger(seed, profile)
    finger.seed += _REPEAT_SEED_STEP * repeat  # at this point it only seeds the noise
    frames = round(script.track.seconds / slots.FRAME_S)
    boundary_s: Floats = np.arange(frames + 1, dtype=np.float64) * slots.FRAME_S
    words = sim.sample(finger, script.track.states(boundary_s))
    time_s: Floats = boundary_s[:-1] + slots.FRAME_S / 2.0
    states = script.track.states(time_s)
    counts, pdc = words[:, slots.ELECTRODE_SLOT], words[:, slots.PDC_SLOT]
    force, torque = states.wrench()
    return Trial(
        name=name,
        time_s=time_s,
        phases=tuple(script.phases),
        counts=counts,
        pdc=pdc,
        rows=on_board(counts, pdc),
        force_n=force,
        torque_nmm=torque,
        torsion_nmm=states.torsion_nmm,
        at_mm=np.where(states.force_n[:, None] > 0.0, states.contact_mm, np.nan),
        plate_normal=np.full_like(force, np.nan),
        states=states,
    )


def on_board(counts: Words, pdc: Words, settings: Settings | None = None, *, given: Floats | None = None) -> Rows:
    """A board's rows FINGER_DTYPE (n,); it finds a tare by itself unless it is ``given`` one (19,) before the first."""
    # The papers' own formulas are tested here; the population map is for real fingers on flat plates.
    board = Finger({Setting.FORCE_MODEL: ForceModel.LIN, **(settings or {})})
    if given is not None:
        board.set_tare(given)
    return board.feed(counts, pdc)
