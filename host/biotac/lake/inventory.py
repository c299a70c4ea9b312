"""Facts about each board and sensor in a lake, and unusual findings, gathered from its topics with SQL.

A sensor's last recording is compared with its own earlier ones, because no two fingers have the same noise.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable
from dataclasses import asdict, dataclass
from datetime import datetime, timezone
from pathlib import Path
from statistics import fmean, median
from typing import Any

from ..errors import InputError
from ..partial_file import whole
from ..recording.facts import Facts
from ..wire import messages_gen as wire
from ..wire.identity import version_text
from ..wire.sensor_gen import ELECTRODE_NAMES
from .folder import INVENTORY, Lake
from .sql import query

ENOUGH = 3  # earlier recordings needed to know what is usual
BEYOND = 2.0  # more than this many times the worst of them is unusual
DEAD_ROUNDS = 100  # an electrode without a change or value for so long is dead: noise alone moves a working one


@dataclass(frozen=True)
class BoardFacts:
    """Facts about a board. Times are Unix ns; ``frames_lost`` is the sum over its recordings."""

    board: str
    firmware: str  #: of its last recording
    recordings: int
    hours: float
    first_ns: int
    last_ns: int
    frames_lost: int


@dataclass(frozen=True)
class SensorFacts:
    """Facts about a sensor, or a board's finger if its sensor is unknown. None: not known from its last recording."""

    sensor: str | None
    board: str  #: the board it was last on
    finger: int
    recordings: int
    hours: float
    first_ns: int
    last_ns: int
    calibration: str | None  #: id of what was in force last
    calibration_made_ns: int | None
    noise_count: float | None  #: RMS of an electrode at rest
    drift_count: float | None  #: mean distance of the electrodes' tares from the median of its earlier recordings
    residues_per_hour: float  #: presses that left a residue in the skin
    dead: list[str]  #: electrodes without a value, or whose value never changed
    findings: list[str]  #: in words


@dataclass(frozen=True)
class Inventory:
    """Boards and sensors, each sorted by serial number."""

    boards: list[BoardFacts]
    sensors: list[SensorFacts]


@dataclass
class _Round:
    """A finger in one recording."""

    recording: str
    board: str
    finger: int
    sensor: str | None
    calibration: str | None
    begin_ns: int
    hours: float
    rounds: int
    dead: list[str]
    tares: list[float | None]
    noise_count: float | None = None
    residues: int = 0

    @property
    def who(self) -> tuple[str, str, int]:
        """Identity: the sensor on whichever board, or the board's finger if the sensor has no serial number."""
        return (self.sensor, "", 0) if self.sensor else ("", self.board, self.finger)


def take(lake: Lake) -> Inventory:
    """The inventory of all of ``lake``. Raises InputError for damaged files."""
    seals = list(_rows(lake, "SELECT recording, board, begin_ns, duration_s, frames_lost, metadata FROM recordings"))
    seals.sort(key=lambda its: its["begin_ns"])
    strange = {its["recording"] for its in seals} ^ set(lake.partition)
    if strange:
        raise _misplaced(lake, min(strange))
    facts = {its["recording"]: _facts(its) for its in seals}
    rounds = _rounds(lake, {its["recording"]: its for its in seals})
    boards = [_board(mine, facts) for mine in _groups(seals, lambda its: its["board"])]
    sensors = [_sensor(mine, facts) for mine in _groups(rounds, lambda its: its.who)]
    return Inventory(boards, sensors)


def keep(lake: Lake, its: Inventory) -> Path:
    """Write the inventory into the lake as JSON, replacing the previous one."""
    path = lake.folder / INVENTORY
    with whole(path, overwrite=True) as place:
        place.write_text(json.dumps(asdict(its), indent=1) + "\n", encoding="utf-8")
    return path


def _facts(seal: dict[str, Any]) -> Facts:
    try:
        return Facts.read(dict(seal["metadata"]))
    except (KeyError, TypeError, ValueError, AttributeError, RecursionError, OverflowError) as error:
        raise InputError(
            f"the seal of {seal['recording']} is damaged ({error}); export its recording again with --force"
        ) from error


def _misplaced(lake: Lake, recording: str) -> InputError:
    return InputError(
        f"names and contents of files disagree about recording {recording}; list them with "
        f"`biotac lake check {lake.folder}`"
    )


