"""A board on a pty for as long as the command runs: announced, linked, and removed on Ctrl-C."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from ...errors import PortError


class Board(Protocol):
    """The board on the pty."""

    path: str

    def close(self) -> None:
        """End it."""


@contextmanager
def until_ctrl_c(board: Board, link: Path | None) -> Iterator[None]:
    """Run until Ctrl-C, the usual way to stop; then, as after an error, close the board and remove the link to it."""
    try:
        yield
    except KeyboardInterrupt:
        pass
    finally:
        if link is not None and link.is_symlink() and os.readlink(link) == board.path:
            link.unlink()  # not one that another board has taken since
        board.close()


def tell(board: Board, link: Path | None, plays: str, facts: dict[str, Any], *, as_json: bool) -> None:
    """Make the link; print where the board is and what it plays. ``facts`` go to --json besides the port."""
    if link is not None:
        make_link(link, board.path)
    print(json.dumps({"port": board.path, **facts}) if as_json else f"{board.path} plays {plays}; Ctrl-C stops")
    sys.stdout.flush()


def tell_over(plays: str) -> None:
    """Say that the source is over: the board goes on answering."""
    print(f"{plays} has ended; the board keeps answering until Ctrl-C", file=sys.stderr)


def make_link(link: Path, target: str) -> None:
    """Make the link; replaces a link left over from before, never anything else.

    Raises PortError when it leads to a port that is there: that of another simulator.
    """
    if link.is_symlink():
        if link.exists():
            raise PortError(f"{link} leads to {os.readlink(link)}, which another program has; choose another --link")
        link.unlink()
    try:
        os.symlink(target, link)
    except OSError as error:
        raise PortError(f"link {link} cannot be created ({error.strerror}); choose another path") from error
