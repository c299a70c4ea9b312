"""Rest and held contacts in a stream of pressure: rows in, presses out, without look-ahead.

A gain fitted to ramps is wrong by the lag of filter and sensor (+3 % in a test with the paper's filter), so only held
presses count. Held is decided from the pressure alone: over the latest 0.4 s, means over 0.1 s differ by no more than
1 % of the load, or than the noise at rest explains. (Two halves would not do: at the crest of a wave they are equal.)
A press that passes this test changes by at most some 3 % a second, an error of 0.03 % where the filter lags by one row.

Nothing here prints, waits or reads a clock: the caller feeds rows, live or from a file, and shows ``step`` to the
person who presses. Time is counted in rows.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Any

import numpy as np

from ...errors import InputError
from ...wire.frames import StructArray
from .force_source import ROW_DTYPE

HZ = 100
WINDOW_ROWS = 40
REST_ROWS = 50
HOLD_ROWS = 50  # for each press: the paper's n
MOVING_SHARE = 0.01  # of the load
NOISE_SIGMAS = 5.0
SIGMA_FLOOR = 0.25  # counts: words are whole numbers, so a quiet sensor shows less noise than it has
PRESS_COUNTS = 20.0  # above rest: some 0.2 N; the board's own contact needs 6
RELEASE_COUNTS = PRESS_COUNTS / 2
GIVE_UP_ROWS = 60 * HZ


class Phase(Enum):
    """The finger's next state that the procedure waits for."""

    REST = "rest"
    PRESS = "press"
    RELEASE = "release"


@dataclass(frozen=True)
class Rest:
    """An untouched finger: mean and noise of its filtered pressure in counts, over ``rows`` rows."""

    counts: float
    sigma: float
    rows: int


@dataclass(frozen=True)
class Press:
    """One held contact: ``rows`` (n,) of ROW_DTYPE. ``number`` counts a finger's presses of a series from 1."""

    finger: int
    number: int
    rows: StructArray

    @property
    def above_rest(self) -> Any:
        """P - P0 (n,) in counts, with the tare that each frame carries."""
        return self.rows["pressure"] - self.rows["rest"]

    @property
    def force_n(self) -> float:
        """The mean force in N; exactly the scale's, where that is in all rows."""
        force_n = self.rows["force_n"]
        return float(force_n[0] if (force_n == force_n[0]).all() else np.mean(force_n))

    def with_column(self, name: str, values: Any) -> Press:
        """The same press with other values in a column of the rows, such as the one force that a scale showed."""
        rows = self.rows.copy()
        rows[name] = values
        return Press(self.finger, self.number, rows)


def motion(values: Any) -> float:
    """Range of the means of the four quarters of ``values``."""
    return float(np.ptp(np.reshape(values, (4, -1)).mean(axis=1)))


def noise(values: Any) -> float:
    """Standard deviation of the differences between rows, which a moving mean hardly changes; 0 for fewer than three.

    For noise through the filter with alpha = 0.5 it equals that of the values themselves.
    """
    return float(np.diff(values).std()) if len(values) > 2 else 0.0


