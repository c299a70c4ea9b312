"""biotac calibrate wrench FILE..."""

from __future__ import annotations

import argparse
import contextlib
import math
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import biotac

from ...calibrate import population
from ...calibrate.reference.csv_file import GrowingCsv
from ...calibrate.reference.mounting import Mounting, read_mounting
from ...calibrate.reference.nano17 import Nano17, Nano17Reader
from ...calibrate.reference.samples import SensorReader
from ...calibrate.wrench import figures, report
from ...calibrate.wrench.crossvalidation import WINDOWS_ROWS, Validation, validate
from ...calibrate.wrench.guided import WrenchProcedure, walk
from ...calibrate.wrench.joined import choose_finger
from ...calibrate.wrench.share import share
from ...calibrate.wrench.sources import Loaded, check_serial, load, read_reference
from ...calibrate.wrench.upload import upload
from ...documents import Provenance, made_text
from ...errors import BiotacError, InputError
from ...map.bound import summary, summary_text
from ...map.file import dumps_fitted
from ...partial_file import whole
from ...picture import check_drawable
from ...picture import picture as drawn
from ...sim.source import Source
from ...wire.identity import ascii_text
from .. import outputs, values
from ..progress import Progress

NAME = "wrench"
HELP = (
    "Counts to force: from a board's recordings with a force/torque sensor's file beside each, or from .npz with E, "
    "F (N), E_base and E_idle; M (N mm) and PDC if there."
)
EMULATED = "nano17"
EXAMPLE = "biotac calibrate wrench thumb.mcap --reference thumb.csv --finger thumb --out calibrated/"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("files", metavar="FILE", nargs="*", type=Path, help="one finger each, fitted on its own")
    parser.add_argument("--out", metavar="FOLDER", type=Path, help="report (.md, .png) and map (.wrench.json) go here")
    parser.add_argument(
        "--reference", metavar="REF", action="append", default=[],
        help="force of the .mcap at the same place: .csv, or .mcap with WrenchStamped (:TOPIC if many); with --live a "
        ".csv that the sensor's program is writing, or nano17 (emulated, beside sim:)",
    )  # fmt: skip
    parser.add_argument("--mounting", metavar="M", help="how its sensor is fixed: a .toml, or lin (axes are Lin's)")
    values.add_finger(parser, required=False, text="name or chip select, where a recording has several")
    text = "regularize towards this map of other fingers, or none (default: the package's)"
    parser.add_argument("--population", metavar="FILE", help=text)
    parser.add_argument("--share", metavar="OUT.npz", type=Path, help="also pack the one FILE for others to train with")
    parser.add_argument("--plate", metavar="TEXT", default="", help="with --share: the force sensor's make and number")
    parser.add_argument("--licence", metavar="SPDX", default="", help="with --share: such as CC-BY-4.0")
    parser.add_argument("--serial", metavar="BT...", default="", help="refuse data from any other sensor")
    parser.add_argument("--force", action="store_true", help="overwrite existing files; accept another sensor's data")
    guided = parser.add_argument_group("guided, on a board")
    guided.add_argument(
        "--live", metavar="PORT", help="guided: warm up, tare, load everywhere, fit, upload; Ctrl-C ends the loading"
    )
    guided.add_argument("--upload", metavar="PORT", help="upload the map fitted from FILE to this board's finger")
    guided.add_argument("--no-upload", action="store_true", help="with --live: leave the board as it is")
    values.add_save(guided)
    parser.add_argument(
        "--as-recorded", action="store_true", help="do not correct the lag of counts after force, do not smooth counts"
    )


def run(args: argparse.Namespace) -> int:
    if (args.live is None) != bool(args.files):
        raise InputError("expected either FILE... or --live PORT")
    if args.live is not None:
        return _live(args)
    if args.upload is not None and len(args.files) != 1:
        raise InputError(f"--upload with {len(args.files)} files: expected one, the finger's")
    if args.share is not None and not (len(args.files) == 1 and args.plate and args.licence):
        raise InputError("--share packs one FILE, for others: expected --plate and --licence with it")
    outputs.check_file(args.share, overwrite=args.force)
    if args.out is not None:
        _check_out(args.out, args.files, overwrite=args.force)
        outputs.make_folder(args.out)
    recordings = [path for path in args.files if path.suffix.lower() == ".mcap"]
    if args.reference and len(args.reference) != len(recordings):
        raise InputError(
            f"{len(args.reference)} --reference for {len(recordings)} .mcap recordings: expected one for each, in order"
        )
    references = dict(zip(recordings, args.reference, strict=False))
    mounting = None if args.mounting is None else read_mounting(args.mounting)
    for path in args.files:
        reference = references.get(path)
        beside = None if reference is None else (Path(reference), read_reference(reference, mounting))
        loaded = load(path, beside, finger=args.finger, serial=args.serial, force=args.force)
        facts = _calibrate(args, loaded)
        if args.share is not None:
            with whole(args.share, overwrite=args.force) as target:
                share(loaded.run, target, plate=args.plate, licence=args.licence)
        outputs.report(args, facts, _text(facts))
    return 0


