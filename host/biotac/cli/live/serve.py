"""biotac serve PORT --name NAME"""

from __future__ import annotations

import argparse
import json
import sys
import time
from contextlib import closing
from pathlib import Path

import biotac

from ...errors import InputError
from ...fleet import network
from ...fleet.share import Share
from .. import values

EXAMPLE = "biotac serve /dev/ttyACM0 --name left"
_LOOK_S = 0.5


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the port, the name to share it under, and where Zenoh is."""
    values.add_port(parser)
    parser.add_argument("--name", required=True, help="others open it as zenoh:NAME")
    parser.add_argument(
        "--listen", metavar="ENDPOINT", help="such as tcp/0.0.0.0:7447, with --config (default: this computer only)"
    )
    parser.add_argument("--connect", metavar="ENDPOINT", help="of a Zenoh router, such as tcp/HOST:7447")
    parser.add_argument(
        "--config", metavar="FILE", type=Path, help="Zenoh's: users, TLS, access (default: ZENOH_CONFIG)"
    )


def run(args: argparse.Namespace) -> int:
    """Share the board until Ctrl-C. If it goes away, look for it again and tell its readers."""
    if args.port is not None and args.port.startswith("zenoh:"):
        raise InputError(f"{args.port} is already shared; open it directly")
    name = network.checked_name(args.name)
    with (
        closing(network.open_session(name, connect=args.connect, listen=args.listen, config=args.config)) as session,
        biotac.open(args.port, pace=1.0, reconnect=True) as hand,
        Share(hand, session, name),
    ):
        facts = {"port": f"zenoh:{name}", "board": hand.port, "fingers": hand.fingers}
        print(json.dumps(facts) if args.json else f"{hand.port} is shared as zenoh:{name}; Ctrl-C stops")
        sys.stdout.flush()
        try:
            while True:
                hand.check()  # the bridge reads and publishes on its own
                time.sleep(_LOOK_S)
        except KeyboardInterrupt:
            pass  # the usual way to stop it
    return 0
