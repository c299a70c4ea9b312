"""biotac stream PORT"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Iterator

import biotac

from ...wire.events import event_age_s, kind_name
from ...wire.fields import INVALID_U32
from ...wire.fields import as_json as row_as_json
from ...wire.frames import Frame, trust_of
from ...wire.messages_gen import INVALID_COUNT, BoardKind, Event, EventKind, FrameFlags
from ...wire.slots import FRAME_HZ
from .. import values
from ..outputs import note

EXAMPLE = "biotac stream sim:press.toml --rate 5"
COLUMNS = 100  # of a line


def add_arguments(parser: argparse.ArgumentParser) -> None:
    values.add_port(parser)
    parser.add_argument("--seconds", type=values.seconds, help="stop after this much device time")
    parser.add_argument(
        "--rate", type=values.rate, default=10.0, help="lines per second and finger (default 10; 0: all)"
    )
    parser.add_argument(
        "--events", action="store_true", help="also print a line for each touch, lift, jolt, slip and change of trust"
    )
    parser.add_argument(
        "--touched", action="store_true", help="only fingers that are touched; the others send heartbeats"
    )


def run(args: argparse.Namespace) -> int:
    """Print until the time is over, the source ends or Ctrl-C."""
    # For people watching, simulated boards run in real time here.
    with biotac.open(args.port, pace=1.0) as hand:
        earlier = hand.warnings
        for warning in earlier:
            note(warning.text)
        hand.stream("results", *(["events"] if args.events else []), rest=not args.touched)
        show(hand, rate=args.rate, seconds=args.seconds, events=args.events, as_json=args.json)
        for warning in hand.warnings:
            if warning not in earlier:
                note(warning.text)
        report_lost(hand)
    return 0


def batches(
    hand: biotac.Hand, seconds: float | None, every_s: float | None = None
) -> Iterator[tuple[biotac.Batch, float]]:
    """Batches, with the device time of all rows until then, 10 ms each, until that is ``seconds``."""
    first_us: int | None = None
    passed_s = 0.0
    for batch in hand.batches(every_s):
        last_us = batch.last_t_us()
        if last_us is not None:
            first_us = batch.first_t_us() if first_us is None else first_us
            passed_s = (last_us - (first_us or 0) + round(1e6 / FRAME_HZ)) / 1e6
        yield batch, passed_s
        if seconds is not None and passed_s >= seconds:
            break


def report_lost(hand: biotac.Hand) -> None:
    """Say on stderr how many frames were lost, if any."""
    if hand.stats.frames_lost:
        is_simulated = hand.info.board == BoardKind.POSIX_SIM
        simulated = ", as this computer is too busy for a simulated board" if is_simulated else ""
        note(f"{hand.stats.frames_lost} frame(s) lost{simulated}; close other programs, or use a faster computer")


def show(hand: biotac.Hand, *, rate: float, seconds: float | None, events: bool, as_json: bool) -> None:
    """Print ``rate`` frames per second and finger, and ``events``, which a recording may have unasked."""
    due_us: dict[int, float] = {}
    step_us = 1e6 / rate if rate > 0 else 0
    end_us: int | None = None
    for batch in hand.batches():
        for event in batch.messages:
            if events and isinstance(event, Event):
                print(json.dumps(event_as_json(event)) if as_json else event_as_line(event))
        for frame in map(Frame.from_row, batch.frames):
            if end_us is None and seconds is not None:
                end_us = frame.t_us + round(seconds * 1e6)
            if end_us is not None and frame.t_us >= end_us:
                return
            due = due_us.get(frame.finger, float(frame.t_us))
            if frame.t_us < due:
                continue
            due_us[frame.finger] = max(due + step_us, frame.t_us)  # in step, so that there are ``rate`` a second
            print(json.dumps(row_as_json(frame)) if as_json else as_line(frame))
        sys.stdout.flush()


def event_as_json(event: Event) -> dict[str, object]:
    """Name and numbers of an event as JSON types; invalid numbers are null."""
    return {
        "event": kind_name(event).lower(),
        "finger": event.finger,
        "t_us": event.t_us,
        "began_s_ago": event_age_s(event),
        "energy_count2": None if event.energy_count2 == INVALID_U32 else event.energy_count2,
        "peak_count": None if event.peak_count == INVALID_COUNT else event.peak_count,
        "trust": None if event.kind != EventKind.TRUST else event.trust,
    }


def event_as_line(event: Event) -> str:
    line = f"{event.t_us / 1e6:9.3f} s finger {event.finger}  {kind_name(event).lower()}"
    if event.kind == EventKind.TRUST:
        line += f" {trust_of(event.trust).name}"
    if event.peak_count != INVALID_COUNT:
        line += f", peak {event.peak_count} counts"
    age_s = event_age_s(event)
    return f"{line}, began {age_s * 1000:.1f} ms earlier" if age_s else line


def as_line(frame: Frame) -> str:
    """One line: the point where a finger is touched, the force, the trust and the reasons; --json has all there is."""
    touched = FrameFlags.CONTACT in frame.flags and not math.isnan(frame.poc_mm[0])
    poc = "poc " + " ".join(f"{v:5.1f}" for v in frame.poc_mm) + " mm" if touched else " " * 24
    force = " ".join(f"{v:6.2f}" for v in frame.force_n)
    why = " ".join([frame.trust.name, *(str(frame.reasons).split("|") if frame.reasons else [])])
    line = f"{frame.t_us / 1e6:9.3f} s finger {frame.finger}  {poc}  force {force} N  {why}"
    return line if len(line) <= COLUMNS else line[: COLUMNS - 1].rsplit(" ", 1)[0] + " …"
