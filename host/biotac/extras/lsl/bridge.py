"""``biotac share PORT --lsl``."""

from __future__ import annotations

import argparse
from contextlib import suppress

import biotac

from ...cli.live.stream import batches, report_lost
from ...cli.outputs import note, report
from ...hand.silence import LOOK_S
from .outlet import Outlet


def run(args: argparse.Namespace) -> int:
    """Publish streams on LSL until the time is over or the source ends."""
    with biotac.open(args.port, pace=1.0) as hand, Outlet(hand) as outlet:
        hand.stream("results", "events")
        streams = [{"name": info.name(), "rate_hz": info.nominal_srate()} for info in outlet.infos]
        rates = [f"{s['rate_hz']:g} samples per second" if s["rate_hz"] else "irregular" for s in streams]
        lines = [f"{s['name']}, {rate}" for s, rate in zip(streams, rates, strict=True)]
        report(args, {"streams": streams}, "\n".join([*lines, *(["Ctrl-C stops"] if args.seconds is None else [])]))
        with suppress(KeyboardInterrupt):
            for batch, _ in batches(hand, args.seconds, LOOK_S):
                outlet.push(batch)
        if outlet.by_arrival:
            note(f"{outlet.by_arrival} sample(s) stamped by arrival time: board clock unknown")
        report_lost(hand)
    return 0
