"""Real fingers beside simulated ones wherever a plate touched: point of contact, squeezed and bulged counts, force.

Of F1 and F2 the places are the point of contact's, which moves with shear, too; of a plate with a tracked normal they
are the plate's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Protocol

import numpy as np

import biotac
from biotac.core import geometry as surface
from biotac.sim import SimFinger

from ..report import Table
from .plates import (
    LOOK_COUNTS,
    LOOK_FORCES_N,
    LOOK_ROWS,
    PER_N,
    TENTHS,
    Bools,
    Floats,
    KnownForce,
    KnownNormal,
    place_under,
    pressing,
)  # fmt: skip

BANDS_N = ((1.5, 2.5), (3.5, 4.5), (5.5, 6.5))
BANDS_COUNTS = ((80, 200), (200, 400), (400, 800))
LEAST_ROWS = 40
LOOK_ASIDE = 0.2  # of the normal's other part
NEAREST = 6  # electrodes that count as the same place
NEIGHBOURS = np.argsort(np.linalg.norm(surface.ELECTRODE_MM[:, None] - surface.ELECTRODE_MM[None], axis=2), axis=1)


class Pressed(Protocol):
    """Counts (n, 19) of a simulated finger, and the tare (19,)."""

    @property
    def counts(self) -> Floats: ...
    @property
    def tare(self) -> Floats: ...


def by_place(pressed: Sequence[KnownForce], touched: Sequence[Pressed], names: Sequence[str]) -> Table:
    """Squeezed counts and the default map's force over the measured one by place of the point of contact."""
    force_n = [np.concatenate([half.force_n for half in pressed[k : k + 2]]) for k in (0, 2)]
    size_n = [np.linalg.norm(force, axis=1) for force in force_n]
    rows: list[list[Any]] = []
    at = len(size_n[0])
    for k, name in enumerate(names):
        part = slice(0, at) if k == 0 else slice(at, None)
        real = _felt(
            np.concatenate([half.counts for half in pressed[2 * k : 2 * k + 2]]), pressed[2 * k].tare, size_n[k]
        )
        model = [_felt(finger.counts[part], finger.tare, size_n[k]) for finger in touched]
        for key, (squeezed, share, n) in real.items():
            fingers = [finger[key][:2] for finger in model if key in finger]
            if fingers:
                median_squeezed, median_share = np.median(fingers, axis=0)
                rows.append([name, *key, n, squeezed, median_squeezed, share, median_share])
    head = ["finger", "point of contact", "N", "rows", "squeezed", "simulated", "felt over true", "simulated "]
    text = "Simulated: the median finger, pressed where the fit says. Squeezed are counts below the tare, summed."
    return Table("By place of the point of contact", head, rows, text, digits=2)


def _felt(counts: Floats, tare: Floats, size_n: Floats) -> dict[tuple[str, str], tuple[float, float, int]]:
    found = biotac.compute(np.clip(np.rint(counts), 0.0, 4095.0).astype(np.uint16), tare)
    point, felt_n = found["poc_mm"] / surface.RADIUS_MM, np.linalg.norm(found["force_n"], axis=1)
    squeezed = np.maximum(tare - counts, 0.0).sum(axis=1)
    table = {}
    for place, placed in places_of_points(np.abs(point[:, 1]), np.maximum(point[:, 0], 0.0)).items():
        for low, high in BANDS_N:
            rows = placed & (size_n >= low) & (size_n < high) & np.isfinite(felt_n)
            if rows.sum() >= LEAST_ROWS // 4:  # the rows here are a tenth of the recording's
                share = float(np.median(felt_n[rows] / size_n[rows]))
                table[place, f"{low:g} to {high:g}"] = float(np.median(squeezed[rows])), share, int(rows.sum())
    return table


def places_of_points(ny: Floats, nx: Floats) -> Mapping[str, Bools]:
    """Rows by the place of the point of contact, with these coordinates over the radius."""
    flank = nx < 0.1
    return {
        "pad": (ny < 0.2) & (nx < 0.05),
        "flank .2-.35": (ny >= 0.2) & (ny < 0.35) & flank,
        "flank .35-.5": (ny >= 0.35) & (ny < 0.5) & flank,
        "flank .5-.65": (ny >= 0.5) & (ny < 0.65) & flank,
        "flank > .65": (ny >= 0.65) & flank,
        "tip .1-.4": (nx >= 0.1) & (nx < 0.4) & (ny < 0.3),
        "tip > .4": (nx >= 0.4) & (ny < 0.4),
    }


def places_of_normals(normal: Floats) -> Mapping[str, Bools]:
    """Rows by the plate's unit normal (n, 3)."""
    nx, ny = normal[:, 0], np.abs(normal[:, 1])
    return {
        "pad": (ny < 0.2) & (np.abs(nx) < 0.2),
        "flank .2-.4": (ny > 0.2) & (ny < 0.4) & (np.abs(nx) < 0.3),
        "flank .4-.6": (ny > 0.4) & (ny < 0.6) & (np.abs(nx) < 0.3),
        "very side > .75": ny > 0.75,
        "tip .25-.45": (nx > 0.25) & (nx < 0.45) & (ny < 0.25),
        "tip .45-.7": (nx > 0.45) & (nx < 0.7) & (ny < 0.25),
        "tip > .7": (nx > 0.7) & (ny < 0.3),
    }


