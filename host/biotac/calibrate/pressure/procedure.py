"""The guided sequence: finger by finger, so many presses each. A machine that consumes rows and says what comes next.

It prints nothing, waits for nothing and reads no clock: whoever has rows feeds them, live or from a file, and shows
``step`` to whoever presses. Time is counted in the rows themselves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ...errors import InputError
from ...wire.frames import StructArray
from .plateaus import Phase, Press, Presses, Rest

#: Newtons that are asked for. The paper asks for joint angles of 18, 20 and 22 degrees, "with increasing pressure".
CALIBRATION_FORCES_N = (2.0, 3.5, 5.0)
VERIFICATION_FORCES_N = (4.0,)


@dataclass(frozen=True)
class Step:
    """What is to be done now: ``phase`` of press ``press`` of ``presses``, to about ``force_n``."""

    finger: int
    phase: Phase
    press: int
    presses: int
    force_n: float


class Procedure:
    """``fingers`` in turn, each through a press for every one of ``forces_n``.

    Only the finger whose turn it is is looked at, so the others may do as they like. Raises InputError for no fingers,
    one that occurs twice, or forces that are not above 0.
    """

    def __init__(self, fingers: Sequence[int], forces_n: Sequence[float], *, needs_force: bool = True) -> None:
        if not fingers or len(set(fingers)) != len(fingers):
            raise InputError(f"fingers are {list(fingers)}; expected one or more, each once")
        if not forces_n or not all(0 < force < 100 for force in forces_n):
            raise InputError(f"forces are {list(forces_n)}; expected newtons above 0 and below 100")
        self.forces_n = tuple(float(force) for force in forces_n)
        self.fingers = tuple(fingers)
        self._machines = [Presses(finger, len(self.forces_n), needs_force=needs_force) for finger in fingers]

    @property
    def step(self) -> Step | None:
        """What is to be done now; None when all is."""
        machine = next((m for m in self._machines if m.phase is not Phase.DONE), None)
        if machine is None:
            return None
        number = len(machine.presses) + (machine.phase is not Phase.RELEASE)
        return Step(machine.finger, machine.phase, number, len(self.forces_n), self.forces_n[number - 1])

    @property
    def done(self) -> bool:
        """Every press of every finger was seen."""
        return self.step is None

    @property
    def rests(self) -> dict[int, Rest]:
        """By finger, for those that were at rest."""
        return {m.finger: m.rest for m in self._machines if m.rest is not None}

    @property
    def presses(self) -> dict[int, list[Press]]:
        """By finger, what has been held so far."""
        return {m.finger: list(m.presses) for m in self._machines}

    def feed(self, rows: StructArray) -> None:
        """Take rows (n,) of ROW_DTYPE of any fingers, in the order of time.

        Raises InputError when a finger has waited for a minute of rows in vain, with what was seen.
        """
        for machine in self._machines:
            if machine.phase is Phase.DONE:
                continue
            mine = rows[rows["finger"] == machine.finger]
            taken = machine.feed(mine)
            if not machine.done:
                return
            # The next one begins here, however many rows come at once.
            rows = rows[rows["t_us"] > mine["t_us"][taken - 1]] if taken else rows

    def finish(self) -> None:
        """No more rows come. InputError unless all is done."""
        for machine in self._machines:
            machine.finish()