def _live(args: argparse.Namespace) -> int:
    if args.finger is None:
        raise InputError("--live calibrates one finger: expected --finger NAME")
    if args.out is None:
        raise InputError("--live saves its recording: expected --out FOLDER")
    # a simulated board beside an emulated reference runs as fast as the host reads
    with biotac.open(args.live, pace=0.0 if args.reference == [EMULATED] else 1.0) as hand:
        values.check_answers(hand, args.finger)
        path, missing = _record(args, hand, args.finger)
        for line in missing:
            outputs.note(f"not covered: {line}")
        beside = path.with_suffix(".csv")
        loaded = load(path, (beside, read_reference(str(beside))), finger=args.finger)
        facts = _calibrate(args, loaded, None if args.no_upload else hand)
        outputs.report(args, facts | {"not_covered": missing}, _text(facts))
    return 0


def _calibrate(args: argparse.Namespace, loaded: Loaded, hand: biotac.Hand | None = None) -> dict[str, Any]:
    """Fit, and write the files first: they are safe from anything that the board does. All findings as JSON."""
    with Progress() as progress:
        run, others = loaded.run, None
        if args.population != "none":
            trained = population.load(None if args.population is None else Path(args.population))
            others, note = trained.others_than(loaded.files)
            run = replace(run, notes=(*run.notes, note))
        # data aligned by their own times leave no lag to search for
        align = not args.as_recorded and not run.by_clocks
        windows = (1,) if args.as_recorded else WINDOWS_ROWS
        validation = validate(run, align=align, windows=windows, others=others, show=progress.show)
    origin = loaded.provenance(int(time.time()))
    facts = figures.summary(validation) | loaded.facts() | {key: origin[key] for key in ("serial", "data_sha256")}
    bare = biotac.compute(np.rint(run.counts).astype(np.uint16), run.tare)["force_n"]
    facts["verdict"] = _verdict(facts["rmse_n"], figures.rmse(bare, run.truth[:, :3]).tolist())
    facts["fixed_point"] = summary(validation.wrench_map, run.counts, run.pdc)
    if args.out is not None:
        written = _write(validation, origin, loaded.files[0], args.out, overwrite=args.force)
        facts["written"] = [str(path) for path in written]
    with contextlib.ExitStack() as stack:
        finger = args.finger
        if args.upload is not None and args.live is None:
            hand = stack.enter_context(biotac.open(args.upload))
            if finger is None:
                finger = loaded.joined.finger if loaded.joined else choose_finger(args.upload, hand.fingers, None)
            serial = ascii_text(hand.sensor_info(finger).serial)
            check_serial(run.name, origin["serial"], serial, force=args.force)
        if hand is not None:
            made_for = {"serial": origin["serial"], "made_s": origin["made_s"], "force": args.force}
            found = upload(hand, finger, validation.wrench_map, run.counts, run.pdc, **made_for)
            if args.save:
                hand.board.save_settings()
            facts["board"] = found | {"saved": args.save}
    return facts


# ---- guided, on a board ------------------------------------------------------------------------


def _record(args: argparse.Namespace, hand: biotac.Hand, finger: int) -> tuple[Path, list[str]]:
    """Guide through the procedure; return the recording, with the reference's .csv beside it, and the missing parts.

    Raises KeyboardInterrupt, with a message, if it was ended before there was anything to fit.
    """
    serial = ascii_text(hand.sensor_info(finger).serial)
    check_serial(f"finger {finger}", serial, args.serial, force=args.force)
    path = args.out / f"{serial or f'finger{finger}'}.mcap"
    _check_out(args.out, [path], overwrite=args.force)
    recorded = f"the recorded data is in {path} and {path.with_suffix('.csv')}"
    with _reader(args, hand, finger) as (reader, mounting), Progress() as progress:

        def show(event: str) -> None:
            progress.done()
            outputs.note(event)

        outputs.make_folder(args.out)
        procedure = WrenchProcedure(finger, mounting, show)
        try:
            walk(hand, reader, procedure, path, overwrite=args.force, progress=progress.show)
        except (BiotacError, OSError):
            if path.exists():
                outputs.note(recorded)
            raise
    if procedure.zero is None:
        raise KeyboardInterrupt(f"ended while {procedure.last_step.value.partition(':')[0]}; {recorded}")
    return path, procedure.coverage.missing()


@contextlib.contextmanager
def _reader(args: argparse.Namespace, hand: biotac.Hand, finger: int) -> Iterator[tuple[SensorReader, Mounting]]:
    if len(args.reference) != 1:
        raise InputError(f"{len(args.reference)} --reference with --live: expected one, a .csv or {EMULATED}")
    (text,) = args.reference
    mounting = None if args.mounting is None else read_mounting(args.mounting)
    if text != EMULATED:
        with contextlib.closing(GrowingCsv(Path(text), mounting)) as reader:
            yield reader, reader.mounting
    elif isinstance(hand.link.source, Source):
        nano17 = Nano17() if mounting is None else Nano17(mounting)
        yield Nano17Reader(hand.link.source, finger, nano17), nano17.mounting
    else:
        raise InputError(f"{EMULATED} is emulated and works only with a simulated finger: expected --live sim:SCENARIO")


