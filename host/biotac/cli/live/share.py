"""biotac share PORT --zenoh NAME, --lsl, or --by BRIDGE"""

from __future__ import annotations

import argparse
from pathlib import Path

from ... import extra
from ...errors import InputError
from .. import values

EXAMPLE = "biotac share /dev/ttyACM0 --zenoh left"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    values.add_port(parser)
    by = parser.add_mutually_exclusive_group(required=True)
    by.add_argument("--zenoh", metavar="NAME", help="share the board itself: others open it as zenoh:NAME")
    by.add_argument("--lsl", action="store_true", help="publish its fingers on the Lab Streaming Layer")
    by.add_argument("--by", metavar="BRIDGE", help="by a bridge of another package (its entry point biotac.bridges)")
    parser.add_argument("--seconds", type=values.seconds, help="device time, not with --zenoh (default: until Ctrl-C)")
    parser.add_argument(
        "--listen", metavar="ENDPOINT", help="such as tcp/0.0.0.0:7447; needs --config (default: this computer only)"
    )
    parser.add_argument("--connect", metavar="ENDPOINT", help="a Zenoh router, such as tcp/HOST:7447")
    parser.add_argument(
        "--config", metavar="FILE", type=Path, help="of Zenoh: users, TLS, access (default: ZENOH_CONFIG)"
    )


def run(args: argparse.Namespace) -> int:
    """Share until Ctrl-C, the usual way to stop it."""
    if args.zenoh is not None:
        values.refuse(args, ("seconds",), "is for --lsl; drop it, or --zenoh")
    else:
        values.refuse(args, ("listen", "connect", "config"), "is for --zenoh; drop it, or --lsl")
    name = args.by or ("lsl" if args.lsl else "zenoh")
    try:
        return extra.call(extra.BRIDGES, name, lambda bridge: int(bridge.run(args)))
    except KeyError:
        known = ", ".join(extra.names(extra.BRIDGES)) or "none"
        raise InputError(f"no bridge {name!r} is installed; expected one of {known}") from None