def tables(name: str, plate: KnownNormal, fingers: Sequence[SimFinger]) -> list[Table]:
    """A plate of known normal on a real finger, and the results of ``fingers`` under the same plates."""
    signals = [signal_under(finger, plate) for finger in fingers]
    return [_points(name, plate, fingers), _cells(name, plate, signals), _deepest(name, plate, signals)]


def signal_under(finger: SimFinger, plate: KnownNormal) -> Floats:
    """Counts (n, 19) above rest of a finger under the plates.

    A finger with more pressure for a newton is pressed less until it has the recorded pressure.
    """
    force_n = plate.force_n / finger.pressure_gain
    signal: Floats = finger.counts(pressing(plate.place, force_n)) - finger.rest_counts(np.zeros(1))
    return signal


def _points(name: str, plate: KnownNormal, fingers: Sequence[SimFinger]) -> Table:
    """Where the point of contact lies, over the radius, by the normal of the plate."""
    real = surface.point_of_contact(plate.signal, 1.0, compressed=True) / surface.RADIUS_MM
    rows: list[list[Any]] = []
    for axis, k, other in (("ny", 1, 0), ("nx", 0, 1)):
        normal, seen = np.abs(plate.normal[:, 1]) if k else plate.normal[:, 0], real[:, k]
        for low in TENTHS:
            tenth = (normal >= low) & (normal < low + 0.1) & (np.abs(plate.normal[:, other]) < LOOK_ASIDE)
            tenth &= plate.pressure > LOOK_COUNTS
            if tenth.sum() < LOOK_ROWS:
                continue
            median = np.nanmedian(np.abs(seen[tenth]) if k else np.maximum(seen[tenth], 0.0))
            rows.append([f"{axis} {low:.1f}", int(tenth.sum()), median, *points_seen(fingers, k, low + 0.05)])
    text = (
        "The plate's normal to a side (ny) and to the tip (nx); simulated: the median finger in the mid of the tenth."
    )
    return Table(
        f"Point of contact over the radius: {name}",
        ["normal from", "rows", name, "2 N", "4 N", "6 N"],
        rows,
        text,
        digits=2,
    )


def points_seen(fingers: Sequence[SimFinger], k: int, at: float) -> list[float]:
    """The median point of contact of fingers under a plate of that normal, by LOOK_FORCES_N."""
    place = np.tile(place_under(at, sideways=k == 1), (len(LOOK_FORCES_N), 1))
    states = pressing(place, np.array(LOOK_FORCES_N))
    signals = [finger.counts(states) - finger.rest_counts(np.zeros(1)) for finger in fingers]
    points = (
        np.array([surface.point_of_contact(signal, 1.0, compressed=True)[:, k] for signal in signals])
        / surface.RADIUS_MM
    )
    medians: list[float] = np.nanmedian(np.abs(points) if k else np.maximum(points, 0.0), axis=0).tolist()
    return medians


def _cells(name: str, plate: KnownNormal, signals: Sequence[Floats]) -> Table:
    """Squeezed counts for each count of pressure, and bulged over squeezed, by place and pressure."""
    rows: list[list[Any]] = []
    for place, placed in places_of_normals(plate.normal).items():
        for low, high in BANDS_COUNTS:
            cell = placed & (plate.pressure >= low) & (plate.pressure < high)
            if cell.sum() < LEAST_ROWS:
                continue
            real = squeezed_and_bulged(plate.signal[cell], plate.pressure[cell])
            model = np.array([squeezed_and_bulged(signal[cell], plate.pressure[cell]) for signal in signals])
            rows.append([place, f"{low} to {high}", int(cell.sum())])
            for k in (0, 1):
                rows[-1] += [real[k], *np.percentile(model[:, k], (50, 5, 95))]
    each = ["simulated", "5 %", "95 %"]
    head = ["plate", "PDC", "rows", "squeezed per PDC", *each, "bulged over squeezed", *(f"{word} " for word in each)]
    text = (
        "Simulated: medians of the fingers at the same pressure. On the pad a newton makes "
        f"{PER_N:g} counts of pressure in the middle finger, and more or fewer in others, as drawn."
    )
    return Table(f"Counts by place and pressure: {name}", head, rows, text, digits=2)


def squeezed_and_bulged(signal: Floats, pressure: Floats) -> tuple[float, float]:
    squeezed, bulged = np.maximum(-signal, 0.0).sum(axis=1), np.maximum(signal, 0.0).sum(axis=1)
    return float(np.median(squeezed / pressure)), float(np.median(bulged / np.maximum(squeezed, 1.0)))


def _deepest(name: str, plate: KnownNormal, signals: Sequence[Floats]) -> Table:
    """How often the deepest electrode is the real one or one of the nearest, of presses that nothing was fitted to."""
    rows = plate.judging
    real = plate.signal[rows].argmin(axis=1)
    near = NEIGHBOURS[:, : NEAREST + 1]
    share = [float((near[real] == signal[rows].argmin(axis=1)[:, None]).any(axis=1).mean()) for signal in signals]
    low, median, high = np.percentile(share, (5, 50, 95))
    head = ["rows", "the same or one of six nearest", "5 %", "95 %"]
    return Table(f"Deepest electrode: {name}, every second press", head, [[len(rows), median, low, high]], digits=2)
