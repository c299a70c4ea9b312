"""biotac check REC"""

from __future__ import annotations

import argparse
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...calibrate.wrench.share import check_shared
from ...errors import printable
from ...recording.crosscheck import CrossCheck
from ..outputs import note, report
from .loading import load

EXAMPLE = "biotac check grasp.mcap"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("recording", metavar="REC", type=Path, help="file written by biotac record; or shared, .npz")


def run(args: argparse.Namespace) -> int:
    """Return 0 if all results are right, 1 for a wrong result, damaged or cut-off data or no frame.

    A recording with gaps is good, with holes that are listed. Raises if it cannot be read (code 2).
    """
    if args.recording.suffix.lower() == ".npz":
        about = check_shared(args.recording)
        origin = ", ".join(f"{name} {about[name]}" for name in ("sensor", "plate", "licence"))
        report(args, about, printable(f"{args.recording}: {about['rows']} rows, good; {origin}"))
        return 0
    recording = load(args.recording, quiet=True)
    outcome = CrossCheck()
    outcome.add(recording.wire, recording.settings, recording.finger_settings, recording.maps)
    damaged = max(recording.counts.bad + recording.damaged_chunks, len(recording.damage) - recording.cut_off)
    good = outcome.violations == 0 and not recording.damage and len(recording.frames) > 0
    if not args.json:
        for problem in recording.problems:
            note(printable(problem))
    verdict = "good" if good else f"{outcome.violations} violation(s), {damaged} damaged part(s)"
    verdict += f", {len(recording.gaps)} gap(s)" if recording.gaps else ""
    verdict += ", cut off" if recording.cut_off else ""
    starts = f"  {outcome.pressure.starts} frame(s) have no frame before them: their pressure filter was not checked"
    lines = [
        *map(str, outcome.findings),
        f"{printable(str(args.recording))}: {len(recording.frames)} frames, {recording.frames_lost} lost, {verdict}; "
        f"{largest_text(outcome)}, pressure {outcome.pressure.force_n_max * 1e3:.4f} mN",
        *([starts] if outcome.pressure.starts else []),
    ]
    facts = {
        "recording": str(args.recording),
        "good": good,
        "frames": len(recording.frames),
        "frames_lost": recording.frames_lost,
        "crc_errors": recording.counts.bad_crc,
        "rejected": recording.rejected,
        "cut_off": recording.cut_off,
        "gaps": [asdict(gap) for gap in recording.gaps],
        "problems": recording.problems,
        "crosscheck": outcome.as_dict(),
    }
    report(args, facts, "\n".join(lines))
    return 0 if good else 1


def largest_text(outcome: Any) -> str:
    """The largest errors that a cross-check found, for people."""
    return (
        f"largest error PoC {outcome.poc_um_max:.3f} um, force {outcome.force_mn_max:.4f} mN, "
        f"torque {outcome.torque_nmm_max:.5f} N*mm"
    )
