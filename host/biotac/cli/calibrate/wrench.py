"""biotac calibrate wrench FILE..."""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
import time
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import biotac

from ...calibrate.population import population_map
from ...calibrate.reference.files import read_reference
from ...calibrate.reference.mounting import read_mounting
from ...calibrate.wrench import figures, report
from ...calibrate.wrench.crossvalidation import WINDOWS_ROWS, Validation, validate
from ...calibrate.wrench.joined import choose_finger
from ...calibrate.wrench.sources import Loaded, Provenance, check_serial, load
from ...calibrate.wrench.upload import upload
from ...errors import InputError
from ...map import file
from ...map.bound import summary, summary_text
from ...partial_file import whole
from ...picture import check_drawable
from ...picture import picture as drawn
from ...wire.identity import ascii_text
from .. import outputs, values
from ..progress import Progress
from . import live as calibrate_live

NAME = "wrench"
HELP = (
    "Counts to force: from a board's recordings with a force/torque sensor's file beside each, or from .npz with E, "
    "F (N), E_base and E_idle; M (N mm) and PDC if there."
)
EXAMPLE = "biotac calibrate wrench thumb.mcap --reference thumb.csv --finger thumb --out calibrated/"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to fit, and from which files."""
    parser.add_argument("files", metavar="FILE", nargs="*", type=Path, help="one finger each, fitted on its own")
    parser.add_argument("--out", metavar="FOLDER", type=Path, help="report (.md, .png) and map (.wrench.json) go here")
    parser.add_argument(
        "--reference", metavar="REF", action="append", default=[],
        help="force of the .mcap at the same place: .csv, or .mcap with WrenchStamped (:TOPIC if many); with --live "
        "netft:HOST (ATI Net F/T), or nano17 (emulated, beside sim:)",
    )  # fmt: skip
    parser.add_argument("--mounting", metavar="M", help="how its sensor is fixed: a .toml, or lin (axes are Lin's)")
    parser.add_argument(
        "--finger", metavar="NAME", type=values.finger, help="of a recording with several: name or chip select"
    )
    parser.add_argument(
        "--population",
        metavar="FILE",
        default=None,
        help="regularize towards this map of other fingers, or none (default: the package's)",
    )
    parser.add_argument("--serial", metavar="BT...", default="", help="refuse data from any other sensor")
    parser.add_argument("--force", action="store_true", help="overwrite existing files; accept another sensor's data")
    live = parser.add_argument_group("guided, on a board")
    live.add_argument(
        "--live", metavar="PORT", help="guided: warm up, tare, load everywhere, fit, upload; Ctrl-C ends the loading"
    )
    live.add_argument("--upload", metavar="PORT", help="upload the map fitted from FILE to this board's finger")
    live.add_argument("--no-upload", action="store_true", help="with --live: leave the board as it is")
    live.add_argument("--save", action="store_true", help="save the map on the board, so that it survives a restart")
    parser.add_argument(
        "--as-recorded", action="store_true", help="do not correct the lag of counts after force, do not smooth counts"
    )


def run(args: argparse.Namespace) -> int:
    """Calibrate from every file, or the finger of a board."""
    if (args.live is None) != bool(args.files):
        raise InputError("expected either FILE... or --live PORT")
    if args.live is not None:
        return _live(args)
    if args.upload is not None and len(args.files) != 1:
        raise InputError(f"--upload with {len(args.files)} files: expected one, the finger's")
    if args.out is not None:
        _check_out(args.out, args.files, overwrite=args.force)
    references = _references(args.files, args.reference)
    mounting = None if args.mounting is None else read_mounting(args.mounting)
    finger = args.finger
    for path in args.files:
        reference = references.get(path)
        beside = None if reference is None else (Path(reference), read_reference(reference, mounting))
        loaded = load(path, beside, finger=finger, serial=args.serial, force=args.force)
        validation, its, facts = _fit(args, loaded)
        if args.upload is not None:
            facts["board"] = _upload(args, finger, loaded, validation, its)
        _tell(args, facts)
    return 0


def _live(args: argparse.Namespace) -> int:
    if args.finger is None:
        raise InputError("--live calibrates one finger: expected --finger NAME")
    if args.out is None:
        raise InputError("--live saves its recording: expected --out FOLDER")
    finger = args.finger
    with calibrate_live.open_board(args) as hand:
        if finger not in hand.fingers:
            raise InputError(f"finger {finger} does not answer: expected one of {hand.fingers}; check its cable")
        places, missing = calibrate_live.record(args, hand, finger)
        for line in missing:
            print(f"biotac: not covered: {line}", file=sys.stderr)
        if not args.force:
            _check_out(args.out, [places.recording], overwrite=False)
        loaded = load(places.recording, (places.reference, read_reference(str(places.reference))), finger=finger)
        validation, its, facts = _fit(args, loaded)
        if not args.no_upload:
            facts["board"] = _put(args, hand, finger, loaded, validation, its)
        _tell(args, facts | {"not_covered": missing})
    return 0


def _upload(
    args: argparse.Namespace, finger: int | None, loaded: Loaded, validation: Validation, its: Provenance
) -> dict[str, Any]:
    with biotac.open(args.upload) as hand:
        if finger is None:
            known = loaded.joined
            finger = known.finger if known is not None else choose_finger(args.upload, hand.fingers, None)
        serial = ascii_text(hand.sensor_info(finger).serial)
        check_serial(f"{loaded.run.name}", its.serial, serial, force=args.force)
        return _put(args, hand, finger, loaded, validation, its)


def _put(
    args: argparse.Namespace,
    hand: biotac.Hand,
    finger: int,
    loaded: Loaded,
    validation: Validation,
    its: Provenance,
) -> dict[str, Any]:
    found = upload(
        hand,
        finger,
        validation.wrench_map,
        loaded.run.counts,
        loaded.run.pdc,
        serial=its.serial,
        made_s=its.made_s,
        force=args.force,
    )
    if args.save:
        hand.save_settings()
    return found | {"saved": args.save}


def _references(files: list[Path], references: list[str]) -> dict[Path, str]:
    recordings = [path for path in files if path.suffix.lower() == ".mcap"]
    if references and len(references) != len(recordings):
        raise InputError(
            f"{len(references)} --reference for {len(recordings)} .mcap recordings: expected one for each, in order"
        )
    return dict(zip(recordings, references, strict=False))


def _fit(args: argparse.Namespace, loaded: Loaded) -> tuple[Validation, Provenance, dict[str, Any]]:
    """Fit, and write the files first: they are safe whatever happens on the board afterwards."""
    progress = Progress()
    try:
        windows = (1,) if args.as_recorded else WINDOWS_ROWS
        # data aligned by their own times leave no lag to search for
        its_own_lag = not args.as_recorded and not loaded.run.by_clocks
        run, others = loaded.run, None
        if args.population != "none":
            trained = population_map.load(None if args.population is None else Path(args.population))
            others, note = trained.others_than(loaded.files)
            run = replace(run, notes=(*run.notes, note))
        validation = validate(run, align=its_own_lag, windows=windows, others=others, show=progress.show)
    finally:
        progress.done()
    its = loaded.provenance(int(time.time()))
    facts = figures.summary(validation) | loaded.facts() | {"serial": its.serial, "data_sha256": its.data_sha256}
    facts["fixed_point"] = summary(validation.wrench_map, validation.run.counts, validation.run.pdc)
    if args.out is not None:
        places = _write(validation, its, loaded.files[0], args.out, overwrite=args.force)
        facts["written"] = [str(place) for place in places]
    return validation, its, facts


def _tell(args: argparse.Namespace, facts: dict[str, Any]) -> None:
    print(json.dumps(facts) if args.json else "\n".join(_lines(facts)))


def _places(folder: Path, path: Path) -> tuple[Path, Path, Path]:
    return folder / f"{path.stem}.md", folder / f"{path.stem}.png", folder / f"{path.stem}.wrench.json"


def _check_out(folder: Path, files: list[Path], *, overwrite: bool) -> None:
    check_drawable()
    outputs.check(folder, [place for path in files for place in _places(folder, path)], overwrite=overwrite)
    outputs.make_folder(folder)


def _write(validation: Validation, its: Provenance, path: Path, folder: Path, *, overwrite: bool) -> tuple[Path, ...]:
    page, picture, its_map = places = _places(folder, path)
    with contextlib.ExitStack() as stack:
        parts = [stack.enter_context(whole(place, overwrite=overwrite)) for place in (page, picture, its_map)]
        parts[0].write_text(report.markdown(validation, picture.name) + _origin(its), encoding="utf-8")
        with drawn(parts[1]) as figure:
            report.draw(validation, figure)
        text = file.dumps_fitted(validation.wrench_map, serial=its.serial, made_s=its.made_s, provenance=asdict(its))
        parts[2].write_text(text, encoding="utf-8")
    return places


def _origin(its: Provenance) -> str:
    rows = [
        ("sensor", its.serial or "not stated in the recording"),
        ("made", f"{its.made}, {its.software}"),
        ("data", f"{', '.join(its.files)}, SHA-256 {its.data_sha256}"),
        ("reference", its.reference),
    ]
    return "\n".join(["", "## Provenance", "", *[f"* {name}: {what}" for name, what in rows], ""])


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
        *(
            [f"  torsion:                RMSE {facts['torsion_rmse_nmm']:5.3f} N mm"]
            if "torsion_rmse_nmm" in facts
            else []
        ),
        f"  Lin's three scales:     RMSE {numbers(facts['models']['lin-scales'][:3])} N",
        f"  counts lag the force by {facts['lag_rows']} rows, {facts['lag_corrected_rows']} corrected; "
        f"mean of {facts['window_rows']} rows",
        f"  untouched:              {numbers(facts['rest_n'][:1])} N",
        f"  {summary_text(facts['fixed_point'])}",
        *[f"  {note}" for note in facts["notes"]],
        *[f"  written: {place}" for place in facts.get("written", [])],
        *(_board_lines(facts["board"]) if "board" in facts else []),
    ]


def _board_lines(its: dict[str, Any]) -> list[str]:
    torque = "" if its["torque_nmm_max"] is None else f", {its['torque_nmm_max']:.4f} N mm"
    kept = "survives a restart" if its["saved"] else "until it restarts; --save keeps it"
    sent = f"all {its['frames_bit_for_bit']} frames it then sent match its map bit for bit"
    if not its["frames_bit_for_bit"]:
        sent = "it sent no frame to compare: the simulated finger's script had ended"
    return [
        f"  on the board, {kept}: {its['bytes']} bytes, read back identical",
        f"  its code on {its['rows']} recorded rows: within {its['force_mn_max']:.3f} mN{torque} of the float model",
        f"  {sent}",
    ]
