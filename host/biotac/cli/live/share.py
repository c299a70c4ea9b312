"""biotac share PORT --zenoh NAME, biotac share PORT --lsl"""

from __future__ import annotations

import argparse
import time
from contextlib import closing, suppress
from pathlib import Path

import biotac

from ...errors import InputError
from .. import values
from ..outputs import note, report
from .stream import batches, report_lost

EXAMPLE = "biotac share /dev/ttyACM0 --zenoh left"
SHARED_LOOK_S = 0.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    values.add_port(parser)
    by = parser.add_mutually_exclusive_group(required=True)
    by.add_argument("--zenoh", metavar="NAME", help="share the board itself: others open it as zenoh:NAME")
    by.add_argument("--lsl", action="store_true", help="publish its fingers on the Lab Streaming Layer")
    parser.add_argument("--seconds", type=values.seconds, help="device time, with --lsl (default: until Ctrl-C)")
    parser.add_argument(
        "--listen", metavar="ENDPOINT", help="such as tcp/0.0.0.0:7447, with --config (default: this computer only)"
    )
    parser.add_argument("--connect", metavar="ENDPOINT", help="of a Zenoh router, such as tcp/HOST:7447")
    parser.add_argument(
        "--config", metavar="FILE", type=Path, help="Zenoh's: users, TLS, access (default: ZENOH_CONFIG)"
    )


def run(args: argparse.Namespace) -> int:
    """Share until Ctrl-C, the usual way to stop it."""
    if args.lsl:
        values.refuse(args, ("listen", "connect", "config"), "is for --zenoh; drop it, or --lsl")
        return publish(args)
    values.refuse(args, ("seconds",), "is for --lsl; drop it, or --zenoh")
    return serve(args)


def serve(args: argparse.Namespace) -> int:
    """Share the board. If it goes away, look for it again and tell its readers."""
    from ...fleet import network  # here, because LSL needs no Zenoh
    from ...fleet.share import Share

    if args.port is not None and args.port.startswith("zenoh:"):
        raise InputError(f"{args.port} is already shared; open it directly")
    name = network.checked_name(args.zenoh)
    with (
        closing(network.open_session(name, connect=args.connect, listen=args.listen, config=args.config)) as session,
        biotac.open(args.port, pace=1.0, reconnect=True) as hand,
        closing(Share(hand, session, name)),
    ):
        facts = {"port": f"zenoh:{name}", "board": hand.port, "fingers": hand.fingers}
        report(args, facts, f"{hand.port} is shared as zenoh:{name}; Ctrl-C stops")
        try:
            while not hand.ended:  # the bridge reads and publishes on its own
                hand.check()
                time.sleep(SHARED_LOOK_S)
        except KeyboardInterrupt:
            pass
    return 0


def publish(args: argparse.Namespace) -> int:
    """Publish streams on LSL until the time is over or the source ends."""
    from ...bridges.lsl import Outlet  # here, because Zenoh needs no liblsl
    from ...bridges.silence import LOOK_S

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
