"""biotac doctor [PORT]"""

from __future__ import annotations

import argparse
import json
import textwrap
from typing import Any

from ...doctor import CATALOGUE, Facts, Finding, judge, udev
from ...doctor.listening import examine
from ...doctor.timing import slots_per_s
from .. import values

EXAMPLE = "biotac doctor --fingers 5"
CODES = f"""
Exit code 0: healthy; 1: there are findings. Their codes are fixed:
{textwrap.fill(" ".join(CATALOGUE), 100, initial_indent="  ", subsequent_indent="  ", break_on_hyphens=False)}"""


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Port, time, and how many sensors there should be."""
    parser.description = f"{parser.description}{CODES}"
    values.add_port(parser)
    parser.add_argument("--seconds", type=values.seconds, default=3.0, help="how long to listen (default 3)")
    parser.add_argument("--fingers", type=int, help="how many sensors there should be (default: those that answer)")


def run(args: argparse.Namespace) -> int:
    """Examine, print the findings, return 1 if there are any."""
    facts = examine(args.port, seconds=args.seconds, expected_fingers=args.fingers)
    findings = judge(facts)
    if args.json:
        print(
            json.dumps({"port": facts.port, "measured": measured(facts), "findings": [as_facts(f) for f in findings]})
        )
    else:
        print_words(facts, findings)
    return 1 if findings else 0


def as_facts(finding: Finding) -> dict[str, str]:
    """For machines."""
    entry = finding.entry
    return {
        "code": finding.code,
        "severity": entry.severity.value,
        "seen": finding.seen,
        "meaning": entry.meaning,
        "cure": entry.cure,
    }


def measured(facts: Facts) -> dict[str, Any]:
    """What was measured, healthy or not; empty when nothing could be."""
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


def print_words(facts: Facts, findings: list[Finding]) -> None:
    """For a person."""
    for finding in findings:
        print(f"{finding.entry.severity.value} {finding.code}: {finding.seen}")
        for title, text in (("meaning", finding.entry.meaning), ("cure", finding.entry.cure)):
            print(textwrap.fill(f"{title}: {text}", 100, initial_indent="    ", subsequent_indent="    "))
        if finding.code == "no_permission":
            print(textwrap.indent(udev.rule(), "    "), end="")
    seen = measured(facts)
    if seen:
        rates = ", ".join(f"finger {f}: {r:.0f} slots a second" for f, r in seen["slots_per_s"].items() if r)
        drift = ""
        if "drift_ppm" in seen:
            drift = f", clock {seen['drift_ppm']:+.0f} ppm, sure to {seen['drift_uncertainty_ppm']:.0f}"
        print(f"measured: {seen['frames']} frames, {rates or 'no rates'}{drift}")
    name = facts.port or "no port"
    print(f"{name}: {len(findings)} finding(s)" if findings else f"{name}: healthy")
