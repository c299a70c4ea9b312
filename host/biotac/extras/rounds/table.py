"""Rows of a CSV file as messages, by a small TOML file that names the columns."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...cells import numbers
from ...clock.check_times import looks_like
from ...documents import parse_toml, read_text
from ...errors import InputError
from ...wire.identity import SENSOR_SERIAL_BYTES
from ...wire.messages_gen import INVALID_COUNT
from ...wire.sensor_gen import MAX_SENSORS
from .message import Found, Message, RefusedError
from .rate import LEAST_HZ

EXPECTED = 'rate_hz = 100, or time = "t" in seconds; for each finger [[finger]] with electrodes = "E{}" and pdc = "PDC"'
MAX_BYTES = 1 << 30
LATEST_S = 2e9  # of Unix time, in 2033
Floats = NDArray[np.float64]
CHANNELS = ("electrodes", "pdc", "tac", "tdc", "pac")
# A tare needs a finger at rest: so many rows one after the other, in which no electrode strays by more.
REST_ROWS, REST_SD_COUNTS = 30, 8.0


class CsvRows:
    """``path``'s rows; ``columns``: the TOML file, in which ``{}`` stands for 1, 2, 3 (or 0, 1, 2) and so on.

    Raises InputError for a file or a table that cannot be used.
    """

    live = False

    def __init__(self, path: Path, columns: str | None) -> None:
        self._where = f"{path} by {columns}"
        if columns is None:
            raise InputError(
                f"{path}: what are its columns? expected csv:{path.name}?columns=FILE.toml, with {EXPECTED}; "
                "rows must follow one another in time, some of them at rest: one row a grasp has none, and so no tare"
            )
        try:
            facts = parse_toml(read_text(Path(columns), 1 << 16))
            lines = read_text(path, MAX_BYTES).splitlines()
            used = [n for n, line in enumerate(lines) if line.strip() and not line.lstrip().startswith("#")]
            self._lines = [n + 1 for n in used[1:]]  # of each row
            self._delimiter = max(",;\t", key=lines[used[0]].count)
            self._head = [name.strip(' "') for name in lines[used[0]].split(self._delimiter)]
            rate_hz, time, fingers = facts.get("rate_hz"), facts.get("time"), facts.get("finger")
            self._refuse_others(facts, ("rate_hz", "time", "finger"))
            if time is None and (not isinstance(rate_hz, (int, float)) or rate_hz is True or not 0 < rate_hz <= 1e6):
                raise InputError(
                    f"{self._where}: its rows have no time, so none is known to follow another: a tare needs a row at "
                    f"rest, {REST_ROWS} of them, which a table of one row a grasp does not have; expected {EXPECTED}"
                )
            if not isinstance(fingers, list) or not 0 < len(fingers) <= MAX_SENSORS:
                raise InputError(f"{self._where}: no [[finger]]; expected {EXPECTED}")
            for own in fingers:
                self._refuse_others(own, (*CHANNELS, "serial"))
            if not self._lines:
                raise InputError(f"{self._where}: has no rows; expected a recording, with all its rows")
            self._fingers = [{name: self._places(own.get(name)) for name in CHANNELS} for own in fingers]
            self._serials = [str(own.get("serial", "")).encode()[:SENSOR_SERIAL_BYTES] for own in fingers]
            self._rows = self._numbers([lines[n] for n in used[1:]], self._used(time))
        except (OSError, ValueError, IndexError, AttributeError) as error:
            raise InputError(f"{self._where}: cannot be read ({error}); expected numbers, and {EXPECTED}") from error
        every_s = np.arange(len(self._rows)) / (rate_hz or 1.0)
        self._times_s = every_s if time is None else self._rows[:, self._column[self._place(time)]].copy()
        self._check_times()
        # Unix time stays as it is; any other begins with the first row.
        first_s = next((time_s for time_s in self._times_s.tolist() if np.isfinite(time_s)), 0.0)
        self._times_s -= 0.0 if 0 <= first_s < LATEST_S else first_s
        self._rows[np.isnan(self._rows)] = INVALID_COUNT  # a word that is missing
        for f, places in enumerate(self._fingers):
            if not _rests(self._values(places["electrodes"])):
                raise InputError(
                    f"{self._where}: finger {f} has no row at rest: of {len(self._rows)}, no {REST_ROWS} one after the "
                    "other are still, and without them there is no tare; expected a recording, with all its rows"
                )

    def _check_times(self) -> None:
        steps_s = np.diff(self._times_s[np.isfinite(self._times_s)])
        step_s = float(np.median(steps_s)) if len(steps_s) else 0.0
        if not 0.0 < step_s <= 1.0 / LEAST_HZ:
            cure = "reverse the rows" if step_s < 0.0 else looks_like(1.0 / max(step_s, 1e-9), LEAST_HZ, 50_000.0)
            raise InputError(f"{self._where}: its time goes on by {step_s:.4g} from row to row; {cure}")

    def _refuse_others(self, facts: dict[str, Any], known: tuple[str, ...]) -> None:
        if unknown := sorted(set(facts) - set(known)):
            raise InputError(f"{self._where}: unknown key {unknown[0]!r}; expected {', '.join(known)}")

    def _numbers(self, rows: list[str], columns: list[int]) -> Floats:
        """Of ``columns``. Raises ValueError with the line's number in the file."""
        try:
            return numbers(rows, self._delimiter, columns)
        except ValueError as error:
            numbered = re.sub(
                r"row (\d+)( with)?",  # numpy counts from 1 in this one
                lambda at: f"line {self._lines[int(at[1]) - bool(at[2])]}{at[2] or ''}",
                str(error),
            )
            raise ValueError(numbered) from error

    def _place(self, name: Any) -> int:
        if name not in self._head:
            raise InputError(f"{self._where}: no column {name!r}, expected one of {', '.join(self._head)}")
        return self._head.index(name)

    def _places(self, name: Any) -> list[int]:
        """Of the columns of that name, with numbers in place of ``{}``."""
        if name is None:
            return []
        names = [str(name).replace("{}", str(k)) for k in range(100)]
        found = [k for k, column in enumerate(names) if column in self._head] if "{}" in str(name) else []
        if len(found) < 2:
            return [self._place(str(name).replace("{}", "1"))]
        if missing := sorted(set(range(found[0] and 1, found[-1])) - set(found)):
            lacks = ", ".join(names[k] for k in missing)
            raise InputError(f"{self._where}: no column {lacks}, but {names[found[-1]]}; expected all, in their order")
        return [self._place(names[k]) for k in found]

    def _used(self, time: Any) -> list[int]:
        used = {place for own in self._fingers for places in own.values() for place in places}
        every = sorted(used | ({self._place(time)} if time is not None else set()))
        self._column = {place: k for k, place in enumerate(every)}
        return every

    def _values(self, places: list[int], rows: Any = slice(None)) -> Floats:
        columns: Floats = self._rows[rows, [self._column[place] for place in places]]
        return columns

    def __iter__(self) -> Iterator[Message | RefusedError]:
        for k, time_s in enumerate(self._times_s.tolist()):
            try:
                if not 0 <= time_s < LATEST_S:
                    raise RefusedError(f"line {self._lines[k]}: its time is {time_s} s")
                found = Found()
                for f, places in enumerate(self._fingers):
                    electrodes, *slow, pac = (self._values(places[name], k) for name in CHANNELS)
                    pdc, tac, tdc = (word[0] if len(word) else None for word in slow)
                    found.add(f, electrodes, pdc, tac, tdc, pac, self._serials[f])
                yield found.message(round(time_s * 1e9), places=MAX_SENSORS)
            except RefusedError as error:
                yield error


def _rests(counts: Floats) -> bool:
    """Whether REST_ROWS rows one after the other are still; standard deviations by running sums."""
    if len(counts) < REST_ROWS:
        return False
    sums, squares = (np.cumsum(np.pad(power, ((1, 0), (0, 0))), axis=0) for power in (counts, counts**2))
    means, mean_squares = ((s[REST_ROWS:] - s[:-REST_ROWS]) / REST_ROWS for s in (sums, squares))
    return bool((mean_squares - means**2 <= REST_SD_COUNTS**2).all(axis=1).any())
