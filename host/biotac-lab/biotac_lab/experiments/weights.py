"""The default weights of the point of contact, decided by pokes and by plates on one page.

A poke asks that the point stays where it is (Lin 2013, table 2), noise and all; a plate, that the point's normal is the
plate's, which no noise but the pattern decides. The board's three kinds of weights stand beside exponents that it does
not have, and beside rules that weigh by noise or choose n by energy. All are in float64 on the same signals above the
board's own tare; the pokes are emulated, the plate is a recording's, or emulated without one.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from biotac import PocWeights
from biotac.core import geometry
from biotac.sim import PROFILES

from ..report import Options, Report, Table, check
from . import laboratory, plate_normal, poke
from .trial import Bools, Floats

RECORDING = plate_normal.RECORDING

NOISE_COUNTS = 5.0  # of a worn finger: the input of a rule that weighs by noise
MORE_NOISE = (10.0, 20.0)  # counts in all, added to the worn finger's
ENERGY_COUNT2 = 1000.0  # Lin 2013: some 0.5 N
WORN_ASKED_MM = 0.36
# a tenth more than compression with n = 1 had on trial_15330, when other rules were tried
PLATE_ASKED_DEG = 1.1 * plate_normal.KNOWN_DEG[PocWeights.COMPRESS_N1][0]
COMPRESSION = "compression, n = {:g}"
DEFAULT = COMPRESSION.format(1.0)


def _soft(e: Floats) -> Floats:
    """The root of the weight c^2 / (c + 3 s) of a compression c: linear beyond noise s, quadratic within."""
    c = np.maximum(-e, 0.0)
    root: Floats = -c / np.sqrt(c + 3.0 * NOISE_COUNTS)
    return root


def _by_energy(e: Floats) -> Floats:
    n = 1.0 + 1.0 / (1.0 + (e**2).sum(axis=1, keepdims=True) / ENERGY_COUNT2)
    weighted: Floats = -(np.maximum(-e, 0.0) ** n)
    return weighted


def _firm(e: Floats) -> Floats:
    return np.minimum(e + 3.0 * NOISE_COUNTS, 0.0)


#: Points (n, 3) of signals (n, 19), by rule.
RULES: dict[str, Callable[[Floats], Floats]] = {
    "all signals, n = 2 (paper)": geometry.point_of_contact,
    "all signals, n = 4": lambda e: geometry.point_of_contact(e, 4.0),
    **{
        COMPRESSION.format(n): lambda e, n=n: geometry.point_of_contact(e, n, compressed=True)  # type: ignore[misc]
        for n in (0.5, 1.0, 1.5, 2.0, 4.0, np.inf)
    },
    "by noise: compression beyond 3 s": lambda e: geometry.point_of_contact(_firm(e), 1.0, compressed=True),
    "by noise: c^2 / (c + 3 s)": lambda e: geometry.point_of_contact(_soft(e), 2.0, compressed=True),
    "n by energy, 2 to 1": lambda e: geometry.point_of_contact(_by_energy(e), 1.0, compressed=True),
}


def run(options: Options) -> Report:
    """One row a rule: pokes on the new and worn finger, with more noise, and angles on the plate."""
    options.show("poking and pressing a plate")
    if options.recording is not None:
        plate = laboratory.load(options.recording, options.finger, needs=("PDC", "z_dir"))
    else:
        plate = plate_normal.emulated(options.seed, "new")
    pokes: dict[str, tuple[Floats, list[Bools]]] = {}
    for profile in PROFILES:
        trial = poke.emulated(options.seed, profile)
        pokes[profile] = trial.signal, poke.contacts(trial)
    signal, contacts = pokes["worn"]
    rng = np.random.default_rng([options.seed, 46])
    for noise in MORE_NOISE:
        more = np.sqrt(noise**2 - NOISE_COUNTS**2)
        pokes[f"noise {noise:g}"] = signal + rng.normal(0.0, more, signal.shape), contacts
    rows: list[list[Any]] = []
    for name, point in RULES.items():
        spreads = {name: poke.spread(point(e), touched) for name, (e, touched) in pokes.items()}
        off = plate_normal.angles_deg(point(plate.signal), plate.plate_normal)
        seen = plate_normal.Angles("plate", poke.SHIPPED, off, plate.touched, plate.pressure)
        angle = seen.over(plate_normal.CONTACT_COUNTS)
        deg = [float(np.median(angle)), float(np.percentile(angle, 90))]
        worn = spreads["worn"]
        rows.append([_called(name), *[float(spread.std_mm.mean()) for spread in spreads.values()],
                     float(worn.bias_mm.mean()), *deg])  # fmt: skip
    default = next(row for row in rows if row[0] == _called(DEFAULT))
    head = ["weights", *[f"std, {name} [mm]" for name in pokes], "bias, worn [mm]", "plate, median [deg]", "90 % [deg]"]
    where = "recorded" if options.recording is not None else "emulated"
    text = (
        f"Pokes: mean standard deviation above {poke.FLOOR_N:g} N, as in table 2 (paper: .227 and .358); the worn "
        f"finger's noise is {NOISE_COUNTS:g} counts, that of real recordings. Plate ({where}): angle to its normal."
    )
    checks = [check("standard deviation, worn, default weights", default[2], WORN_ASKED_MM, "mm")]
    if options.recording is not None:
        checks.append(check("median angle to the plate, default weights", default[-2], PLATE_ASKED_DEG, "deg"))
    source = f"{options.recording or 'emulated plate'}; emulated pokes, seed {1 if options.recording else options.seed}"
    return Report(source, [Table("Weights of the point of contact", head, rows, text)], checks, list(plate.notes),
                  lambda figure: _draw(rows, figure))  # fmt: skip


def _called(name: str) -> str:
    return name + " (default)" if name == DEFAULT else name


def _draw(rows: list[list[Any]], figure: Any) -> None:
    """Each rule as a point: the spread in a poke against the angle on a plate."""
    figure.set_size_inches(9, 6)
    axes = figure.subplots()
    for name, _, worn, *_, median, _ in rows:
        axes.plot(worn, median, "o", color="#c2410c" if name.endswith("(default)") else "#1d4ed8")
        axes.annotate(name, (worn, median), xytext=(5, 3), textcoords="offset points", fontsize=8)
    axes.axvline(WORN_ASKED_MM, color="#111111", linewidth=1, linestyle=":")
    axes.set(xlabel="worn finger's pokes, standard deviation [mm]", ylabel="plate, median angle [deg]", xscale="log")
    axes.grid(alpha=0.25)
