"""biotac doctor [PORT]"""

from __future__ import annotations

import argparse
import json
import platform
import sys
import textwrap
from dataclasses import asdict, is_dataclass
from pathlib import Path
from typing import Any

from ... import extra
from ...doctor import CATALOGUE, ExaminedBoard, Facts, Finding, bringup_report, diagnose, udev
from ...doctor.bringup import Bringup, check, measure
from ...doctor.listening import examine, has_crystal
from ...doctor.timing import slots_per_s
from ...hand.hand import Hand
from ...link.port_text import file_of
from ...partial_file import refuse_source, whole
from ...version import __version__
from .. import values
from ..outputs import report, step

EXAMPLE = "biotac doctor --fingers 5"
PRESS_S, PLAYED_PRESS_S = 20.0, 8.0
CODES = f"""
Exit code 0: healthy; 1: there are findings. Their codes are fixed:
{textwrap.fill(" ".join(CATALOGUE), 100, initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False)}"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.description = f"{parser.description}{CODES}"
    values.add_port(parser)
    parser.add_argument("--seconds", type=values.seconds, default=3.0, help="how long to listen (default 3)")
    parser.add_argument("--sensor-port", metavar="SENSOR", help="a sensor board wired to PORT; needs biotac-rig")
    parser.add_argument(
        "--report",
        metavar="FILE",
        help="also write everything to one JSON file, to attach to a bug report; with --bringup its report instead",
    )
    parser.add_argument(
        "--bringup",
        action="store_true",
        help="measure a new board, its sensors and this computer's USB for a minute, restart it ten times, and write "
        "a report (--report FILE, default bringup.md), with a picture beside it",
    )
    parser.add_argument(
        "--udev-rule",
        choices=("install", "print"),
        help="only install (as root) or print the Linux rule that lets you open boards",
    )
    values.add_take_link(parser)
    parser.add_argument("--fingers", type=int, help="how many sensors to expect (default: those that answer)")


def run(args: argparse.Namespace) -> int:
    """Examine the board and print the findings; return 1 if there are any."""
    if args.udev_rule is not None:
        return udev_rule(args)
    if args.report is not None and args.port is not None:
        refuse_source(Path(args.report), [file_of(args.port)])
    seen = Bringup()

    def first_evening(hand: Hand) -> ExaminedBoard:
        press_s = PRESS_S if has_crystal(hand) and args.sensor_port is None else PLAYED_PRESS_S
        return measure(hand, seen, step, seconds=args.seconds, press_s=press_s)

    how = {"seconds": args.seconds, "take_link": args.take_link, "by": first_evening if args.bringup else None}
    if args.sensor_port is None:
        facts = examine(args.port, expected_fingers=args.fingers, **how)
    else:
        facts = extra.rig("--sensor-port", lambda rig: rig.examine_pair(args.port, args.sensor_port, **how))
    findings = diagnose(facts)
    if args.bringup:
        findings += check(seen, facts)
        bringup_report.write(Path(args.report or "bringup.md"), seen, facts, findings)
    elif args.report is not None:
        with whole(Path(args.report), overwrite=True) as file:
            file.write_text(json.dumps(full_report(facts, findings), indent=1, default=plain))
    report(args, summary(facts, findings), as_text(facts, findings))
    return 1 if findings or facts.board is None else 0


def udev_rule(args: argparse.Namespace) -> int:
    installed, text = args.udev_rule == "install", udev.rule().rstrip()
    if installed:
        udev.install()
        text = f"wrote {udev.RULES}; now run sudo udevadm control --reload, and plug the board in again"
    report(args, {"path": str(udev.RULES), "installed": installed, "rule": udev.rule()}, text)
    return 0


def summary(facts: Facts, findings: list[Finding]) -> dict[str, Any]:
    """The result as JSON types."""
    found = [{"code": f.code, "severity": f.entry.severity, "seen": f.seen} | vars(f.entry) for f in findings]
    return {"port": facts.port, "measured": measured(facts), "findings": found}


def full_report(facts: Facts, findings: list[Finding]) -> dict[str, Any]:
    """The report to send in: the findings and the facts behind them, except the frames."""
    board = facts.board
    return {
        "library": __version__,
        "python": sys.version,
        "computer": platform.platform(),
        **summary(facts, findings),
        "system": vars(facts.system),
        "error": facts.error and str(facts.error),
        "board": {**vars(board), "frames": len(board.frames), "idle": len(board.idle)} if board is not None else {},
        "sensor_board": facts.pair and vars(facts.pair),
    }


def plain(value: object) -> object:
    """A part of the facts as JSON types."""
    return asdict(value) if is_dataclass(value) and not isinstance(value, type) else str(value)


def measured(facts: Facts) -> dict[str, Any]:
    """All measured values, healthy or not; empty if nothing could be measured."""
    board = facts.board
    if board is None:
        return {}
    out: dict[str, Any] = {
        "fingers": board.present,
        "frames": len(board.frames),
        "slots_per_s": {finger: slots_per_s(board, finger) for finger in board.present},
    }
    if board.clock is not None and board.clock.known:
        out["drift_ppm"] = round(board.clock.drift_ppm, 1)
        out["drift_uncertainty_ppm"] = round(board.clock.drift_uncertainty_ppm, 1)
    return out


def as_text(facts: Facts, findings: list[Finding]) -> str:
    lines = []
    for finding in findings:
        lines.append(f"{finding.entry.severity} {finding.code}: {finding.seen}")
        for title, text in (("meaning", finding.entry.meaning), ("cure", finding.entry.cure)):
            lines.append(textwrap.fill(f"{title}: {text}", 100, initial_indent="    ", subsequent_indent="    "))
        if finding.code == "no_permission":
            lines.append(textwrap.indent(udev.rule().rstrip(), "    "))
    if seen := measured(facts):
        rates = ", ".join(f"finger {f}: {r:.0f} samples a second" for f, r in seen["slots_per_s"].items() if r)
        drift = ""
        if "drift_ppm" in seen:
            drift = f", clock {seen['drift_ppm']:+.0f} ppm, +/- {seen['drift_uncertainty_ppm']:.0f}"
        lines.append(f"measured: {seen['frames']} frames, {rates or 'no rates'}{drift}")
    verdict = f"{len(findings)} finding(s)" if findings else "healthy" if facts.board else "not measured"
    return "\n".join([*lines, f"{facts.port or 'no port'}: {verdict}"])
