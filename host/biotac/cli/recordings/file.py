"""biotac file cut|recover|label"""

from __future__ import annotations

import argparse
from pathlib import Path

from ...errors import InputError, printable
from ...partial_file import whole
from ...recording.rewrite import cut
from ...recording.summary import label_line, labels
from .. import values
from ..outputs import report
from .loading import code, load

EXAMPLE = "biotac file label grasp.mcap slip --at 12.5 --fact trial=3"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    verbs = parser.add_subparsers(dest="what", required=True, metavar="cut|recover|label")
    for name, text in (
        ("cut", "write some seconds of REC, to whole blocks of about a second, as a recording"),
        ("recover", "write what is readable of a damaged or cut-off REC as a recording with an index"),
    ):
        verb = values.add_subverb(verbs, name, run_cut, text)
        verb.add_argument("recording", metavar="REC", type=Path)
        verb.add_argument("out", metavar="OUT", type=Path)
        if name == "cut":
            verb.add_argument(
                "--from", dest="from_s", type=values.moment, default=0.0, help="seconds since its first row"
            )
            verb.add_argument("--to", dest="to_s", type=values.moment, help="seconds since its first row")
        verb.add_argument("--force", action="store_true", help="overwrite OUT")
        verb.set_defaults(from_s=0.0, to_s=None)
    text = "add a label to REC, in a file beside it, or remove one; without TEXT, list them"
    verb = values.add_subverb(verbs, "label", run_label, text)
    verb.add_argument("recording", metavar="REC", type=Path)
    verb.add_argument("text", metavar="TEXT", nargs="?")
    verb.add_argument(
        "--at", dest="at_s", type=values.moment, help="seconds since its first row (default: about all of it)"
    )
    verb.add_argument("--until", dest="until_s", type=values.moment, help="the end of a span")
    verb.add_argument("--finger", help="name or number (default: all)")
    verb.add_argument("--fact", metavar="NAME=VALUE", action="append", default=[], help="subject=S07, for one")
    verb.add_argument("--remove", action="store_true", help="remove the labels of this TEXT; with --at, that one")


def run_cut(args: argparse.Namespace) -> int:
    recording = load(args.recording)
    with whole(args.out, overwrite=args.force, sources=[args.recording]) as path:
        begin_s, end_s = cut(recording, path, args.from_s, args.to_s)
    facts = {"written": str(args.out), "begin_s": begin_s, "end_s": end_s}
    report(args, facts, printable(f"{begin_s:.2f} to {end_s:.2f} s of {args.recording} to {args.out}"))
    return code(recording) if args.what == "cut" else 0


def run_label(args: argparse.Namespace) -> int:
    recording = load(args.recording, quiet=True)
    finger = int(args.finger) if (args.finger or "").isdecimal() else args.finger
    if args.text is None:
        facts = labels(recording)
        report(args, facts, "\n".join(printable(label_line(fact)) for fact in facts) or f"{args.recording}: no labels")
        return 0
    if not args.text and not args.fact and not args.remove:
        raise InputError("a label without a word: expected TEXT or --fact NAME=VALUE")
    if args.remove:
        recording.unmark(args.text, args.at_s)
    else:
        try:
            recording.mark(args.text, args.at_s, args.until_s, finger=finger, **values.facts(args.fact))
        except KeyError as error:
            raise InputError(str(error.args[0])) from None
    made = len(recording.labels)
    report(args, {"labels": made}, printable(f"{args.recording}: {made} label(s); `biotac info` lists them"))
    return 0
