"""biotac version"""

from __future__ import annotations

import argparse
import json

from ..version import __version__
from ..wire import messages_gen as wire

EXAMPLE = "biotac version"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add nothing: the verb has no arguments of its own."""


def run(args: argparse.Namespace) -> int:
    """Print and return 0."""
    facts = {
        "biotac-gateway": __version__,
        "wire": f"{wire.WIRE_MAJOR}.{wire.WIRE_MINOR}",
        "schema_hash": f"{wire.SCHEMA_HASH:08x}",
    }
    if args.json:
        print(json.dumps(facts))
    else:
        print(f"biotac-gateway {__version__}, wire {facts['wire']}, schema {facts['schema_hash']}")
    return 0