class Presses:
    """Follows one finger through ``count`` presses and those behind them, row by row; rows are the only clock.

    With ``needs_force``, rows without a reference do not count as held, whatever the pressure does.
    """

    phase: Phase

    def __init__(self, finger: int, count: int, *, needs_force: bool = True) -> None:
        self.finger = finger
        self.rest: Rest | None = None
        self.presses: list[Press] = []
        self._count = count
        self._needs_force = needs_force
        self._window: deque[float] = deque(maxlen=WINDOW_ROWS)
        self._enter(Phase.REST)

    @property
    def done(self) -> bool:
        """Whether every press was seen and released."""
        return self.phase is Phase.PRESS and len(self.presses) >= self._count

    def add(self, row: Any) -> None:
        """Add this finger's next row. Raises InputError with the reason after a minute in one phase, until done."""
        self._waited += 1
        self._follow(row)
        if self._waited >= GIVE_UP_ROWS and not self.done:
            raise InputError(self.why())

    def finish(self) -> None:
        """End: no more rows come. Raises InputError unless every press was seen; the last may still be held."""
        if len(self.presses) < self._count:
            raise InputError(self.why())

    def why(self) -> str:
        """The awaited state and the present one, in numbers."""
        seen = f"finger {self.finger}, {self._waited} rows"
        if self.phase is Phase.REST:
            return (
                f"{seen}: never at rest: at most {self._most_rows} untouched rows in a row, "
                f"{self._moved()}; expected {REST_ROWS}; let go and wait for the tare"
            )
        if self.phase is Phase.RELEASE:
            return f"{seen}: press {len(self.presses)} was not released; expected pressure back at rest; let go"
        which = f"press {len(self.presses) + 1} of {self._count}"
        if self._railed:
            return (
                f"{seen}: {which} was never held: pressure was at the end of its range in {self._railed} rows; "
                "expected none; press less"
            )
        if self._forceless and self._forceless >= self._most_rows:
            return (
                f"{seen}: {which} has no reference: it gave no force in {self._forceless} held rows; expected one "
                "in each; check that it is running, its place and its times"
            )
        if self._most_above < PRESS_COUNTS:
            return (
                f"{seen}: {which} never came: pressure rose by at most {self._most_above:.1f} counts, expected "
                f"{PRESS_COUNTS:g}; press harder, and check that this finger is the one that is pressed"
            )
        return (
            f"{seen}: {which} has no plateau: at most {self._most_rows} held rows in a row, {self._moved()}; expected "
            f"{HOLD_ROWS}; hold still for a second"
        )

    def _moved(self) -> str:
        moved, limit = self._steadiest
        return (
            f"the steadiest moved by {moved:.2f} counts (limit {limit:.2f})" if np.isfinite(moved) else "none was still"
        )

    def _enter(self, phase: Phase) -> None:
        self.phase = phase
        self._begin_again()
        self._waited = self._railed = self._forceless = self._most_rows = 0
        self._most_above = -np.inf
        self._steadiest = (np.inf, 0.0)  # motion, limit

    def _follow(self, row: Any) -> None:
        above = float(row["pressure"] - row["rest"])
        self._railed += bool(row["railed"])
        if np.isnan(above):
            self._begin_again()
            return
        self._most_above = max(self._most_above, above)
        if self.phase is Phase.REST:
            self._resting(row)
        elif self.phase is Phase.PRESS:
            self._pressing(row, above)
        elif above < RELEASE_COUNTS:
            self._enter(Phase.PRESS)

    def _begin_again(self) -> None:
        self._window.clear()
        self._rows: list[Any] = []

    def _is_steady(self, pressure: float, level: float, sigma: float) -> bool:
        """Whether the window is held at ``level`` counts above rest, with noise of ``sigma`` counts."""
        self._window.append(pressure)
        if len(self._window) < WINDOW_ROWS:
            return False
        # Filtered noise is correlated: with alpha = 0.5 a mean scatters sqrt(3) times more than for independent rows.
        scatter = max(sigma, SIGMA_FLOOR) * np.sqrt(3.0 * 2.0 / (WINDOW_ROWS / 4))
        limit = float(max(MOVING_SHARE * abs(level), NOISE_SIGMAS * scatter))
        moved = motion(list(self._window))
        if moved < self._steadiest[0]:
            self._steadiest = (moved, limit)
        return moved <= limit

    def _resting(self, row: Any) -> None:
        if row["touched"]:
            self._begin_again()
            return
        self._rows.append(float(row["pressure"]))
        self._most_rows = max(self._most_rows, len(self._rows))
        sigma = noise(self._rows[-REST_ROWS:])
        if self._is_steady(self._rows[-1], 0.0, sigma) and len(self._rows) >= REST_ROWS:
            self.rest = Rest(float(np.mean(self._rows[-REST_ROWS:])), sigma, REST_ROWS)
            self._enter(Phase.PRESS)

    def _pressing(self, row: Any, above: float) -> None:
        assert self.rest is not None
        if above < PRESS_COUNTS:
            self._begin_again()
            return
        steady = self._is_steady(float(row["pressure"]), above, self.rest.sigma)
        forceless = self._needs_force and np.isnan(row["force_n"])
        self._forceless += bool(steady and forceless)
        if not steady or forceless:
            self._rows = []
            return
        self._rows.append(row)
        self._most_rows = max(self._most_rows, len(self._rows))
        if len(self._rows) == HOLD_ROWS:
            held = np.array(self._rows, ROW_DTYPE)
            self.presses.append(Press(self.finger, len(self.presses) + 1, held))
            self._enter(Phase.RELEASE)


MAX_N = 100.0  # no finger bears more


def _check_forces(forces_n: Sequence[float]) -> None:
    if not forces_n or not all(0 < force < MAX_N for force in forces_n):
        raise InputError(f"forces are {list(forces_n)}; expected newtons above 0 and below {MAX_N:g}")


