"""A board on a pty for as long as the command runs: announced, linked, and removed on Ctrl-C."""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...errors import PortError
from ...hand.opening import shake_hands
from ...link import Link, open_link
from ...sim.board import SimBoard
from ...sim.serve import LOCAL, Served
from ..outputs import report

if TYPE_CHECKING:
    from ...recording.replay.pty import ReplayPty


@contextmanager
def served(board: SimBoard, args: argparse.Namespace) -> Iterator[Served]:
    """``board`` for other programs until Ctrl-C, with the source's tare, as biotac.open gives it; device time runs.

    One that is a process has a pty of its own.
    """
    if not isinstance(board, SimBoard):
        with until_ctrl_c(board, args.link):
            prepare(board, open_link(board.path))
            yield board
        return
    if args.address not in (None, LOCAL):
        print(f"--address {args.address}: who knows the token can use the board from other computers", file=sys.stderr)
    try:
        prepare(board, board.link("sim:", owned=False))
        port = Served(board, address=args.address)
        with until_ctrl_c(port, args.link):
            yield port
    finally:
        board.close()


def prepare(board: SimBoard, link: Link) -> None:
    if not board.live:
        link.source = board.source
        shake_hands(link).close()
        board.release()


@contextmanager
def until_ctrl_c(board: Served | ReplayPty, link: Path | None) -> Iterator[None]:
    """Run until Ctrl-C, the usual way to stop; then, as after an error, close the board and remove the link to it."""
    try:
        yield
    except KeyboardInterrupt:
        pass
    finally:
        if link is not None and link.is_symlink() and os.readlink(link) == board.path:
            link.unlink()  # not one that another board has made since
        board.close()


def announce(board: Served | ReplayPty, args: argparse.Namespace, plays: str, facts: dict[str, Any]) -> None:
    """Make the link; print the board's port and source. ``facts`` go to --json besides the port.

    Replaces a link left over from before, never anything else. Raises PortError when it leads to a port that is there:
    that of another simulator.
    """
    link: Path | None = args.link
    if link is not None and "://" in board.path:
        raise PortError(f"--link {link} needs a pty, which this board has not; drop it, and use the printed PORT")
    if link is not None and link.is_symlink():
        if link.exists():
            raise PortError(f"{link} leads to {os.readlink(link)}, which another program has; choose another --link")
        link.unlink()
    if link is not None:
        try:
            os.symlink(board.path, link)
        except OSError as error:
            raise PortError(f"link {link} cannot be created ({error.strerror}); choose another path") from error
    report(args, {"port": board.path, **facts}, f"{board.path} plays {plays}; Ctrl-C stops")


def announce_end(plays: str) -> None:
    """Say that the source is over: the board goes on answering."""
    print(f"{plays} has ended; the board keeps answering until Ctrl-C", file=sys.stderr)
