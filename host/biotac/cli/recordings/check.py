"""biotac check REC"""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import asdict
from pathlib import Path

from ...errors import printable
from ...recording.crosscheck import CrossCheck
from .loading import load

EXAMPLE = "biotac check grasp.mcap"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recording."""
    parser.add_argument("recording", metavar="REC", type=Path, help="file written by biotac record")


def run(args: argparse.Namespace) -> int:
    """Return 0 if all that is there is right, 1 for a wrong result, damaged or cut-off data or no frame.

    A recording with gaps is good, with holes that are listed. Raises if it cannot be read (code 2).
    """
    recording = load(args.recording, quiet=True)
    outcome = CrossCheck()
    outcome.add(recording.wire, recording.settings, recording.finger_settings, recording.maps)
    damaged = recording.counts.bad + recording.damaged_chunks + recording.wrong_checksums
    good = outcome.violations == 0 and damaged == 0 and not recording.cut_off and len(recording.frames) > 0
    if args.json:
        facts = {
            "recording": str(args.recording),
            "good": good,
            "frames": len(recording.frames),
            "frames_lost": recording.frames_lost,
            "crc_errors": recording.counts.bad_crc,
            "cut_off": recording.cut_off,
            "gaps": [asdict(gap) for gap in recording.gaps],
            "problems": recording.problems,
            "crosscheck": outcome.as_dict(),
        }
        print(json.dumps(facts))
        return 0 if good else 1
    for problem in recording.problems:
        print(f"biotac: {printable(problem)}", file=sys.stderr)
    for finding in outcome.findings:
        print(finding)
    verdict = "good" if good else f"{outcome.violations} violation(s), {damaged} damaged part(s)"
    verdict += f", {len(recording.gaps)} gap(s)" if recording.gaps else ""
    verdict += ", cut off" if recording.cut_off else ""
    name = printable(str(args.recording))
    print(
        f"{name}: {len(recording.frames)} frames, {recording.frames_lost} lost, {verdict}; largest error "
        f"PoC {outcome.poc_um_max:.3f} um, force {outcome.force_mn_max:.4f} mN, "
        f"torque {outcome.torque_nmm_max:.5f} N*mm, pressure {outcome.pressure.force_n_max * 1e3:.4f} mN"
    )
    if outcome.pressure.starts:
        print(f"  pressure filter not checked in {outcome.pressure.starts} frames that have no frame before them")
    return 0 if good else 1
