"""biotac list"""

from __future__ import annotations

import argparse
import json
from typing import Any

from serial.tools import list_ports

from ..errors import BiotacError
from ..hand import Hand
from ..identity import serial_text, version_text
from ..link import open_link
from ..sim.source import bundled_scenarios

NAME = "list"
HELP = "List serial ports, and the scenarios that can be simulated."
EXAMPLE = "biotac list --probe"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """--probe is not the default: bytes sent to an unknown device may mean something to it."""
    parser.add_argument("--probe", action="store_true", help="ask every port whether a gateway is there")


def run(args: argparse.Namespace) -> int:
    """Print ports and scenarios."""
    ports = [describe(port, probe=args.probe) for port in sorted(list_ports.comports())]
    scenarios = [f"sim:{name}" for name in bundled_scenarios()]
    if args.json:
        print(json.dumps({"ports": ports, "scenarios": scenarios}))
        return 0
    if not ports:
        print("no serial ports; plug a board in, or try a simulated one:")
    for port in ports:
        print("  ".join(str(value) for value in port.values() if value))
    for name in scenarios:
        print(name)
    return 0


def describe(port: Any, *, probe: bool) -> dict[str, Any]:
    """What the operating system says of a port, and what the port says when asked."""
    facts = {"port": port.device, "description": port.description, "serial_number": port.serial_number}
    if probe:
        try:
            with Hand(open_link(port.device)) as hand:
                facts["gateway"] = f"firmware {version_text(hand.info)}, serial {serial_text(hand.info)}"
        except BiotacError as error:
            facts["problem"] = str(error)
    return facts
