"""The shear trial: Lin, Fishel and Loeb 2013, figure 3, phases A to G.

A 500 g weight with a flat surface lies on the pad and is pushed by hand towards E11, then towards E1, with about 3 N
each. The paper plots the electrodes and describes their behaviour in words; those words are the checks.
"""

from __future__ import annotations

from functools import partial

from biotac.wire import sensor

from ..report import Facts, Options, Report, Table, claim
from . import weight
from .weight import WEIGHT_N

RECORDING = "E and F"
ACCEPTS = ("maps",)

SHEAR_N = 3.0
HOLD_S = 2.5
LATERAL = ("E1", "E4", "E11", "E14")
MARKED = (*LATERAL, "E17")
PUSHES_N = {"B": 0.0, "C": SHEAR_N, "D": 0.0, "E": -SHEAR_N, "F": 0.0}  # to +y
STEPS = (*[(name, WEIGHT_N, push_n, 0.0) for name, push_n in PUSHES_N.items()], ("G", 0.0, 0.0, 0.0))

#: Figure 3 on an emulated finger.
emulated = partial(weight.emulated, "figure 3", STEPS, HOLD_S)


def run(options: Options) -> Report:
    """Errors, electrodes and forces by phase, and the claims of the paper's caption; emulated, or a recording."""
    result = weight.run(options, emulated, f"pushed with {SHEAR_N:g} N", torque=False)
    title = "Shear trial (Lin 2013, figure 3)"
    if result.trial.is_recorded:
        return result.report([], [], ("Fx", "Fy", "Fz"), title, MARKED)
    held = {phase.name: result.trial.signal[result.trial.during(phase)].mean(axis=0) for phase in result.trial.phases}
    counts = {name: dict(zip(sensor.ELECTRODE_NAMES, e.tolist(), strict=True)) for name, e in held.items()}
    rows = [[phase, *[float(at[name]) for name in MARKED]] for phase, at in counts.items()]
    electrodes = Table("Electrodes of figure 3", ["phase", *MARKED], rows, "Mean counts above tare.", digits=1)
    tables = [electrodes, *weight.means(result, ("Fy", "Fz"))]
    return result.report(tables, claims(counts), ("Fy", "Fz"), title, MARKED)


def claims(counts: dict[str, dict[str, float]]) -> list[Facts]:
    """Figure 3's caption as checks, from mean counts above tare by phase and electrode."""
    towards, away = (
        {name: counts[after][name] - counts[before][name] for name in LATERAL} for before, after in ("BC", "DE")
    )
    opposed = all((move["E1"] > 0) != (move["E11"] > 0) and (move["E4"] > 0) != (move["E14"] > 0)
                  for move in (towards, away))  # fmt: skip
    return [
        claim("E1, E4, E11 and E14 rise in B, as liquid is displaced towards them",
              all(counts["B"][name] > 0 for name in LATERAL)),
        claim("E17, under the weight, is below tare from B to F", all(counts[phase]["E17"] < 0 for phase in "BCDEF")),
        claim("E1 and E4 change in opposite directions in C and E",
              all((towards[name] > 0) != (away[name] > 0) for name in ("E1", "E4"))),
        claim("E11 and E14, on the other side, change the opposite way", opposed),
    ]  # fmt: skip
