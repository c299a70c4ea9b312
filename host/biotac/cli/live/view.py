"""biotac view PORT|RECORDING"""

from __future__ import annotations

import argparse
import contextlib
import json
import sys
import webbrowser
from dataclasses import asdict
from pathlib import Path

from ...errors import InputError
from ...link.discovery import choose
from ...view import DEFAULT_PORT

EXAMPLE = "biotac view 'sim:press.toml?fingers=5'"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add what to show, and where."""
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
        "--once", action="store_true", help="play a recording or scenario once; the page stays until Ctrl-C"
    )
    parser.add_argument(
        "--check", action="store_true", help="fetch the page and its first events, check them, and exit"
    )


def run(args: argparse.Namespace) -> int:
    """Serve until Ctrl-C."""
    if args.check:
        return _check(as_json=args.json)
    if args.port is not None and not 0 <= args.port <= 65535:
        raise InputError(f"--port is {args.port}, expected 0 to 65535")
    source = args.source or choose()
    from ...view.serving import Viewing  # here, because other verbs need no HTTP server

    with Viewing(source, port=args.port, folder=args.folder, again=not args.once) as viewing:
        print(json.dumps({"url": viewing.url, "source": source}) if args.json else f"{viewing.url} shows {source}")
        if not args.json:
            print("Ctrl-C stops", file=sys.stderr)
        sys.stdout.flush()
        if not args.no_browser:
            webbrowser.open(viewing.url)
        with contextlib.suppress(KeyboardInterrupt):  # the usual way to stop it
            viewing.wait()
    return 0


def _check(*, as_json: bool) -> int:
    from ...view.check import check

    checked = check()
    if as_json:
        print(json.dumps(asdict(checked)))
    else:
        verdict = "; ".join(checked.problems) or "good"
        print(
            f"page of {checked.files} files, {checked.bytes} bytes; {checked.fingers} fingers, "
            f"{checked.frames} frames; checks: {verdict}"
        )
    return 1 if checked.problems else 0
