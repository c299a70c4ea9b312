"""A law's inputs: the plant's own forces, right or wrong by so much, or a board's results."""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress
from typing import Any

import numpy as np

from biotac import Calibration, DeviceLostError, EventKind, Frame, FrameFlags, Trust
from biotac.core import geometry as surface
from biotac.sim import SimFinger, SimTouch, world

from .plant import Plant

TOUCHED_N = 0.05
SLIDES = 100  # the slip level of true slides
FINGERS = {2: ("index", "thumb"), 3: ("thumb", "index", "middle")}
SHARES = {2: (1.0, 1.0), 3: (1.0, 0.5, 0.5)}  # each finger's part of the force on one side: the first is alone
REST_S, TOUCH_S = 7.0, 0.5  # a hand learns the drift, and is touched once, before it grasps
#: The sensor's are of the first finger; the board's and the program's are methods of the world.
SENSOR_FAULTS = {
    "open": "electrode open", "shorted": "electrode shorted", "stuck": "electrode stuck",
    "floating": "electrode floating: walks 20 counts a round", "drifting": "electrode drifts 50 counts/s",
    "noisy": "electrode with noise of 200 counts", "half gain": "electrode at half gain", "flat pressure": "PDC stuck",
    "frozen": "the same words for ever", "shifted": "channels shifted by a slot", "exchanged": "two fingers exchanged",
    "noisy line": "noisy line, 1e-3 a bit",
}  # fmt: skip
BOARD_FAULTS: dict[str, tuple[str, tuple[float, ...]]] = {
    "restart": ("restart", ()), "still program": ("stall_host", (0.5,)), "hang": ("hang", ()),
    "power cut": ("cut_power", (1.0,)), "cable": ("unplug", (1.0,)),
}  # fmt: skip
Felt = tuple[list[Frame | None], bool]


class TrueForce:
    """The plant's forces a round late, ``off_n`` too high, and slides at their onset, as boards report them.

    If it is ``deaf``, no slides.
    """

    def __init__(self, fingers: int, off_n: float = 0.0, deaf: bool = False) -> None:
        self._shares, self._off_n, self._deaf, self._seq = SHARES[fingers], off_n, deaf, 0
        self._last, self._slid = (0.0, 0.0, 0.0, False), False

    def feel(self, plant: Plant) -> Felt | None:
        """Each finger's frame and whether there was a SLIP, of this round; None while the program stands still."""
        normal_n, down_n, across_n, slides = self._last
        self._last = plant.normal_n, *plant.touch(0)[1:3], plant.slip_mm_s > 0
        slipped, self._slid, self._seq = slides and not self._slid and not self._deaf, slides, self._seq + 1
        touched, none, good = normal_n > TOUCHED_N, np.full(3, np.nan), Trust.ACT
        force_n = np.array([across_n, down_n, max(normal_n + self._off_n, 0.0) if touched else 0.0])
        flags = FrameFlags.CONTACT if touched else FrameFlags(0)
        level = SLIDES if slides and not self._deaf else 0
        return [
            Frame(
                k, self._seq, 0, np.zeros(19, np.uint16), 0, 0, 0, none, force_n * share, none, flags,
                trust=good, slip_level=level,
            )
            for k, share in enumerate(self._shares)
        ], slipped  # fmt: skip

    def hold(self, held: bool) -> None:
        """The law begins to hold the thing, or lets go."""

    def fault(self, name: str) -> None:
        """A fault begins."""

    def close(self) -> None:
        """All is over."""


class Board(TrueForce):
    """A hand that rested and was touched once. ``maps`` and ``gains``: the fingers' own, as calibrate() gives them."""

    def __init__(
        self, seeds: list[int], profile: Any, at: str, maps: Mapping[str, str] = {}, gains: Mapping[str, Any] = {}
    ) -> None:
        super().__init__(len(seeds))
        self._names, self._at, self._still = FINGERS[len(seeds)], at, False
        fingers = {name: SimFinger(seed, profile) for name, seed in zip(self._names, seeds, strict=True)}
        self._world = world(fingers, maps={name: bytes.fromhex(text) for name, text in maps.items()})
        self._world.hand.stop()
        for name, gain in gains.items():
            self._world.hand.board.set_calibration(name, Calibration(force_gain_nn=tuple(gain)))
        self._world.hand.stream("force", "poc", "events")  # the law's needs: an interval is one at a contact
        self._world.run(REST_S)
        self._world.run(TOUCH_S, **dict.fromkeys(self._names, SimTouch(normal_n=1.0, at=at)))
        self._world.run(TOUCH_S)

    def feel(self, plant: Plant) -> Felt | None:
        """See TrueForce."""
        loads = {}
        for k, (name, share) in enumerate(zip(self._names, self._shares, strict=True)):
            normal, down, across, torsion = (share * load for load in plant.touch(min(k, 1)))
            shear = across, down if k else -down  # the sides face each other
            loads[name] = SimTouch(normal, shear, self._at, torsion, slip_mm_s=plant.slip_mm_s)
        now = self._world.step(**loads)
        self._still &= now.seq < 0
        if self._still:
            return None
        return [now[name].frame for name in self._names], any(event.kind == EventKind.SLIP for event in now.events)

    def hold(self, held: bool) -> None:
        """See TrueForce."""
        with suppress(DeviceLostError):  # dropped while the board is away
            (self._world.hand.hold if held else self._world.hand.release)(*self._names)

    def fault(self, name: str) -> None:
        """See TrueForce."""
        if name in SENSOR_FAULTS:
            self._world.fault(self._names[0], SENSOR_FAULTS[name])
        else:
            method, values = BOARD_FAULTS[name]
            self._still = name == "still program"
            getattr(self._world, method)(*values)

    def close(self) -> None:
        """See TrueForce."""
        self._world.close()


def towards(at: str) -> Any:
    """Where a thing presses a finger that it meets at this electrode, in the finger's axes."""
    return -surface.normals_at(surface.project(surface.ELECTRODE_MM[[int(at[1:]) - 1]]))[0]