def _rounds(lake: Lake, seals: dict[str, Any]) -> list[_Round]:
    if "frames" not in lake.topics:
        return []
    ranges = ", ".join(f"min(counts_{e}), max(counts_{e})" for e in ELECTRODE_NAMES)
    tares = ", ".join(f"arg_max(tare_{e}, t_us)" for e in ELECTRODE_NAMES)
    made = {}
    for row in _rows(
        lake,
        f"SELECT recording, board, finger, any_value(sensor) AS sensor, any_value(calibration) AS calibration, "
        f"count(*) AS rounds, [{ranges}] AS ranges, [{tares}] AS tares FROM frames GROUP BY recording, board, finger",
    ):
        seal = seals.get(row["recording"])
        if seal is None:
            raise _misplaced(lake, row["recording"])
        ends = row.pop("ranges")
        same = [low == high for low, high in zip(ends[::2], ends[1::2], strict=True)]
        dead = [name for name, its in zip(ELECTRODE_NAMES, same, strict=True) if its and row["rounds"] >= DEAD_ROUNDS]
        made[row["recording"], row["finger"]] = _Round(
            **row, begin_ns=seal["begin_ns"], hours=seal["duration_s"] / 3600, dead=dead
        )
    if "tare" in lake.topics:
        for row in _rows(
            lake,
            f"SELECT recording, finger, arg_max(noise_count2, t_us) AS noise_count2, count(*) FILTER (reason = "
            f"{int(wire.TareReason.RESIDUE)}) AS residues FROM tare GROUP BY recording, finger",
        ):
            its = made.get((row["recording"], row["finger"]))
            if its is not None:
                noise_count2 = row["noise_count2"] or None  # 0 until measured
                its.noise_count = noise_count2 and (noise_count2 / len(ELECTRODE_NAMES)) ** 0.5
                its.residues = row["residues"]
    return sorted(made.values(), key=lambda its: its.begin_ns)


def _board(mine: list[dict[str, Any]], facts: dict[str, Facts]) -> BoardFacts:
    first, last = mine[0], mine[-1]
    return BoardFacts(
        last["board"],
        version_text(facts[last["recording"]].info),
        len(mine),
        sum(its["duration_s"] for its in mine) / 3600,
        first["begin_ns"],
        last["begin_ns"],
        sum(its["frames_lost"] for its in mine),
    )


def _sensor(mine: list[_Round], facts: dict[str, Facts]) -> SensorFacts:
    last, earlier = mine[-1], mine[:-1]
    calibration = facts[last.recording].calibrations.get(last.finger)
    drifts = [_drift_count(its, earlier) for its in mine]
    residues = [its.residues / its.hours if its.hours else 0.0 for its in mine]
    findings = [f"{name} is dead" for name in last.dead]
    findings += _unusual("noise", "counts", [its.noise_count for its in mine])
    findings += _unusual("drift", "counts", drifts)
    findings += _unusual("residue", "per hour", residues)
    return SensorFacts(
        last.sensor,
        last.board,
        last.finger,
        len(mine),
        sum(its.hours for its in mine),
        mine[0].begin_ns,
        last.begin_ns,
        last.calibration,
        calibration.made_s * 10**9 if calibration is not None and calibration.made_s else None,
        last.noise_count,
        drifts[-1],
        residues[-1],
        last.dead,
        findings,
    )


def _drift_count(its: _Round, earlier: list[_Round]) -> float | None:
    """Mean distance of the tares from the median of earlier ones; None if there are none to compare."""
    away = []
    for k, tare in enumerate(its.tares):
        usual = [known for one in earlier if (known := one.tares[k]) is not None]
        if tare is not None and usual:
            away.append(abs(tare - median(usual)))
    return fmean(away) if away else None


def _unusual(what: str, unit: str, values: list[float | None] | list[float]) -> list[str]:
    """A finding in words if the last value far exceeds all earlier ones."""
    *earlier, last = values
    known = [value for value in earlier if value is not None]
    if last is None or len(known) < ENOUGH or last <= BEYOND * max(known):
        return []
    return [f"{what} {last:.1f} {unit}, at most {max(known):.1f} in {len(known)} earlier recordings"]


def _groups(items: list[Any], key: Callable[[Any], Any]) -> Iterable[list[Any]]:
    """Items grouped by key, sorted by key; order within a group is kept."""
    groups: dict[Any, list[Any]] = {}
    for its in items:
        groups.setdefault(key(its), []).append(its)
    return [groups[name] for name in sorted(groups)]


def _rows(lake: Lake, text: str) -> Iterable[dict[str, Any]]:
    names, rows = query(lake, text)
    return (dict(zip(names, row, strict=True)) for row in rows)


def day(at_ns: int) -> str:
    """The day of a Unix time in ns, as text (UTC)."""
    return f"{datetime.fromtimestamp(at_ns // 10**9, timezone.utc):%Y-%m-%d}"
