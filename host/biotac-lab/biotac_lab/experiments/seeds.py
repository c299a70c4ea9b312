"""Every method, equation, table and figure of the three papers beside ours: seeds.json, with measured figures.

    biotac-lab seeds                   the table, with the figures kept in figures.json
    biotac-lab seeds --measure poke    measure an experiment's anew, and keep them

A row has the paper's number and ours, the experiment or the command that shows it, and the criteria of the verdict
(verdict()). A figure, {TABLE|ROW|COLUMN:.2f}, is named by how these begin, or by keys of the experiment's JSON.

* ``theirs``: the paper's number by each figure of ours, ``within``: a tolerance in the figure's unit, and the source
* ``exact``: the tolerance that the command asserts, in words: within, or the command fails
* ``same``: pairs; in each the first is less than the second if we find the paper's effect, ``kind``: that effect
* ``why``: why it differs, ``shown``: by what evidence; without both, why is not known
* ``nothing``: the paper claims nothing here
"""

from __future__ import annotations

import argparse
import json
import re
from pathlib import Path
from typing import Any

from ..report import Facts, Options, Outcome, Show, Table, claim, of_tables

ABOUT = "Every method, equation, table and figure of the papers beside ours."
EXAMPLE = "biotac-lab seeds --measure poke"
ROWS: dict[str, list[Facts]] = json.loads(Path(__file__).with_suffix(".json").read_text(encoding="utf-8"))
KEPT = Path(__file__).with_name("figures.json")
FIGURE = re.compile(r"\{([^{}:]+(?:: [^{}:]+)*):([^{}]*)\}")
NAMES = {"lin2013": "Lin 2013", "navarro2015": "Navarro 2015", "wettels2011": "Wettels 2011"}


def rows_of(experiment: str) -> list[Facts]:
    """The rows that this experiment shows."""
    return [row for rows in ROWS.values() for row in rows if row.get("experiment") == experiment]


def names(row: Facts) -> list[str]:
    """The figures that a row needs."""
    pairs = [name for pair in row.get("same", ()) for name in pair if isinstance(name, str)]
    return [name for name, _ in FIGURE.findall(row["ours"])] + list(row.get("theirs", ())) + pairs


def verdict(row: Facts, figures: dict[str, float]) -> str:
    """Within tolerance; same in kind, and in which; or differs, and why: by the row's numbers alone."""
    theirs, same = row.get("theirs", {}), row.get("same", ())
    if "nothing" in row:
        return "-"
    if "exact" in row or (theirs and all(abs(figures[name] - his) <= row["within"][0] for name, his in theirs.items())):
        return "within tolerance"
    if same and all(figures.get(less, less) < figures.get(more, more) for less, more in same):
        return f"same in kind: {row['kind']}"
    return f"differs: {row['why']}; shown by {row['shown']}" if "shown" in row else "differs: why is not known"


def _tolerance(row: Facts) -> str:
    if "theirs" in row:
        return "{:g} {}".format(*row["within"])
    other = "the paper has no number" if "same" in row else "not a number"
    why = "the paper claims nothing" if "nothing" in row else other
    return row.get("exact", f"none: {why}")  # type: ignore[no-any-return]


def figure(facts: Facts, name: str) -> float:
    """The figure of that name in an experiment's JSON. Raises KeyError that names the missing part."""
    first, *keys = name.split("|")
    now: Any = facts.get(first) or next((found for found in facts["tables"] if found["title"].startswith(first)), None)
    for key in keys:
        now = _within(now, key)
    if not isinstance(now, int | float):
        raise KeyError(f"no figure {name}: found {now!r}")
    return now


def _within(now: Any, key: str) -> Any:
    if isinstance(now, list):
        return now[int(key)] if key.isdigit() else next((row for row in now if key in _texts(row.values())), None)
    if isinstance(now, dict) and "head" in now:
        rows = (row for row in now["rows"] if _texts(row).startswith(key))
        return next((dict(zip(now["head"], row, strict=True)) for row in rows), None)
    return next((value for name, value in (now or {}).items() if name.startswith(key)), None)


def _texts(cells: Any) -> str:
    return ", ".join(str(cell) for cell in cells if isinstance(cell, str | int))


def findings(experiment: str, facts: Facts) -> list[Facts]:
    """A check for each finding of an experiment that can turn round: the verdict is that of the stored figures."""
    found, kept = [], _kept().get(experiment, {})
    for row in (row for row in rows_of(experiment) if "same" in row or "theirs" in row):
        now = {name: figure(facts, name) for name in names(row)}
        said = verdict(row, now)
        text = f"{row['item']}. Theirs: {row['his']}; ours: {_filled(row, now)}; {said}"
        found.append(claim(text, set(names(row)) <= set(kept) and said == verdict(row, kept)))
    return found


def _kept() -> dict[str, dict[str, float]]:
    kept: dict[str, dict[str, float]] = json.loads(KEPT.read_text(encoding="utf-8")) if KEPT.exists() else {}
    return kept


def _filled(row: Facts, figures: dict[str, float]) -> str:
    return FIGURE.sub(lambda match: format(figures[match[1]], match[2]) if match[1] in figures else "-", row["ours"])


def table(kept: dict[str, dict[str, float]]) -> Table:
    """All rows, with the figures by experiment."""
    rows = []
    for paper, group in ROWS.items():
        for row in group:
            figures = kept.get(row.get("experiment", ""), {})
            command = row.get("command") or f"biotac-lab experiment {row['experiment']}"
            said = verdict(row, figures) if set(names(row)) <= set(figures) else "not measured"
            rows.append([NAMES[paper], row["item"], row["his"], _filled(row, figures), _tolerance(row),
                         command.join("``") if command != "-" else "-", said])  # fmt: skip
    head = ["paper", "what", "theirs", "ours", "tolerance, and its source", "shown by", "verdict"]
    text = 'Ours are an emulated finger\'s, but where a recording is named: "within" says that the methods agree.'
    return Table("Every method, equation, table and figure", head, rows, text)


def measured(experiment: str, show: Show) -> dict[str, float]:
    """An experiment's figures, with the usual options."""
    from .command import load

    facts = load(experiment).run(Options(show=show)).facts(experiment)
    return {name: figure(facts, name) for row in rows_of(experiment) for name in names(row)}


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the measured experiment."""
    known = sorted({row["experiment"] for rows in ROWS.values() for row in rows if "experiment" in row})
    text = f"run this experiment and keep its figures; may be repeated: {', '.join(known)}"
    parser.add_argument("--measure", metavar="NAME", action="append", choices=known, default=[], help=text)


def run(args: argparse.Namespace, show: Show) -> Outcome:
    """The table, with the measured figures."""
    kept = _kept()
    for experiment in args.measure:
        kept[experiment] = measured(experiment, show)
    if args.measure:
        KEPT.write_text(json.dumps(kept, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    made = table(kept)
    return of_tables([made], made.facts())
