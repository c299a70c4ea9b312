"""biotac bench WHAT"""

from __future__ import annotations

import argparse
import json
from collections.abc import Callable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...errors import InputError
from ...lab.bench import batch, decode, idle, imports, live, newtons, recording, timing
from ...picture import check_drawable
from .. import values
from ..progress import Progress

EXAMPLE = "biotac bench batch"
BATCH_FRAMES = 200_000
DECODE_FRAMES = 30_000  # a minute of five fingers
# Upper limits are bounds on memory.
FRAMES = {"batch": (batch.SINGLE_FRAMES, 10_000_000), "decode": (500, 1_000_000)}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to measure, and how much of it."""
    parser.add_argument(
        "what",
        metavar="WHAT",
        choices=list(WHAT),
        help="batch: whole recordings, biotac.compute; decode: the link's bytes to arrays, against pymavlink and "
        "Python; idle: bytes on the link at rest and in contact; imports: what starting costs; "
        "live: reading thread to callback, against a pyserial thread; newtons: cycles of a force against its error on "
        "real fingers; recording: sizes and load times of recordings",
    )
    parser.add_argument(
        "files", metavar="REC", nargs="*", type=Path, help="newtons: fingers on a force plate, as for calibrate wrench"
    )
    parser.add_argument("--picture", metavar="FILE", type=Path, help="newtons: draw it here (.png)")
    parser.add_argument(
        "--frames",
        type=int,
        metavar="N",
        help=f"batch: recording length (default {BATCH_FRAMES}); decode: of five fingers together "
        f"(default {DECODE_FRAMES})",
    )
    parser.add_argument("--source", default="press.toml", help="idle, recording: what to play (default %(default)s)")
    parser.add_argument("--fingers", type=int, default=5, help="recording: how many (default %(default)s)")
    parser.add_argument("--seconds", type=values.seconds, default=600.0, help="recording: device time (default 600)")
    parser.add_argument(
        "--rounds", type=values.count(1_000_000), default=5, metavar="N", help="imports, live: of each (default 5)"
    )


def run(args: argparse.Namespace) -> int:
    """Print the figures and return 0 whatever they are: judging them is up to people."""
    if args.what in FRAMES and args.frames is not None:
        low, high = FRAMES[args.what]
        if not low <= args.frames <= high:
            raise InputError(f"--frames is {args.frames}, expected {low} to {high} for bench {args.what}")
    if args.what != "newtons" and (args.files or args.picture):
        raise InputError(f"bench {args.what} takes no recording and no --picture; drop them")
    measure, show, more = WHAT[args.what]
    outcome = measure(args)
    if args.json:
        facts = outcome if isinstance(outcome, dict) else asdict(outcome)
        print(json.dumps(facts | {name: getattr(outcome, name) for name in more}))
    else:
        show(outcome)
    return 0


def _idle(outcome: idle.Outcome) -> None:
    print(f"{outcome.source}: {'finger time':>14} {'frames':>8} {'heartbeats':>11} {'bytes/s':>9}")
    for name, share in (
        ("in contact", outcome.contact),
        ("at rest, REST_FRAMES", outcome.rest_with_frames),
        ("at rest", outcome.rest_with_heartbeats),
    ):
        print(f"{name:22}{share.seconds:6.2f} s {share.frames:8} {share.heartbeats:11} {share.bytes_per_s:9.0f}")
    print(f"at rest {outcome.saved_percent:.1f} % fewer bytes per second than in contact")
    print("skipped: " + ", ".join(f"{name} {count}" for name, count in outcome.skipped.items()))


def _imports(taken: dict[str, float]) -> None:
    for name, cpu_s in taken.items():
        print(f"{name:30} {cpu_s:6.3f} s CPU  {cpu_s / taken[imports.BASE]:5.2f} of {imports.BASE}")


def _live(outcome: live.Outcome) -> None:
    width = max(len(row.name) for row in outcome.rows)
    print(f"{'frames/s':>8} {'reader':{width}} {'loss':>8} {'worst':>8} {'median us':>10} {'p99 us':>8} {'CPU %':>7}")
    for row in outcome.rows:
        print(
            f"{row.rate:8} {row.name:{width}} {row.loss:8.4%} {row.worst_loss:8.4%} {row.median_us:10.1f} "
            f"{row.p99_us:8.0f} {row.cpu_percent:7.1f}"
        )
    print(f"{outcome.rounds} rounds of {outcome.seconds:g} s in turn, a board with a 16 KiB ring buffer on a pty")
    for asked in live.asked(outcome):
        print(f"{asked.what}: {asked.seen}{_met(asked.met, asked.wanted)}")


def _batch(outcome: batch.Outcome) -> None:
    _rows("ns per frame", outcome.rows)
    print(
        f"{outcome.frames} frames, {batch.ROUNDS} interleaved rounds; NumPy's best block here: {outcome.block} frames"
    )
    _ratios(outcome.ratios)


def _decode(outcome: decode.Outcome) -> None:
    print(
        f"{outcome.seconds:g} s of {decode.FINGERS} fingers, {outcome.messages} FRAMEs and PACs of "
        f"{outcome.bytes_per_message:.0f} bytes each (pymavlink: {outcome.mavlink_bytes_per_message:.0f}); CPU time, "
        f"{decode.ROUNDS} interleaved rounds;\nratios are against the other's better chunk size"
    )
    for result in outcome.results:
        print()
        _rows(f"ns per message, chunks of {result.chunk_bytes} bytes", result.rows)
        _ratios(result.ratios)


def _rows(title: str, rows: list[timing.Row]) -> None:
    width = max(len(title), *(len(row.name) for row in rows))
    print(f"{title:{width}}  {'median':>9} {'min':>9} {'max':>9}")
    for row in rows:
        print(f"{row.name:{width}}  {row.median_ns:9.1f} {row.min_ns:9.1f} {row.max_ns:9.1f}")


def _ratios(ratios: list[timing.Ratio]) -> None:
    for ratio in ratios:
        verdict = "" if ratio.asked is None else _met(ratio.ratio >= ratio.asked, f"{ratio.asked:.0f}x")
        print(f"{ratio.ratio:5.1f}x  {ratio.faster} against {ratio.slower}{verdict}")


def _recording(outcome: recording.Outcome) -> None:
    parts = ", ".join(f"{name} {size / recording.MB:.1f}" for name, size in outcome.mcap_parts.items())
    print(f"{outcome.source}, {outcome.fingers} finger(s), {outcome.seconds:.1f} s, {outcome.frames} frames and PAC")
    print(f"MB: wire {outcome.wire_bytes / recording.MB:.1f}")
    # the limit applies to ten minutes of five fingers
    whole = (outcome.fingers, round(outcome.seconds)) == (5, 600)
    asked = _met(outcome.mcap_bytes <= recording.ASKED_MCAP_MB * recording.MB, "<= 40 MB") if whole else ""
    print(
        f"    MCAP {outcome.mcap_bytes / recording.MB:.1f} ({parts}){asked}\n"
        f"    MCAP with protobuf messages {outcome.protobuf_bytes / recording.MB:.1f}\n"
        f"    entropy floor of the columns {outcome.floor_bytes / recording.MB:.2f}"
    )
    print("CPU s to load to NumPy: " + ", ".join(f"{name} {taken:.3f}" for name, taken in outcome.load_s.items()))
    print(f"{outcome.faster:.1f}x  MCAP wire against protobuf")
    print(f"{outcome.part:.2f}x  one finger's force against all frames")


def _met(met: bool, asked: str) -> str:
    return f" (target {asked}: {'met' if met else 'NOT met'})"


def _record(args: argparse.Namespace) -> recording.Outcome:
    progress = Progress()
    try:
        return recording.measure(args.source, fingers=args.fingers, seconds=args.seconds, show=progress.show)
    finally:
        progress.done()


def _newtons(args: argparse.Namespace) -> dict[str, Any]:
    if args.picture is not None:
        check_drawable()
    progress = Progress()
    try:
        outcome = newtons.measure(args.files, progress.show)
    finally:
        progress.done()
    facts = newtons.facts(outcome)
    if args.picture is not None:
        newtons.draw(outcome, args.picture)
        facts["picture"] = str(args.picture)
    return facts


def _newtons_table(facts: dict[str, Any]) -> None:
    cores = facts["cores"]
    files = list(facts["noise_n"])
    print(f"{'':28}{'knows':26}" + "".join(f"{core:>15}" for core in cores) + "".join(f"{name:>20}" for name in files))
    for point in facts["points"]:
        cycles = "".join(f"{point['cycles'][core]:15,}" for core in cores)
        print(f"{point['name']:28}{point['knows']:26}{cycles}" + _three(point["rmse_n"], files))
    for words, name in (("electrode noise, per frame", "noise_n"), ("same pattern again", "repeatability_n")):
        print(f"{words:{54 + 15 * len(cores)}}" + _three(facts[name], files))
    print("RMSE in x/y/z in N, held out; cycles per force:")
    for core, about in cores.items():
        print(f"  {core}: {about['title']}, {about['cycles_by']}")
    for note in facts["notes"]:
        print(note)


def _three(rmse: dict[str, list[float]], files: list[str]) -> str:
    cells = ("/".join(f"{value:.2f}" for value in rmse[name]) if name in rmse else "-" for name in files)
    return "".join(f"{cell:>20}" for cell in cells)


# How to measure, how to print, and which properties JSON has besides the fields.
WHAT: dict[str, tuple[Callable[[argparse.Namespace], Any], Callable[[Any], None], tuple[str, ...]]] = {
    "batch": (lambda args: batch.measure(args.frames or BATCH_FRAMES), _batch, ()),
    "decode": (lambda args: decode.measure(args.frames or DECODE_FRAMES), _decode, ()),
    "idle": (lambda args: idle.measure(args.source), _idle, ()),
    "imports": (lambda args: imports.measure(args.rounds), _imports, ()),
    "live": (lambda args: live.measure(rounds=args.rounds), _live, ()),
    "newtons": (_newtons, _newtons_table, ()),
    "recording": (_record, _recording, ("faster",)),
}
