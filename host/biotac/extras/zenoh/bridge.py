"""``biotac share PORT --zenoh NAME`` and ``biotac list --zenoh``."""

from __future__ import annotations

import argparse
import time
from contextlib import closing
from typing import Any

import biotac

from ...cli.outputs import report
from ...errors import InputError
from . import network
from .share import Share

LOOK_S = 0.5


def run(args: argparse.Namespace) -> int:
    """Share the board. If it goes away, look for it again and tell the readers."""
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
                time.sleep(LOOK_S)
        except KeyboardInterrupt:
            pass
    return 0


def listed(endpoint: str | None) -> list[dict[str, Any]]:
    """The descriptions that sharing computers publish of their boards."""
    with closing(network.open_session("biotac list", connect=endpoint)) as session:
        return [{"port": f"zenoh:{facts['name']}", **facts} for facts in network.shared(session)]
