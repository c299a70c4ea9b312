"""Facts about each board and sensor in a lake, and unusual findings, gathered from its topics with SQL.

A sensor's last recording is compared with its own earlier ones, because no two fingers have the same noise.
"""

from __future__ import annotations

from statistics import fmean, median
from typing import Any

from ..recording.facts import Facts
from ..wire import messages_gen as wire
from ..wire.sensor_gen import ELECTRODE_NAMES
from .folder import Lake
from .sql import rows

ENOUGH = 3  # earlier recordings needed to know what is usual
BEYOND = 2.0  # more than this many times the worst of them is unusual
DEAD_ROUNDS = 100  # an electrode without a change or value for so long is dead: noise alone moves a working one

_BOARDS = """SELECT board, arg_max(metadata['firmware'], begin_ns) AS firmware, count(*) AS recordings,
    sum(duration_s) / 3600 AS hours, min(begin_ns) AS first_ns, max(begin_ns) AS last_ns,
    sum(frames_lost)::BIGINT AS frames_lost FROM recordings GROUP BY board ORDER BY board"""
# A finger in a recording. The sensor is the same one on whichever board; without a serial number, the board's finger.
_FINGERS = f"""SELECT f.*, r.board, r.begin_ns, r.duration_s / 3600 AS hours, {{measured}} FROM (
    SELECT recording, finger, any_value(sensor) AS sensor, any_value(calibration) AS calibration, count(*) AS rounds,
        [{", ".join(f"min(counts_{e}) IS NOT DISTINCT FROM max(counts_{e})" for e in ELECTRODE_NAMES)}] AS constant,
        [{", ".join(f"arg_max(tare_{e}, t_us)" for e in ELECTRODE_NAMES)}] AS tares
    FROM frames GROUP BY recording, finger) f JOIN recordings r USING (recording) {{tare}}
    ORDER BY sensor NULLS FIRST, CASE WHEN sensor IS NULL THEN r.board END, CASE WHEN sensor IS NULL THEN finger END,
        begin_ns"""
_TARE = f"""LEFT JOIN (SELECT recording, finger, nullif(arg_max(noise_count2, t_us), 0) AS noise_count2,
    count(*) FILTER (reason = {int(wire.TareReason.RESIDUE)}) AS residues FROM tare GROUP BY recording, finger) t
    USING (recording, finger)"""


def take(lake: Lake) -> dict[str, list[dict[str, Any]]]:
    """``boards`` and ``sensors``, each sorted by serial number; times are Unix ns. Raises InputError.

    Of a sensor, ``noise_count`` is the RMS of an electrode at rest, ``drift_count`` the mean distance of the
    electrodes' tares from the median of its earlier recordings, ``dead`` are electrodes without a value, or whose value
    never changed, and ``findings`` are for people.
    """
    topics = lake.topics()
    fingers: dict[tuple[Any, ...], list[dict[str, Any]]] = {}
    if "frames" in topics:
        measured = "t.noise_count2, t.residues" if "tare" in topics else "NULL AS noise_count2, NULL AS residues"
        for row in rows(lake, _FINGERS.format(measured=measured, tare=_TARE if "tare" in topics else "")):
            who = (row["sensor"],) if row["sensor"] else (row["board"], row["finger"])
            fingers.setdefault(who, []).append(row)
    return {"boards": rows(lake, _BOARDS), "sensors": [_sensor(lake, of_sensor) for of_sensor in fingers.values()]}


def _sensor(lake: Lake, recordings: list[dict[str, Any]]) -> dict[str, Any]:
    last = recordings[-1]
    dead = last["rounds"] >= DEAD_ROUNDS
    dead_names = [e for e, same in zip(ELECTRODE_NAMES, last["constant"], strict=True) if same and dead]
    noise = [row["noise_count2"] and (row["noise_count2"] / len(ELECTRODE_NAMES)) ** 0.5 for row in recordings]
    drift = [_drift_count(row["tares"], [one["tares"] for one in recordings[:-1]]) for row in recordings]
    residues = [(row["residues"] or 0) / row["hours"] if row["hours"] else 0.0 for row in recordings]
    calibration = None
    if last["calibration"] is not None:
        (found,) = rows(lake, f"SELECT metadata FROM recordings WHERE recording = '{last['recording']}'")
        calibration = Facts.read(found["metadata"]).calibrations.get(last["finger"])
    return {
        "sensor": last["sensor"],
        "board": last["board"],
        "finger": last["finger"],
        "recordings": len(recordings),
        "hours": sum(row["hours"] for row in recordings),
        "first_ns": recordings[0]["begin_ns"],
        "last_ns": last["begin_ns"],
        "calibration": last["calibration"],
        "calibration_made_ns": calibration.made_s * 10**9 if calibration is not None and calibration.made_s else None,
        "noise_count": noise[-1],
        "drift_count": drift[-1],
        "residues_per_hour": residues[-1],
        "dead": dead_names,
        "findings": [f"{name} is dead" for name in dead_names]
        + _unusual("noise", "counts", noise)
        + _unusual("drift", "counts", drift)
        + _unusual("residue", "per hour", residues),
    }


def _drift_count(tares: list[float | None], earlier: list[list[float | None]]) -> float | None:
    """Mean distance of the tares from the median of earlier ones; None if there are none to compare."""
    away = []
    for k, tare in enumerate(tares):
        usual = [known for one in earlier if (known := one[k]) is not None]
        if tare is not None and usual:
            away.append(abs(tare - median(usual)))
    return fmean(away) if away else None


def _unusual(what: str, unit: str, values: list[Any]) -> list[str]:
    """A finding if the last value far exceeds all earlier ones."""
    *earlier, last = values
    known = [value for value in earlier if value is not None]
    if last is None or len(known) < ENOUGH or last <= BEYOND * max(known):
        return []
    return [f"{what} {last:.1f} {unit}, at most {max(known):.1f} in {len(known)} earlier recordings"]
