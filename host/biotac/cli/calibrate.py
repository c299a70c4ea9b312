"""biotac calibrate WHAT"""

from __future__ import annotations

import argparse
import contextlib
import json
from pathlib import Path
from typing import Any

from ..errors import InputError
from ..export.partial import whole
from ..wrench import board, figures, fitted, report
from ..wrench.crossvalidation import WINDOWS_ROWS, Validation, validate
from ..wrench.recorded import load_run
from .progress import Progress

NAME = "calibrate"
HELP = "Fit a finger's wrench to a force plate, and measure it held out."
EXAMPLE = "biotac calibrate wrench thumb.npz --out calibrated/"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """What to fit, and from which files."""
    what = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    text = "Counts to force, from .npz recordings with E, F (N), E_base and E_idle; M (N mm) and PDC if there."
    wrench = what.add_parser(
        "wrench",
        help=text,
        description=text,
        epilog=f"example: {EXAMPLE}",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    wrench.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help="print JSON, a line a FILE")
    wrench.add_argument("files", metavar="FILE", nargs="+", type=Path, help="one finger each, fitted on its own")
    wrench.add_argument("--out", metavar="FOLDER", type=Path, help="report (.md, .png) and map (.wrench.json) go here")
    wrench.add_argument("--force", action="store_true", help="overwrite what is there")
    wrench.add_argument(
        "--as-recorded", action="store_true", help="do not correct the lag of counts after force, do not smooth counts"
    )


def run(args: argparse.Namespace) -> int:
    """Calibrate every file."""
    if args.out is not None:
        _check_out(args.out, args.files, overwrite=args.force)
    for path in args.files:
        _calibrate(args, path)
    return 0


def _calibrate(args: argparse.Namespace, path: Path) -> None:
    progress = Progress()
    try:
        windows = (1,) if args.as_recorded else WINDOWS_ROWS
        validation = validate(load_run(path), align=not args.as_recorded, windows=windows, show=progress.show)
    finally:
        progress.done()
    facts = figures.summary(validation)
    facts["fixed_point"] = board.summary(fitted.of(validation), validation.run)
    if args.out is not None:
        facts["written"] = [str(place) for place in _write(validation, path, args.out, overwrite=args.force)]
    print(json.dumps(facts) if args.json else "\n".join(_lines(facts)))


def _places(folder: Path, path: Path) -> tuple[Path, Path, Path]:
    return folder / f"{path.stem}.md", folder / f"{path.stem}.png", folder / f"{path.stem}.wrench.json"


def _check_out(folder: Path, files: list[Path], *, overwrite: bool) -> None:
    """Before minutes of work and not after it."""
    places = [place for path in files for place in _places(folder, path)]
    twice = {place for place in places if places.count(place) > 1}
    if twice:
        raise InputError(f"{min(twice)} would be written twice; give files of the same name a folder each")
    for place in places:
        if place.exists() and not overwrite:
            raise InputError(f"{place} exists and would be overwritten; choose another folder or say --force")
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} is no folder ({error.strerror}); choose another name") from error


def _write(validation: Validation, path: Path, folder: Path, *, overwrite: bool) -> tuple[Path, ...]:
    page, picture, its_map = places = _places(folder, path)
    with contextlib.ExitStack() as stack:
        parts = [stack.enter_context(whole(place, overwrite=overwrite)) for place in (page, picture, its_map)]
        parts[0].write_text(report.markdown(validation, picture.name), encoding="utf-8")
        report.draw(validation, parts[1])
        parts[2].write_text(fitted.dumps(fitted.of(validation)), encoding="utf-8")
    return places


def _lines(facts: dict[str, Any]) -> list[str]:
    def numbers(values: list[float | None]) -> str:
        return "  ".join("    -" if value is None else f"{value:5.3f}" for value in values)

    up, down = (f"{counts:+.0f}" for counts in facts["drift_counts"])
    return [
        f"{facts['file']}: {facts['rows']} rows, {facts['model']}",
        f"  held out, x y z:        RMSE {numbers(facts['rmse_n'])} N   R2 {numbers(facts['r2'][:3])}   "
        f"median angle {facts['median_angle_deg']:.2f} deg",
        f"  drifted {up} counts:    RMSE {numbers(facts['drift_rmse_n'][0])} N",
        f"  drifted {down} counts:    RMSE {numbers(facts['drift_rmse_n'][1])} N",
        *([f"  torque, x y z:          RMSE {numbers(facts['rmse_nmm'])} N mm"] if "rmse_nmm" in facts else []),
        f"  Lin's three scales:     RMSE {numbers(facts['models']['lin-scales'][:3])} N",
        f"  counts {facts['lag_rows']} rows after the force, {facts['lag_corrected_rows']} corrected; "
        f"mean of {facts['window_rows']} rows",
        f"  {board.words(facts['fixed_point'])}",
        *[f"  {note}" for note in facts["notes"]],
        *[f"  written: {place}" for place in facts.get("written", [])],
    ]
