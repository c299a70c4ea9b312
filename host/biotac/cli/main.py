"""Argument parsing and exit codes."""

from __future__ import annotations

import argparse
import os
import signal
import sys
import threading
from collections.abc import Sequence

from ..errors import BiotacError, InputError
from . import calibrate, version
from .boards import calibration, doctor, flash, info, list_ports, udev_setup, wrench_map
from .lab import bench, demo, experiment
from .live import lsl, record, sim, stream, view
from .recordings import check, export, import_btd, recompute, replay

VERBS = (
    demo, list_ports, doctor, info, view, stream, lsl, record, check, replay, recompute, export, import_btd, calibrate,
    calibration, wrench_map, experiment, sim, flash, bench, udev_setup, version,
)  # fmt: skip

EPILOG = """\
A PORT is a device path (/dev/ttyACM0, COM3), serial:NUMBER of a board, sim:SOURCE, a simulated board that plays
a scenario (sim:press.toml) or recorded counts (sim:trial.npz, sim:data.btd), emu:pico?source=SOURCE, a Pico's
flash image in an emulator that plays the same, or replay:REC, a recording that answers as its board did.

exit codes: 0 done   1 check, doctor or experiment found something   2 unusable file or argument
3 port cannot be opened   4 no gateway on the port   5 firmware of another wire version   6 board lost
7 command refused   8 flashing failed   130 interrupted
"""


class OneLineEach(argparse.RawDescriptionHelpFormatter):
    """Wide enough for a verb a line, so that all of them fit a screen."""

    def __init__(self, prog: str) -> None:
        super().__init__(prog, max_help_position=18, width=110)
        # argparse measures verbs without their indent, and then breaks the line after the longest ones
        self._action_max_length = 16


def parser() -> argparse.ArgumentParser:
    """The whole command line."""
    top = argparse.ArgumentParser(
        prog="biotac",
        description="BioTac fingertips over USB: forces, points of contact, torques.",
        epilog=EPILOG,
        formatter_class=OneLineEach,
    )
    verbs = top.add_subparsers(dest="verb", required=True, metavar="VERB")
    for module in VERBS:
        verb = verbs.add_parser(
            module.NAME,
            help=module.HELP,
            description=module.HELP,
            epilog=f"example: {module.EXAMPLE}",
            formatter_class=argparse.RawDescriptionHelpFormatter,
        )
        verb.add_argument("--json", action="store_true", help="print JSON for machines")
        module.add_arguments(verb)
        verb.set_defaults(run=module.run)
    return top


def main(argv: Sequence[str] | None = None) -> int:
    """Run one verb; return its exit code. Errors are one line on stderr."""
    args = parser().parse_args(argv)
    if threading.current_thread() is threading.main_thread():
        # A terminated command leaves no simulator and no temporary file behind either.
        signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        return int(args.run(args))
    except BiotacError as error:
        print(f"biotac: {one_line(error)}", file=sys.stderr)
        return error.exit_code
    except KeyboardInterrupt as interrupt:
        # What became of a file that was being written.
        print(f"biotac: interrupted{f'; {interrupt}' if interrupt.args else ''}", file=sys.stderr)
        return 130
    except BrokenPipeError:
        # Whoever read our output has had enough; keep Python from complaining while it shuts down.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0
    except OSError as error:
        print(f"biotac: {one_line(error)}; check the path and the space left", file=sys.stderr)
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return InputError.exit_code


def one_line(error: Exception) -> str:
    """A message as one line, whatever a file name has in it."""
    return " ".join(str(error).split())
