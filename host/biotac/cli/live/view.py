"""biotac view PORT|RECORDING"""

from __future__ import annotations

import argparse
import contextlib
import webbrowser
from pathlib import Path

from ...errors import InputError
from ...link.discovery import choose
from ...view import DEFAULT_PORT
from ..outputs import report

EXAMPLE = "biotac view 'sim:press.toml?fingers=5'"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "source",
        metavar="PORT|RECORDING",
        nargs="?",
        help="as for the other verbs, or a .mcap (default: the only board on USB)",
    )
    parser.add_argument("--port", type=int, help=f"of the page (default {DEFAULT_PORT}, or a free one; 0: a free one)")
    parser.add_argument("--folder", type=Path, default=Path(), help="where recordings go (default: here)")
    parser.add_argument("--no-browser", action="store_true", help="only print the page's address")
    parser.add_argument(
        "--once", action="store_true", help="play once instead of again and again; the page stays until Ctrl-C"
    )


def run(args: argparse.Namespace) -> int:
    if args.port is not None and not 0 <= args.port <= 65535:
        raise InputError(f"--port is {args.port}, expected 0 to 65535")
    source = args.source or choose()
    from ...view.serving import Viewing  # here, because other verbs need no HTTP server

    viewing = Viewing(source, port=args.port, folder=args.folder, again=not args.once)
    with contextlib.closing(viewing):
        report(args, {"url": viewing.url, "source": source}, f"{viewing.url} shows {source}; Ctrl-C stops")
        if not args.no_browser:
            webbrowser.open(viewing.url)
        with contextlib.suppress(KeyboardInterrupt):  # the usual way to stop it
            viewing.wait()
    return 0
