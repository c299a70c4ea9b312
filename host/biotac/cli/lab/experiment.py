"""biotac experiment NAME [RECORDING]"""

from __future__ import annotations

import argparse
import contextlib
import json
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...lab.experiments import catalogue
from ...lab.experiments.outcome import Experiment, Facts, Options, markdown, verdicts
from ...partial_file import whole
from ...picture import check_drawable
from ...picture import picture as drawn
from .. import outputs, values
from ..progress import Progress

EXAMPLE = "biotac experiment poke --out poked --check"
SEED_MAX = 2**31 - 1


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the experiment, its input, and where its results go."""
    parser.add_argument(
        "name",
        metavar="NAME",
        choices=list(catalogue.NAMES),
        help="; ".join(f"{name}: {words}" for name, words in catalogue.NAMES.items()),
    )
    parser.add_argument(
        "recording",
        metavar="RECORDING",
        nargs="?",
        type=Path,
        help="a laboratory's own trial, .npz or .mcap, instead of the emulated finger",
    )
    parser.add_argument(
        "--finger", metavar="NAME", type=values.finger, default=0, help="of an .mcap: name or chip select (default 0)"
    )
    parser.add_argument("--seed", type=int, help="which emulated finger (default 1)")
    parser.add_argument(
        "--map",
        metavar="FILE",
        type=Path,
        action="append",
        default=[],
        help="also try this .wrench.json beside the paper's model; may be repeated",
    )
    parser.add_argument(
        "--real",
        metavar="FILE",
        type=Path,
        action="append",
        default=[],
        help="seed000: also try nets on this .npz with its force; may be repeated",
    )
    parser.add_argument("--quick", action="store_true", help="seed000: a short run, with worse figures")
    parser.add_argument("--out", metavar="FOLDER", type=Path, help="NAME.md, NAME.png and NAME.json go here")
    parser.add_argument("--force", action="store_true", help="overwrite existing files")
    parser.add_argument("--check", action="store_true", help="exit 1 when a figure misses its target")


def run(args: argparse.Namespace) -> int:
    """Return 0, or 1 if --check finds a limit missed."""
    experiment = catalogue.load(args.name)
    _check_arguments(args, experiment)
    progress = Progress()
    try:
        seed = 1 if args.seed is None else args.seed
        options = Options(
            seed, args.recording, args.finger, tuple(args.map), tuple(args.real), args.quick, progress.show
        )
        result = experiment.run(options)
        facts = experiment.facts(result)
    finally:
        progress.done()
    if args.check and not facts["checks"]:
        cure = "give --map FILE" if experiment.MAPS and args.recording is None else "drop --check"
        raise InputError(f"--check: {args.name} on {facts['source']} has no figure with a target; {cure}")
    page = experiment.page(facts)
    if args.out is not None:
        facts["written"] = [str(place) for place in _write(args, experiment, result, facts, page)]
    print(json.dumps(facts) if args.json else "\n".join(_lines(facts, page)))
    return 1 if args.check and not all(one["met"] for one in facts["checks"]) else 0


def _check_arguments(args: argparse.Namespace, experiment: Experiment) -> None:
    """Check before seconds of work, not after."""
    if args.recording is not None and not experiment.RECORDING:
        raise InputError(f"{args.name} runs only on the emulated sensor, but got {args.recording}: drop it")
    if args.recording is not None and args.seed is not None:
        raise InputError("--seed chooses an emulated finger, but a recording is given: drop one of them")
    if args.seed is not None and not 0 <= args.seed <= SEED_MAX:
        raise InputError(f"--seed is {args.seed}: expected 0 to {SEED_MAX}")
    if args.map and not experiment.MAPS:
        raise InputError(f"{args.name} does not use a wrench map: drop --map")
    if (args.real or args.quick) and not getattr(experiment, "REAL", False):
        raise InputError(f"{args.name} does not use --real or --quick: drop them")
    if args.out is not None:
        check_drawable()
        outputs.check(args.out, _places(args.out, args.name), overwrite=args.force)


def _places(folder: Path, name: str) -> tuple[Path, Path, Path]:
    return folder / f"{name}.md", folder / f"{name}.png", folder / f"{name}.json"


def _write(
    args: argparse.Namespace, experiment: Experiment, result: Any, facts: Facts, page: list[str]
) -> tuple[Path, ...]:
    outputs.make_folder(args.out)
    places = _places(args.out, args.name)
    with contextlib.ExitStack() as stack:
        text, picture, figures = (stack.enter_context(whole(place, overwrite=args.force)) for place in places)
        title = f"{args.name}: {catalogue.NAMES[args.name]}"
        text.write_text(markdown(title, page, facts, picture.name), encoding="utf-8")
        with drawn(picture) as figure:
            experiment.draw(result, figure)
        figures.write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    return places


def _lines(facts: Facts, page: list[str]) -> list[str]:
    notes = [f"  {note}" for note in facts["notes"]]
    written = [f"  written: {place}" for place in facts.get("written", [])]
    return [f"{facts['experiment']}: {facts['source']}", "", *page, *verdicts(facts), *notes, *written]
