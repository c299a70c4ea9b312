"""biotac list"""

from __future__ import annotations

import argparse
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
from serial.tools.list_ports_common import ListPortInfo

from ... import extra
from ...errors import BiotacError, printable
from ...hand.hand import Hand
from ...link import open_link
from ...link.discovery import is_board, serial_ports
from ...sim.loading import bundled_scenario, bundled_scenarios
from ...sim.scenario import parse_scenario
from ...wire.identity import board_name, serial_text, version_text
from ..outputs import report

EXAMPLE = "biotac list"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    # --all is not the default: bytes sent to an unknown device may mean something to it.
    parser.add_argument(
        "--zenoh",
        metavar="ENDPOINT",
        nargs="?",
        const="",
        help="also list shared boards: this computer's or, with ZENOH_CONFIG, those of others, searched for or through "
        "ENDPOINT (tcp/HOST:7447)",
    )
    parser.add_argument("--all", action="store_true", help="query every port, not only those with our USB ids")


def run(args: argparse.Namespace) -> int:
    ports = [describe(port, ask=is_board(port) or args.all) for port in serial_ports()]
    scenarios = {f"sim:{name}": about(name) for name in bundled_scenarios()}
    running = simulated()
    remote = _shared(args.zenoh or None) if args.zenoh is not None else []
    lines = [*map(as_line, ports), *(f"{port}  simulated: {command}" for port, command in running.items())]
    for facts in remote:
        commander = f"commanded by {facts['writer']}" if facts.get("writer") else "not commanded by anyone"
        lines.append(f"{as_line(facts)}  {commander}")
    if args.zenoh is not None and not remote:
        lines.append("no board is shared on the network; `biotac share PORT --zenoh NAME` shares one")
    if not any(port["is_board"] for port in ports):
        lines.append("no board on USB; plug one in, run `biotac doctor`, or try a simulated one:")
    report(
        args,
        {"ports": ports, "simulated": running, "scenarios": scenarios, "zenoh": remote},
        "\n".join([*lines, *(f"{port:24}{clause}" for port, clause in scenarios.items())]),
    )
    return 0


def about(name: str) -> str:
    """A bundled scenario's load, in one clause."""
    played = parse_scenario(bundled_scenario(name), file=name)
    times_s = np.arange(0.0, played.seconds, 0.05)
    most_n = max(np.linalg.norm(track.states(times_s).wrench()[0], axis=1).max() for track in played.tracks)
    return f"{played.seconds:3.0f} s, up to {most_n:.1f} N: {played.about}"


def simulated() -> dict[str, str]:
    """Ptys of the simulated boards that run on this computer, each with the command; only Linux can tell."""
    found: dict[str, str] = {}
    for process in sorted(Path("/proc").glob("[0-9]*")):
        with suppress(OSError, ValueError):  # it is over, or another user's
            parts = _command_line(process)
            if "biotac" not in "".join(Path(word).name for word in parts[:2]):
                continue
            ttys = [line.split()[1] for file in (process / "fdinfo").iterdir()
                    for line in file.read_text().splitlines() if line.startswith("tty-index:")]  # fmt: skip
            names = [Path(word).name for word in parts]
            if "biotac" in names:  # or else it is another program's own
                command = ["biotac", *parts[names.index("biotac") + 1 :]]
                found |= {f"/dev/pts/{tty}": printable(" ".join(command)) for tty in ttys[:1]}
    return found


def _command_line(process: Path) -> list[str]:
    return (process / "cmdline").read_text(errors="replace").rstrip("\0").split("\0")


def _shared(endpoint: str | None) -> list[dict[str, Any]]:
    return extra.call(extra.BRIDGES, "zenoh", lambda bridge: list(bridge.listed(endpoint)))


def describe(port: ListPortInfo, *, ask: bool) -> dict[str, Any]:
    """The operating system's facts about a port and, if ``ask``, the port's answer."""
    facts: dict[str, Any] = {
        "port": port.device,
        "is_board": is_board(port),
        "description": str(port.description),
        "serial_number": port.serial_number,
    }
    if ask:
        try:
            with Hand(open_link(port.device)) as hand:
                facts |= {
                    "is_board": True,
                    "serial_number": serial_text(hand.info),
                    "board": board_name(hand.info),
                    "firmware": version_text(hand.info),
                    "fingers": hand.fingers,
                }
        except BiotacError as error:
            facts["problem"] = str(error)
    return facts


def as_line(facts: dict[str, Any]) -> str:
    if "problem" in facts:
        return f"{facts['port']}  {facts['problem']}"
    if "firmware" not in facts:
        known = [str(facts[key]) for key in ("port", "description", "serial_number") if facts[key]]
        named = (text if text != "n/a" else "not a gateway's USB id" for text in known)  # n/a is pyserial's for nothing
        return "  ".join(named)
    fingers = ", ".join(map(str, facts["fingers"])) or "none"
    parts = (f"serial:{facts['serial_number']}", facts["board"], f"firmware {facts['firmware']}", f"fingers {fingers}")
    return "  ".join([facts["port"], *parts])
