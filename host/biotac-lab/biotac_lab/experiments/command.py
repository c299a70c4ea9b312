"""biotac-lab experiment NAME [RECORDING]"""

from __future__ import annotations

import argparse
import importlib
from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import Any

from biotac import InputError

from ..report import Options, Outcome, Report, Show, check_free

ABOUT = "Repeat a paper's experiment: figure, table against the paper, JSON."
EXAMPLE = "biotac-lab experiment poke --out poked --check"
SEED_MAX = 2**31 - 1
FINGERS = {"index": 0, "middle": 1, "ring": 2, "little": 3, "thumb": 4}
#: A new one is a line here and a module of that name, with `_` for `-`, beside this one.
NAMES = {
    "poke": "point of contact under a 2 mm probe on every electrode (Lin 2013, table 2)",
    "weights": "the default weights of the point of contact, by pokes and by a plate on one page",
    "plate-normal": "normal at the point of contact against a flat plate's",
    "shear": "a weight pushed sideways (Lin 2013, figure 3)",
    "torsion": "a weight turned both ways (Lin 2013, figure 9)",
    "torsion-shear": "a weight turned while it is pushed (Lin 2013, figure 10)",
    "shear-torsion": "shear and torsion at once on held-out places, calibrated against the paper's model",
    "hold": "light holds spliced into presses, against the residue that presses leave",
    "tare": "the paper's renormalisation against the board's tare: slow loads, lock-out, drift (Lin 2013, IV.B)",
    "navarro2015": "pressure calibration and its verification press (Navarro et al. 2015)",
    "wettels2011": "every table and figure on learning point of contact, curvature and force (Wettels and Loeb 2011)",
}


def load(name: str) -> ModuleType:
    """The module of the experiment ``name``, with a function run() from Options to a Report.

    ``RECORDING`` describes the contents of a recording; without it none makes sense. ``ACCEPTS`` are the options among
    ``maps``, ``real``, ``quick`` and ``filter`` that apply, if any do.
    """
    return importlib.import_module(f"{__package__}.{name.replace('-', '_')}")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the experiment, the input, and where the results go."""
    about = "; ".join(f"{name}: {text}" for name, text in NAMES.items())
    parser.add_argument("name", metavar="NAME", choices=list(NAMES), help=about)
    parser.add_argument(
        "recording", metavar="RECORDING", nargs="?", type=Path,
        help="a laboratory's own trial, .npz or .mcap, instead of the emulated finger",
    )  # fmt: skip
    finger = "of an .mcap: a finger's name or its chip select, 0 to 4 (default 0)"
    parser.add_argument("--finger", type=_finger, default=0, help=finger)
    parser.add_argument("--seed", type=int, help="which emulated finger (default 1)")
    many: dict[str, Any] = {"metavar": "FILE", "type": Path, "action": "append", "default": []}
    parser.add_argument("--map", **many, help="also try this .wrench.json beside the paper's model; may be repeated")
    parser.add_argument(
        "--real", **many, help="wettels2011: also try nets on this .npz with its force; may be repeated"
    )
    parser.add_argument("--quick", action="store_true", help="wettels2011: a short run, with worse figures")
    parser.add_argument("--filter", action="store_true", help="wettels2011: with the paper's 3-pole 5 Hz low-pass")
    parser.add_argument("--out", metavar="FOLDER", type=Path, help="NAME.md, NAME.png and NAME.json go here")
    parser.add_argument("--force", action="store_true", help="overwrite existing files")
    parser.add_argument("--check", action="store_true", help="exit 1 when a figure misses its target")


def _finger(text: str) -> int:
    if text not in FINGERS and text not in map(str, FINGERS.values()):
        raise argparse.ArgumentTypeError(f"seen {text!r}; expected one of {', '.join(FINGERS)}, or 0 to 4")
    return FINGERS[text] if text in FINGERS else int(text)


def run(args: argparse.Namespace, show: Show) -> Outcome:
    """Run it, and write it."""
    name, experiment = args.name, load(args.name)
    options = Options(
        finger=args.finger, maps=tuple(args.map), real=tuple(args.real), quick=args.quick, filter=args.filter,
        recording=args.recording, show=show,
    )  # fmt: skip
    accepted = getattr(experiment, "ACCEPTS", ())
    _check(name, hasattr(experiment, "RECORDING"), accepted, options, args.seed)
    if args.out is not None:
        check_free(args.out, name, overwrite=args.force)
    report: Report = experiment.run(replace(options, seed=1 if args.seed is None else args.seed))
    if args.check and not report.checks:
        cure = "give --map FILE" if "maps" in accepted and args.recording is None else "drop --check"
        raise InputError(f"--check: {name} on {report.source} has no figure with a target; {cure}")
    return report.outcome(name, NAMES[name], args.out, overwrite=args.force)


def _check(name: str, has_recordings: bool, accepted: Collection[str], options: Options, seed: int | None) -> None:
    """Raise InputError before seconds of work, not after."""
    if options.recording is not None and not has_recordings:
        raise InputError(f"{name} runs only on the emulated sensor, but got {options.recording}: drop it")
    if options.recording is not None and seed is not None:
        raise InputError("--seed chooses an emulated finger, but a recording is given: drop one of them")
    if seed is not None and not 0 <= seed <= SEED_MAX:
        raise InputError(f"--seed is {seed}: expected 0 to {SEED_MAX}")
    for field, option in (("maps", "map"), ("real", "real"), ("quick", "quick"), ("filter", "filter")):
        if getattr(options, field) and field not in accepted:
            raise InputError(f"{name} does not use --{option}: drop it")
