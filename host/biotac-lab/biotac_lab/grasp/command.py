"""biotac-lab grasp"""

from __future__ import annotations

import argparse
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np

from biotac import InputError
from biotac.sim import PROFILES

from ..report import Facts, Outcome, Report, Show, Table, check, check_free, claim
from . import picture, runs
from .felt import BOARD_FAULTS, SENSOR_FAULTS
from .runs import CONTROLLERS, PLANTS, TRUE, Case

ABOUT = "Grip, lift and let go of things by what the fingers feel, and count what is dropped and crushed."
EXAMPLE = "biotac-lab grasp --objects 20 --out gripped"
NAME = "grasp"
FAULTS = (*SENSOR_FAULTS, *BOARD_FAULTS)
HEAD = ("plant", "controller", "fingers", "fault", "n", "dropped %", "crushed %", "lost %", "more lost", "hold / need",
        "slides", "missed", "SLIPs", "used", "false", "reaction ms", "felt - applied N")  # fmt: skip
TRUE_PERCENT, WORSE_POINTS, CONSTANT_PERCENT = 10.0, 10.0, 25.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the controllers, things and faults to try, and the output."""
    about = "; ".join(f"{name}: {text}" for name, text in CONTROLLERS.items())
    count: dict[str, Any] = {"metavar": "N", "type": _count}
    parser.add_argument("--objects", **count, default=6, help="things for each pair (default 6)")
    parser.add_argument("--seed", **count, default=7, help="of the things (default 7)")
    parser.add_argument("--pairs", **count, default=1, help="pairs of fingers, with things of their own (default 1)")
    parser.add_argument("--jobs", **count, default=1, help="processes (default 1)")
    some: dict[str, Any] = {"metavar": "NAME,...", "type": lambda text: text.split(",")}
    parser.add_argument("--controllers", **some, default=list(CONTROLLERS), help=about)
    parser.add_argument("--fault", **some, default=[], help=f"on boards, in mid-grasp: {', '.join(FAULTS)}, or all")
    parser.add_argument("--profile", **some, default=["new"], help="fingers: new, worn")
    parser.add_argument("--at", **some, default=["E17"], help="electrodes at which fingers are touched (default E17)")
    parser.add_argument("--fingers", type=int, choices=(2, 3), default=2, help="a third shares a side")
    parser.add_argument("--plant", **some, default=["numpy"], help=f"what simulates the things: {', '.join(PLANTS)}")
    parser.add_argument("--lag-ms", **count, help="of the actuators (default: 20; lagging: 12 to 30, by thing)")
    parser.add_argument("--law", metavar="FILE", type=Path, help="a law in place of biotac.grip")
    parser.add_argument("--out", metavar="FOLDER", type=Path, help="grasp.md, .png, .json and grasps.jsonl go here")
    parser.add_argument("--force", action="store_true", help="overwrite the first three; the last one is gone on with")
    parser.add_argument("--check", action="store_true", help="exit 1 when the experiment cannot tell good from bad")


def _count(text: str) -> int:
    if not text.isdigit() or not 1 <= int(text) <= 1_000_000:
        raise argparse.ArgumentTypeError(f"seen {text!r}; expected 1 to 1000000")
    return int(text)


def run(args: argparse.Namespace, show: Show) -> Outcome:
    """Grasp, and write it."""
    args.fault = list(FAULTS) if args.fault == ["all"] else args.fault
    electrodes = [f"E{k}" for k in range(1, 20)]
    some = {"controllers": CONTROLLERS, "fault": FAULTS, "profile": PROFILES, "at": electrodes, "plant": PLANTS}
    for option, known in some.items():
        unknown = sorted(set(getattr(args, option)) - set(known))
        if unknown:
            raise InputError(f"--{option} has {', '.join(unknown)}; expected some of {', '.join(known)}")
    if args.out is not None:
        check_free(args.out, NAME, overwrite=args.force)
        args.out.mkdir(parents=True, exist_ok=True)
    hands, code = list(product(args.profile, args.at)), runs.digest(args.law)
    cases = [
        Case(name, fault, pair, args.seed, plant, args.fingers, *hand, code, args.lag_ms)
        for plant in args.plant
        for name in args.controllers
        for hand in (hands[:1] if name in TRUE else hands)
        for fault in ("", *([] if name in TRUE else args.fault))
        for pair in range(args.pairs)
    ]
    kept = None if args.out is None else args.out / "grasps.jsonl"
    outcomes = runs.run(cases, args.objects, args.law, args.jobs, kept, show)
    report = _report({case: [outcomes[case, k] for k in range(args.objects)] for case in cases})
    report = replace(report, draw=partial(picture.draw, cases=cases, outcomes=outcomes, law_file=args.law))
    return report.outcome(NAME, ABOUT, args.out, overwrite=args.force)


def _report(outcomes: dict[Case, list[Facts]]) -> Report:
    together: dict[Case, list[Facts]] = {}
    for case, rows in outcomes.items():
        together.setdefault(replace(case, pair=0), []).extend(rows)
    lost = {case: _percent([row["dropped"] or row["crushed"] for row in rows]) for case, rows in together.items()}
    lines, plain = [], {case: percent for case, percent in reversed(lost.items()) if not case.fault}
    for case, rows in together.items():
        more = (lost[case] - lost[replace(case, fault="")]) * len(rows) / 100
        hand = "-" if case.controller in TRUE else f"{case.profile}, {case.at}"
        head = case.plant, CONTROLLERS[case.controller], hand, case.fault or "-", len(rows)
        parts = [_percent([row[name] for row in rows]) for name in ("dropped", "crushed")]
        lines.append((*head, *parts, lost[case], round(more) if case.fault else None, *_figures(rows)))
    checks = []
    for plant in dict.fromkeys(case.plant for case in together):
        by_name = {case.controller: percent for case, percent in plain.items() if case.plant == plant}
        checks += [check(f"{plant}: true force loses", by_name["true"], TRUE_PERCENT, "%")] if "true" in by_name else []
        for name, least in (("low", WORSE_POINTS), ("high", WORSE_POINTS), ("constant", CONSTANT_PERCENT)):
            if {"true", name} <= set(by_name):
                least += 0.0 if name == "constant" else by_name["true"]
                text = f"{plant}: {CONTROLLERS[name]} loses {by_name[name]:.1f} %, at least {least:.1f}"
                checks.append(claim(text, by_name[name] >= least))
    case, rows = next(iter(outcomes.items()))
    lag = "" if case.lag_ms is None else f", actuators that lag by {case.lag_ms} ms"
    source = f"{len(rows)} things of seed {case.seed} for each pair of fingers{lag}"
    return Report(source, [Table("Lost", HEAD, lines, digits=2)], checks, [], lambda figure: None)


def _percent(hits: list[bool]) -> float:
    return 100.0 * float(np.mean(hits))


def _figures(rows: list[Facts]) -> list[Any]:
    def middle(values: list[Any]) -> float | None:
        known = [value for value in values if value is not None]
        return float(np.median(known)) if known else None

    counts = [sum(row[name] for row in rows) for name in ("slides", "missed", "reported", "used", "false")]
    reactions = [ms for row in rows for ms in row["reaction_ms"]]
    return [middle([r["hold_per_need"] for r in rows]), *counts, middle(reactions), middle([r["off_n"] for r in rows])]
