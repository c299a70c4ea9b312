"""biotac lake check DIR, biotac lake sql QUERY DIR, and what biotac export --lake does"""

from __future__ import annotations

import argparse
import csv
import functools
import json
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

from ...errors import BiotacError, InputError, imported, printable
from .. import values
from ..outputs import note, report
from ..progress import Progress
from .check import largest_text

EXAMPLE = 'biotac lake sql "SELECT board, count(*) FROM frames GROUP BY board" trials.lake'


def add_export_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--lake", metavar="DIR", type=Path, help="a folder of Parquet files to add every REC to")
    _add_workers(parser)


def _add_workers(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-j", dest="jobs", metavar="N", type=values.count(1024), default=1, help="processes")
    parser.add_argument("--dask", metavar="ADDRESS", help="a Dask scheduler whose workers see the same files")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    add = functools.partial(values.add_subverb, parser.add_subparsers(dest="what", required=True, metavar="WHAT"))
    text = "Check all files against their checksums, and every on-board result against the float64 reference."
    check = add("check", run_check, text)
    check.add_argument("folder", metavar="DIR", type=Path, help="the lake")
    _add_workers(check)
    text = "Query with DuckDB; each topic is a table. Prints CSV, with --json one object per line."
    sql = add("sql", run_sql, text)
    sql.add_argument("query", metavar="QUERY", help='such as "SELECT max(force_z_n) FROM frames"')
    sql.add_argument("folder", metavar="DIR", nargs="?", type=Path, help="the lake")


def run_export(args: argparse.Namespace, sources: list[Path]) -> int:
    """Return 0 if all are in the lake, 2 if some are not: those are named, the others are in."""
    put = room("writing").put
    new: dict[str, int] = {}  # rows by recording
    listed: set[str] = set()
    failed: list[str] = []
    with room("folder").writing(args.lake) as lake:
        todo, force = [str(path.absolute()) for path in dict.fromkeys(sources)], args.force
        while todo:
            again = []
            for source, written in _all(functools.partial(put, str(args.lake.absolute()), force), todo, args, failed):
                if written.new:
                    lake.add(written.recording, written.sums)
                    new[written.recording] = written.rows
                elif written.path in lake.sums:
                    listed.add(written.recording)
                else:
                    again.append(source)  # a killed export wrote it, but did not list it
            todo, force = again, True
    facts = {
        "lake": str(args.lake),
        "exported": len(new),
        "already_there": len(listed - set(new)),
        "failed": failed,
        "rows": sum(new.values()),
    }
    text = f"{facts['exported']} exported, {facts['rows']} rows; {facts['already_there']} already there"
    report(args, facts, f"{printable(str(args.lake))}: {text}, {len(failed)} failed")
    return InputError.exit_code if failed else 0


def run_check(args: argparse.Namespace) -> int:
    """Return 0 if all is right, 1 if something is wrong, which is named. Raises (code 2) if it is no lake."""
    lake = room("folder").opened(args.folder)
    work = functools.partial(room("checking").check, str(args.folder.absolute()))
    failed: list[str] = []
    done = [checked for _, checked in _all(work, list(lake.recordings.items()), args, failed)]
    wrong = [text for checked in done for text in checked.wrong]
    wrong += [
        f"{args.folder / path} is not in the list of checksums; export again or remove it" for path in lake.unlisted
    ]
    good = not wrong and not failed and bool(done)
    names = ("poc_um_max", "force_mn_max", "torque_nmm_max")
    largest = {name: max((getattr(checked.outcome, name) for checked in done), default=0.0) for name in names}
    facts: dict[str, Any] = {
        "lake": str(args.folder),
        "good": good,
        "recordings": len(lake.recordings),
        "frames": sum(checked.outcome.frames for checked in done),
        "violations": sum(checked.outcome.violations for checked in done),
        "wrong": wrong,
        "failed": failed,
        **largest,
    }
    verdict = "good" if good else f"{len(wrong) + len(failed)} problem(s)" if done else "empty"
    text = f"{printable(str(args.folder))}: {facts['recordings']} recordings, {facts['frames']} frames, {verdict}; "
    lines = [*map(printable, wrong), text + largest_text(SimpleNamespace(**largest))]
    report(args, facts, "\n".join(lines))
    return 0 if good else 1


def run_sql(args: argparse.Namespace) -> int:
    folder = args.folder or Path()
    if args.folder is None and not (folder / room("folder").SUMS).is_file():
        raise InputError("this folder is not a lake; name the lake's folder: biotac lake sql QUERY DIR")
    lake = _opened(folder)
    names, rows = room("sql").query(lake, args.query)
    if args.json:
        for row in rows:
            print(json.dumps(dict(zip(names, row, strict=True)), default=str))
        return 0
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(names)
    out.writerows(rows)
    return 0


def _opened(folder: Path) -> Any:
    lake = room("folder").opened(folder)
    if lake.unlisted:
        note(f"{len(lake.unlisted)} file(s) of no finished export are ignored; export again")
    return lake


def _all(
    work: Callable[[Any], Any], items: list[Any], args: argparse.Namespace, failed: list[str]
) -> Iterator[tuple[Any, Any]]:
    """Each item that succeeds, with the result of ``work``, as they complete; ``failed`` gets the others' messages."""
    problems: dict[int, str] = {}
    with Progress() as progress:
        try:
            for done, (k, result) in enumerate(room("workers").each(work, items, args.jobs, args.dask), 1):
                if isinstance(result, BiotacError):
                    problems[k] = str(result)
                else:
                    yield items[k], result
                progress.show(f"{done} of {len(items)} done; Ctrl-C stops, run it again to finish")
        except KeyboardInterrupt:
            raise KeyboardInterrupt("run the same command again to finish") from None
    for _, text in sorted(problems.items()):
        failed.append(text)
        note(text)


def room(name: str) -> ModuleType:
    """A module of the lake. Raises InputError naming the extra that it needs."""
    return imported(f"biotac.lake.{name}", "a lake", "lake")