@dataclass(frozen=True)
class PressStep:
    """The next thing to do: ``phase`` of press number ``press`` of ``presses``, with about ``force_n``."""

    finger: int
    phase: Phase
    press: int
    presses: int
    force_n: float


class Procedure:
    """Leads ``fingers`` in turn through a press for each of the forces of a series, then through the next series.

    Only the finger in turn matters; the others may be touched or not. With ``needs_force``, rows without a reference do
    not count as held. Raises InputError for no fingers, one that occurs twice, no forces, or forces that are not above
    0 and below 100 N.
    """

    def __init__(self, fingers: Sequence[int], *series_n: Sequence[float], needs_force: bool = True) -> None:
        if not fingers or len(set(fingers)) != len(fingers):
            raise InputError(f"fingers are {list(fingers)}; expected one or more, each once")
        for forces_n in series_n:
            _check_forces(forces_n)
        self._turns = [
            (Presses(finger, len(forces_n), needs_force=needs_force), tuple(map(float, forces_n)))
            for forces_n in series_n
            for finger in fingers
        ]

    @property
    def _turn(self) -> tuple[Presses, tuple[float, ...]] | None:
        return next((turn for turn in self._turns if not turn[0].done), None)

    @property
    def step(self) -> PressStep | None:
        """The next thing to do; None when all is done."""
        turn = self._turn
        if turn is None:
            return None
        machine, forces_n = turn
        number = len(machine.presses) + (machine.phase is not Phase.RELEASE)
        return PressStep(machine.finger, machine.phase, number, len(forces_n), forces_n[number - 1])

    @property
    def done(self) -> bool:
        """Whether every press of every finger was seen."""
        return self.step is None

    @property
    def rests(self) -> dict[int, Rest]:
        """Rest before the first press by finger, for those that have been at rest."""
        return {m.finger: m.rest for m, _ in reversed(self._turns) if m.rest is not None}

    @property
    def presses(self) -> dict[int, list[Press]]:
        """Presses held so far, by finger, of all series."""
        found: dict[int, list[Press]] = {}
        for machine, _ in self._turns:
            found.setdefault(machine.finger, []).extend(machine.presses)
        return found

    def asked(self) -> list[tuple[Press, PressStep]]:
        """Every press held so far, and the step that asked for it."""
        return [
            (press, PressStep(press.finger, Phase.RELEASE, press.number, len(forces_n), forces_n[press.number - 1]))
            for machine, forces_n in self._turns
            for press in machine.presses
        ]

    def feed(self, rows: StructArray) -> None:
        """Add rows (n,) of ROW_DTYPE of any fingers, in order of time.

        Raises InputError with the reason when a finger stays in one phase for a minute of rows.
        """
        for row in rows:
            turn = self._turn
            if turn is None:
                return
            if row["finger"] == turn[0].finger:
                turn[0].add(row)

    def finish(self, forces_n: Sequence[float] = ()) -> dict[int, list[Press]]:
        """End: no more rows come. The presses by finger, each with a scale's force in asked()'s order, if given.

        Raises InputError unless every press was seen.
        """
        for machine, _ in self._turns:
            machine.finish()
        if not forces_n:
            return self.presses
        found: dict[int, list[Press]] = {}
        for (press, _), force_n in zip(self.asked(), forces_n, strict=True):
            found.setdefault(press.finger, []).append(press.with_column("force_n", force_n))
        return found


def find(
    finger: int, rows: StructArray, count: int, *, needs_force: bool = False, shown_n: Sequence[float] = ()
) -> tuple[Rest, list[Press]]:
    """A finger's rest and first ``count`` presses in the rows of a recording, each with a scale's force, if given.

    Raises InputError unless every press was seen, and for more presses than ``shown_n``: which of them has none?
    """
    if shown_n:
        _check_forces(shown_n)
    machine = Presses(finger, count, needs_force=needs_force)
    for row in rows:
        if machine.done and not shown_n:
            break
        machine.add(row)
    machine.finish()
    assert machine.rest is not None
    if not shown_n:
        return machine.rest, machine.presses
    if len(machine.presses) > count:
        raise InputError(
            f"finger {finger}: the recording has {len(machine.presses)} presses, {count} readings or weights: "
            "expected one for each; give all of them, or record again"
        )
    shown = zip(machine.presses, shown_n, strict=True)
    return machine.rest, [press.with_column("force_n", force_n) for press, force_n in shown]
