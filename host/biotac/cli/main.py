"""Argument parsing and exit codes."""

from __future__ import annotations

import argparse
import importlib
import io
import os
import signal
import sys
import threading
from collections.abc import Collection, Sequence
from typing import Any

from ..errors import BiotacError, InputError, printable

#: In the order of ``biotac --help``: each verb's module, imported when it is called, and what it does.
VERBS = {
    "demo": (
        "biotac.cli.live.demo",
        "Run the whole chain once: simulated board, stream, recording, cross-check, picture.",
    ),
    "list": (
        "biotac.cli.boards.list_ports",
        "List boards and other serial ports, and the scenarios that can be simulated.",
    ),
    "doctor": (
        "biotac.cli.boards.doctor",
        "Find what is wrong with a board, its sensors or this computer, and the cure.",
    ),
    "info": ("biotac.cli.boards.info", "Show what is on a port: board, firmware, sensors, settings, counters."),
    "view": ("biotac.cli.live.view", "Show a board or a recording live in the browser."),
    "stream": ("biotac.cli.live.stream", "Print frames as they arrive: one line each, or one JSON object each."),
    "lsl": ("biotac.cli.live.lsl", "Publish fingers on the Lab Streaming Layer."),
    "serve": ("biotac.cli.live.serve", "Share a board with other computers, which open it as zenoh:NAME."),
    "record": ("biotac.cli.live.record", "Record everything a board sends to an MCAP file."),
    "check": (
        "biotac.cli.recordings.check",
        "Check every on-board result of a recording against the float64 reference.",
    ),
    "replay": ("biotac.cli.recordings.replay", "Play a recording as the board that made it, here or on a pty."),
    "export": (
        "biotac.cli.recordings.export",
        "Write a recording as CSV, Parquet, HDF5, NPZ or ROS 2 bag, or recomputed; many to a lake.",
    ),
    "lake": (
        "biotac.cli.recordings.lake",
        "Check a lake of recordings, query it in SQL, or list its boards and sensors.",
    ),
    "calibrate": (
        "biotac.cli.calibrate",
        "Fit a finger's wrench or pressure to a reference, test it on held-out data, upload it.",
    ),
    "calibration": ("biotac.cli.boards.calibration", "Show, get, put or store a finger's calibration."),
    "map": (
        "biotac.cli.boards.wrench_map",
        "Show, get, put or clear the wrench map that a board computes a finger's force by.",
    ),
    "sim": ("biotac.cli.live.sim", "Run a simulated or emulated board on a pty that any serial program can open."),
    "sensor": (
        "biotac.cli.live.sensor",
        "Let a Pico that is wired to a gateway play scenarios and recordings as its sensors.",
    ),
    "flash": ("biotac.cli.boards.flash", "Write a firmware image to a board, and give it its settings back."),
    "udev-setup": ("biotac.cli.boards.udev_setup", "Install the Linux rule that lets you open boards (needs root)."),
    "version": ("biotac.cli.version", "Print the release, the wire version and the schema hash."),
}

EPILOG = """\
A PORT is a device path (/dev/ttyACM0, COM3), serial:NUMBER of a board, uart:DEVICE?baud=N for a board's UART,
zenoh:NAME, one that is shared; sim:SOURCE, a simulated board that plays a scenario (sim:press.toml) or recorded
counts (sim:trial.npz, sim:data.btd), emu:pico?source=SOURCE, a Pico's image in an emulator, or replay:REC, a
recording that answers as its board did.

exit codes: 0 done  1 something was found wrong  2 unusable file or argument  3 port not opened
4 no gateway on the port  5 another wire version  6 board lost  7 command refused  8 flashing failed  130 interrupted
"""


class OneLineEach(argparse.RawDescriptionHelpFormatter):
    """Wide enough for one verb per line, so that all of them fit a screen."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=18, width=110)
        # argparse measures verbs without their indent and would break the line after the longest ones
        self._action_max_length = 16


class Parser(argparse.ArgumentParser):
    """A parser, its subparsers too, that takes no abbreviation of an option: --f would be --force."""

    def __init__(self, **options: Any) -> None:
        super().__init__(allow_abbrev=False, **options)


def parser(called: Collection[str] = tuple(VERBS)) -> argparse.ArgumentParser:
    """The command line, with the arguments of the verbs that are ``called``."""
    top = Parser(
        prog="biotac",
        description="BioTac fingertips over USB: forces, points of contact, torques.",
        epilog=EPILOG,
        formatter_class=OneLineEach,
        add_help=False,
    )
    top.add_argument("-h", "--help", action="help", help=argparse.SUPPRESS)  # who can read its help needs no help line
    verbs = top.add_subparsers(dest="verb", required=True, metavar="VERB")
    for name, (place, text) in VERBS.items():
        verb = verbs.add_parser(name, help=text, description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
        verb.add_argument("--json", action="store_true", help="print JSON for machines")
        if name in called:
            module = importlib.import_module(place)
            verb.epilog = f"example: {module.EXAMPLE}"
            module.add_arguments(verb)
            verb.set_defaults(run=module.run)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; return its exit code. Errors are one line on stderr."""
    _make_streams_usable()
    words = sys.argv[1:] if argv is None else argv
    args = parser(words[:1]).parse_args(words)
    if threading.current_thread() is threading.main_thread():
        # SIGTERM must not leave a simulator or a temporary file behind either.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return int(args.run(args))
    except BiotacError as error:
        print(f"biotac: {one_line(error)}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt as interrupt:
        # The message says what became of a file that was being written.
        print(f"biotac: interrupted{f'; {interrupt}' if interrupt.args else ''}", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # The reader of our output closed it; keep Python from complaining while it shuts down.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        print(f"biotac: {printable(one_line(error))}; check the path and the free disk space", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return InputError.exit_code


def _make_streams_usable() -> None:
    """Let printing neither fail on a name that is not UTF-8, nor on a stream that the shell has closed (``>&-``)."""
    for name in ("stdout", "stderr"):
        stream = getattr(sys, name)
        if stream is None:
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115, it stays open
        elif isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def one_line(error: Exception) -> str:
    """The message as one line, even if a file name in it has line breaks."""
    return " ".join(str(error).split())
