"""biotac lake check DIR, biotac lake sql QUERY DIR, and what biotac export --lake does"""

from __future__ import annotations

import argparse
import csv
import functools
import json
import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from types import ModuleType
from typing import Any

from ...errors import BiotacError, InputError
from .. import values
from ..progress import Progress

EXAMPLE = 'biotac lake sql "SELECT board, count(*) FROM frames GROUP BY board" trials.lake'


def add_export_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the lake, and the number of workers."""
    parser.add_argument("--lake", metavar="DIR", type=Path, help="a folder of Parquet files to add every REC to")
    _add_workers(parser)


def _add_workers(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("-j", dest="jobs", metavar="N", type=values.count(1024), default=1, help="processes")
    parser.add_argument("--dask", metavar="ADDRESS", help="a Dask scheduler whose workers see the same files")


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the subverbs of a lake."""
    what = parser.add_subparsers(dest="what", required=True, metavar="WHAT")
    words = {
        "check": "Check all files against their seals, and every on-board result against the float64 reference.",
        "sql": "Query with DuckDB; each topic is a table. Prints CSV, or with --json one object per line.",
    }
    its = {name: what.add_parser(name, help=text, description=text) for name, text in words.items()}
    for name, one in its.items():
        one.add_argument("--json", action="store_true", default=argparse.SUPPRESS, help="print JSON for machines")
        if name == "sql":
            one.add_argument("query", metavar="QUERY", help='such as "SELECT max(force_z_n) FROM frames"')
        one.add_argument("folder", metavar="DIR", nargs="?" if name == "sql" else None, type=Path, help="the lake")
    _add_workers(its["check"])
    its["check"].set_defaults(action=run_check)
    its["sql"].set_defaults(action=run_sql)


def run(args: argparse.Namespace) -> int:
    """Run the subverb."""
    return int(args.action(args))


def run_export(args: argparse.Namespace, sources: list[Path]) -> int:
    """Return 0 if all are in the lake, 2 if some are not: those are named, the others are in."""
    lake_folder, writing = room("folder"), room("writing")
    lake = lake_folder.opened(args.lake, create=True)
    with lake_folder.sole_writer(args.lake):
        work = functools.partial(writing.put, str(args.lake.absolute()), lake.partition, args.force)
        done, failed = _all(work, [str(path.absolute()) for path in dict.fromkeys(sources)], args, "exported")
    new = {its.recording for its in done if its.new}
    facts = {
        "lake": str(args.lake),
        "exported": len(new),
        "already_there": len({its.recording for its in done} - new),
        "same_as_another": len(done) - len({its.recording for its in done}),
        "failed": failed,
        "rows": sum(sum(its.rows.values()) for its in done),
    }
    if args.json:
        print(json.dumps(facts))
    else:
        print(
            f"{args.lake}: {facts['exported']} exported, {facts['rows']} rows; {facts['already_there']} already there, "
            f"{facts['same_as_another']} duplicates, {len(failed)} failed"
        )
    return InputError.exit_code if failed else 0


def run_check(args: argparse.Namespace) -> int:
    """Return 0 if all is right, 1 if something is wrong, which is named. Raises (code 2): no lake, or foreign files."""
    lake = room("folder").opened(args.folder)
    work = functools.partial(room("checking").check, str(args.folder.absolute()), lake.topics, lake.partition)
    done, failed = _all(work, sorted(lake.partition), args, "checked")
    wrong = [text for its in done for text in its.wrong]
    for text in wrong if not args.json else ():
        print(text)
    good = not wrong and not failed and bool(done)
    facts: dict[str, Any] = {
        "lake": str(args.folder),
        "good": good,
        "recordings": len(lake.partition),
        "unfinished": lake.unfinished,
        "frames": sum(its.outcome.frames for its in done),
        "violations": sum(its.outcome.violations for its in done),
        "wrong": wrong,
        "failed": failed,
    }
    largest = {
        name: max((getattr(its.outcome, name) for its in done), default=0.0)
        for name in ("poc_um_max", "force_mn_max", "torque_nmm_max")
    }
    facts |= largest
    if args.json:
        print(json.dumps(facts))
    else:
        _warn_of_unfinished(lake)
        verdict = "good" if good else f"{len(wrong) + len(failed)} problem(s)" if lake.partition else "empty"
        poc_um, force_mn, torque_nmm = largest.values()
        print(
            f"{args.folder}: {facts['recordings']} recordings, {facts['frames']} frames, {verdict}; largest error "
            f"PoC {poc_um:.3f} um, force {force_mn:.4f} mN, torque {torque_nmm:.5f} N*mm"
        )
    return 0 if good else 1


def run_sql(args: argparse.Namespace) -> int:
    """Print the query's result."""
    here = Path()
    if args.folder is None and not (here / room("folder").RECORDINGS).is_dir():
        raise InputError("this folder is not a lake; name the lake's folder: biotac lake sql QUERY DIR")
    lake = room("folder").opened(args.folder or here)
    _warn_of_unfinished(lake)
    names, rows = room("sql").query(lake, args.query)
    if args.json:
        for row in rows:
            print(json.dumps(dict(zip(names, row, strict=True)), default=str))
        return 0
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(names)
    out.writerows(rows)
    return 0


def _warn_of_unfinished(lake: Any) -> None:
    if lake.unfinished:
        print(
            f"biotac: {lake.unfinished} file(s) of unfinished exports are ignored; export again",
            file=sys.stderr,
        )


def _all(
    work: Callable[[str], Any], items: list[str], args: argparse.Namespace, did: str
) -> tuple[list[Any], list[str]]:
    """The results of ``work``, and the messages about items that failed, both in the order of ``items``."""
    progress = Progress()
    results: dict[str, Any] = {}
    try:
        for item, result in room("workers").each(work, items, args.jobs, args.dask):
            results[item] = result
            progress.show(f"{len(results)} of {len(items)} {did}; Ctrl-C stops, run it again to finish")
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{len(results)} of {len(items)} {did}; run the same command again to finish") from None
    finally:
        progress.done()
    failed = [str(results[item]) for item in items if isinstance(results[item], BiotacError)]
    for text in failed:
        print(f"biotac: {text}", file=sys.stderr)
    return [its for item in items if not isinstance(its := results[item], BiotacError)], failed


def room(name: str) -> ModuleType:
    """A module of the lake. Raises InputError naming the extra that it needs."""
    try:
        return import_module(f"biotac.lake.{name}")
    except ImportError as error:
        raise InputError(
            f"a lake needs {error.name}, which is not installed; pip install 'biotac-gateway[lake]'"
        ) from error
