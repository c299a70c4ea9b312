"""Argument parsing and exit codes."""

from __future__ import annotations

import argparse
import contextlib
import errno
import importlib
import io
import os
import sys
from collections.abc import Collection, Sequence
from typing import Any

from ..errors import BiotacError, InputError, printable
from ..version import __version__
from . import ending, gone
from .outputs import note

#: In the order of ``biotac --help``: each verb's module, imported when it is called, and a sentence about it.
VERBS = {
    "demo": ("live.demo", "Run the whole chain once: simulated board, stream, recording, cross-check, picture."),
    "list": ("boards.list_ports", "List boards and other serial ports, and the scenarios that can be simulated."),
    "doctor": ("boards.doctor", "Find what is wrong with a board, its sensors or this computer, and the cure."),
    "info": ("boards.info", "Show what is on a port, or in a recording: sensors, settings, losses, labels, flags."),
    "view": ("live.view", "Show a board or a recording live in the browser."),
    "stream": ("live.stream", "Print frames as they arrive, ten a second from each finger, as lines or JSON."),
    "share": ("live.share", "Share a board with other programs and computers, by Zenoh or LSL."),
    "record": ("live.record", "Record everything a board sends to an MCAP file."),
    "check": ("recordings.check", "Check every on-board result of a recording against the float64 reference."),
    "file": ("recordings.file", "Label a recording, cut some seconds out of it, or recover a damaged one."),
    "export": (
        "recordings.export",
        "Write a recording for other programs, as a picture or recomputed; many as Parquet.",
    ),
    "calibrate": (
        "calibrate",
        "Fit a finger to a reference and upload; show, get, put or clear a calibration or map.",
    ),
    "sim": (
        "live.sim",
        "Run a simulated, emulated or recorded board on a pty, or let a Pico play a gateway's sensors.",
    ),
    "flash": ("boards.flash", "Write a firmware image to a board, and give it its settings back."),
}

EPILOG = """\
A PORT is a device path (/dev/ttyACM0, COM3), serial:NUMBER of a board, uart:DEVICE?baud=N for a board's UART,
zenoh:NAME, one that is shared; bag:FILE, csv:FILE?columns=TOML and foxglove://HOST:PORT/topic, counts of another
driver; sim:SOURCE, a simulated board that plays a scenario (sim:press.toml) or recorded
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


class Version(argparse.Action):
    """Prints the release, the wire version and the schema hash, which it imports only then."""

    def __call__(self, parser: argparse.ArgumentParser, *called: object) -> None:
        from ..wire import messages_gen as wire

        print(f"biotac-gateway {__version__}, wire {wire.WIRE_MAJOR}.{wire.WIRE_MINOR}, schema {wire.SCHEMA_HASH:08x}")
        parser.exit()


class Parser(argparse.ArgumentParser):
    """A parser, with subparsers alike, that accepts no abbreviation of an option: --f would be --force."""

    def __init__(self, **options: Any) -> None:
        super().__init__(allow_abbrev=False, **options)


def parser(called: Collection[str] = tuple(VERBS)) -> argparse.ArgumentParser:
    """The command line, with the arguments of the verbs that are ``called``."""
    top = Parser(
        prog="biotac",
        description="BioTac fingertips: forces, points of contact, torques.",
        epilog=EPILOG,
        formatter_class=OneLineEach,
        add_help=False,
    )
    top.add_argument("-h", "--help", action="help", help=argparse.SUPPRESS)  # a reader of the help needs no help line
    top.add_argument(
        "--version", action=Version, nargs=0, help="print the release, the wire version and the schema hash"
    )
    verbs = top.add_subparsers(dest="verb", required=True, metavar="VERB")
    for name, (module_name, text) in VERBS.items():
        verb = verbs.add_parser(name, help=text, description=text, formatter_class=argparse.RawDescriptionHelpFormatter)
        verb.add_argument("--json", action="store_true", help="print JSON for machines")
        if name in called:
            module = importlib.import_module(f"biotac.cli.{module_name}")
            verb.epilog = f"example: {module.EXAMPLE}"
            if hasattr(module, "run"):
                verb.set_defaults(run=module.run)
            module.add_arguments(verb)  # subverbs have a run() each
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; return the exit code. Errors are one line on stderr."""
    _make_streams_usable()
    arguments = sys.argv[1:] if argv is None else argv
    if arguments and arguments[0] in gone.VERBS:
        note(gone.VERBS[arguments[0]])
        return InputError.exit_code
    if not arguments:
        parser(()).print_help(sys.stderr)
        return InputError.exit_code
    if new := gone.RENAMED.get(arguments[0]):
        note(f"`biotac {arguments[0]}` is now `biotac {new}`; the old verb goes with the next version")
        arguments = [new, *arguments[1:]]
    args = parser(arguments[:1]).parse_args(arguments)
    try:
        ending.by_interrupt()
        return int(args.run(args))
    except BiotacError as error:
        note(one_line(error))
        return error.exit_code
    except KeyboardInterrupt as interrupt:
        # The message says whether a file that was being written is complete.
        note(f"interrupted{f'; {interrupt}' if interrupt.args else ''}")
        return ending.INTERRUPTED
    except MemoryError:
        note("not enough memory for that; close other programs, or take less of it (`biotac file cut`)")
        return InputError.exit_code
    except OSError as error:
        unread = isinstance(error, BrokenPipeError) or (error.errno == errno.EIO and _terminal_closed())
        full = error.errno in (errno.EMFILE, errno.ENFILE)
        cure = (
            "close what is open, or raise the limit (ulimit -n)" if full else "check the path and the free disk space"
        )
        if not unread:
            note(f"{printable(one_line(error))}; {cure}")
        with contextlib.suppress(OSError):  # a notebook's stdout has no descriptor
            os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or Python complains while it shuts down
        return 0 if unread else InputError.exit_code


def _terminal_closed() -> bool:
    """Whether stdout is a terminal that has closed: then it, and not a disk, gave the error."""
    try:
        os.get_terminal_size(sys.stdout.fileno())
    except OSError as error:
        return error.errno == errno.EIO
    return False


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
