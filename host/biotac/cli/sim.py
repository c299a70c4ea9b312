"""biotac sim SOURCE"""

from __future__ import annotations

import argparse
import json
import os
import signal
import sys
from pathlib import Path

from ..errors import InputError, PortError
from ..link.ports import start_board
from ..link.serial_port import SerialLink
from ..link.sim_process import SimBoard
from ..opening import shake_hands
from ..sim.source import load_source
from . import values

NAME = "sim"
HELP = "Run a simulated or emulated board on a pty that any serial program can open."
EXAMPLE = "biotac sim press.toml --fingers 5 --board pico"
SCENARIO_S = 600.0


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Source and pace."""
    parser.add_argument("source", metavar="SOURCE", help="scenario (.toml) or recorded counts (.npz, .btd)")
    parser.add_argument("--fingers", type=int, help="how many fingers play it, 1 to 5")
    parser.add_argument(
        "--seconds",
        type=values.seconds,
        help="device time (default: scenarios repeat for ten minutes, recordings play once)",
    )
    parser.add_argument(
        "--board",
        choices=("posix", "pico"),
        default="posix",
        help="posix (default): the firmware as a process; pico: the Pico's flash image in an emulator",
    )
    parser.add_argument("--image", help="flash image for --board pico (default: build/pico/biotac-pico.bin)")
    parser.add_argument("--pace", type=values.pace, default=1.0, help="real (default) or device seconds per second")
    parser.add_argument("--link", type=Path, help="also make this path a symbolic link to the pty")


def run(args: argparse.Namespace) -> int:
    """Print the pty's path, then run until Ctrl-C."""
    if args.pace == 0:
        raise InputError("a board on a pty needs a pace above 0; unpaced boards are for biotac.open and biotac demo")
    if args.image is not None and args.board == "posix":
        raise InputError("--image is for boards that have one; add --board pico")
    name = args.source.removeprefix("sim:")
    seconds = args.seconds or (SCENARIO_S if name.endswith(".toml") else None)
    source = load_source(name, fingers=args.fingers, seconds=seconds)
    board = start_board(args.board, source, pace=args.pace, image=args.image)
    try:
        prepare(board)
        if args.link is not None:
            make_link(args.link, board.path)
        facts = {"port": board.path, "source": source.name, "fingers": source.samples.shape[1]}
        print(json.dumps(facts) if args.json else f"{board.path} plays {source.name}; Ctrl-C stops")
        sys.stdout.flush()
        while not board.wait():
            pass
        # A board does not vanish when nothing more happens to its fingers: it goes on answering.
        print(f"{source.name} is over; the board stays until Ctrl-C", file=sys.stderr)
        signal.pause()
    except KeyboardInterrupt:
        pass  # the usual way to stop it
    finally:
        if args.link is not None and args.link.is_symlink():
            args.link.unlink()
        board.close()
    return 0


def prepare(board: SimBoard) -> None:
    """Give the board its source's settings and tare, as biotac.open does, and let its time run."""
    link = SerialLink(board.path)
    link.source = board.source
    shake_hands(link).close()
    board.release()


def make_link(link: Path, target: str) -> None:
    """Replace a link left over from before; never anything else."""
    if link.is_symlink():
        link.unlink()
    try:
        os.symlink(target, link)
    except OSError as error:
        raise PortError(f"{link} cannot be made a link ({error.strerror}); choose another path") from error