# ---- files and text ----------------------------------------------------------------------------


def _outputs(folder: Path, path: Path) -> tuple[Path, Path, Path]:
    return folder / f"{path.stem}.md", folder / f"{path.stem}.png", folder / f"{path.stem}.wrench.json"


def _check_out(folder: Path, files: list[Path], *, overwrite: bool) -> None:
    check_drawable()
    outputs.check(folder, [out for path in files for out in _outputs(folder, path)], overwrite=overwrite)


def _write(
    validation: Validation, origin: Provenance, path: Path, folder: Path, *, overwrite: bool
) -> tuple[Path, ...]:
    written = _outputs(folder, path)
    with contextlib.ExitStack() as stack:
        page, picture, map_file = (stack.enter_context(whole(out, overwrite=overwrite)) for out in written)
        made_from = [
            f"* sensor: {origin['serial'] or 'not stated in the recording'}",
            f"* software: {origin['software']}, {made_text(origin['made_s'])}",
            f"* data: {', '.join(origin['files'])}, SHA-256 {origin['data_sha256']}",
            f"* reference: {origin['reference']}",
        ]
        text = report.markdown(validation, written[1].name)
        page.write_text("\n".join([text, "## Provenance", "", *made_from, ""]), encoding="utf-8")
        with drawn(picture) as figure:
            report.draw(validation, figure)
        text = dumps_fitted(validation.wrench_map, serial=origin["serial"], made_s=origin["made_s"], provenance=origin)
        map_file.write_text(text, encoding="utf-8")
    return written


def _text(facts: dict[str, Any]) -> str:
    def numbers(values: list[float | None]) -> str:
        return "  ".join("    -" if value is None else f"{value:5.3f}" for value in values)

    up, down = (f"{counts:+.0f}" for counts in facts["drift_counts"])
    lines = [
        f"{facts['file']}: {facts['rows']} rows, {facts['model']}",
        f"  held out, x y z:        RMSE {numbers(facts['rmse_n'])} N   R2 {numbers(facts['r2'][:3])}   "
        f"median angle {facts['median_angle_deg']:.2f} deg",
        f"  drifted {up} counts:    RMSE {numbers(facts['drift_rmse_n'][0])} N",
        f"  drifted {down} counts:    RMSE {numbers(facts['drift_rmse_n'][1])} N",
        *([f"  torque, x y z:          RMSE {numbers(facts['rmse_nmm'])} N mm"] if "rmse_nmm" in facts else []),
        *(f"  torsion:                RMSE {facts[key]:5.3f} N mm" for key in ("torsion_rmse_nmm",) if key in facts),
        f"  Lin's three scales:     RMSE {numbers(facts['models']['lin-scales'][:3])} N",
        f"  counts and force:       {_lag(facts)}; mean of {facts['window_rows']} row(s)",
        f"  untouched:              {numbers(facts['rest_n'][:1])} N",
        f"  {summary_text(facts['fixed_point'])}",
        *[f"  {note}" for note in facts["notes"]],
        *[f"  written: {path}" for path in facts.get("written", [])],
        *(_board_lines(facts["board"]) if "board" in facts else []),
        f"  {facts['verdict']}",
    ]
    return "\n".join(lines)


def _verdict(rmse_n: list[float | None], default_n: list[float]) -> str:
    """Whether the map is better than none on the same rows, and the error to state (x, y, z)."""
    own, default = ("/".join("-" if v is None else f"{v:.2f}" for v in axes) for axes in (rmse_n, default_n))
    against = f"{own} N RMS in x/y/z, held out, against {default} N without a calibration on the same rows"
    if math.hypot(*(math.inf if v is None else v for v in rmse_n)) < math.hypot(*default_n):
        return f"usable: state an error of {against}"
    return f"not worth using: {against}; load it in more places and directions, or leave the finger as it is"


def _lag(facts: dict[str, Any]) -> str:
    lag, corrected = facts["lag_rows"], facts["lag_corrected_rows"]
    if not any(corrected):
        return f"counts lag by {lag} row(s), not corrected" if lag else "in step"
    return f"counts lag by {lag} row(s), corrected by axis: {', '.join(map(str, corrected))}"


def _board_lines(found: dict[str, Any]) -> list[str]:
    torque = "" if found["torque_nmm_max"] is None else f", {found['torque_nmm_max']:.4f} N mm"
    kept = "survives a restart" if found["saved"] else "until it restarts; --save keeps it"
    sent = f"all {found['frames_bit_for_bit']} frames it then sent match its map bit for bit"
    return [
        f"  on the board, {kept}: {found['bytes']} bytes, read back identical",
        f"  its code on {found['rows']} recorded rows: within {found['force_mn_max']:.3f} mN{torque} of the fit",
        *([f"  {sent}"] if found["frames_bit_for_bit"] else []),  # a simulated finger's script has ended by then
    ]
