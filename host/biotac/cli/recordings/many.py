"""biotac export REC... DIR --partition"""

from __future__ import annotations

import argparse
import functools
from pathlib import Path

from ...errors import BiotacError, InputError, imported, printable
from ...export.workers import each
from ..outputs import note, report
from ..progress import Progress


def run(args: argparse.Namespace, paths: list[Path]) -> int:
    """Return 0 if all are in the folder, 2 if some are not: those are named, the others are in."""
    *sources, folder = paths
    if not sources:
        raise InputError(f"{folder} alone is given, expected REC... DIR; name the folder to write to, too")
    if folder.is_file():
        raise InputError(f"{folder} is a file; name the folder to write to after the recordings")
    partition = imported("biotac.export.partition", "--partition", "export").partition
    work = functools.partial(partition, folder=folder.absolute(), overwrite=args.force)
    items = [path.absolute() for path in dict.fromkeys(sources)]
    failed: dict[int, str] = {}
    exported = rows = 0
    with Progress() as progress:
        try:
            for done, (k, result) in enumerate(each(work, items, args.jobs), 1):
                if isinstance(result, BiotacError):
                    failed[k] = str(result)
                else:
                    exported += result.rows > 0
                    rows += result.rows
                progress.show(f"{done} of {len(items)} done; Ctrl-C stops, run it again to finish")
        except KeyboardInterrupt:
            raise KeyboardInterrupt("run the same command again to finish") from None
    for _, text in sorted(failed.items()):
        note(text)
    facts = {
        "folder": str(folder),
        "exported": exported,
        "already_there": len(items) - exported - len(failed),
        "failed": [text for _, text in sorted(failed.items())],
        "rows": rows,
    }
    text = f"{exported} exported, {rows} rows; {facts['already_there']} already there, {len(failed)} failed"
    report(args, facts, f"{printable(str(folder))}: {text}")
    return InputError.exit_code if failed else 0
