"""The table of the papers' methods, equations, tables and figures: complete, as measured, and in the page."""

from __future__ import annotations

import json
import re

import pytest

from biotac_lab.experiments import seeds
from biotac_lab.experiments.command import load
from biotac_lab.report import Options

KEPT = json.loads(seeds.KEPT.read_text(encoding="utf-8"))
CHEAP, SLOW = ("shear", "torsion"), ("torsion-shear", "poke", "tare", "navarro2015", "wettels2011")
NOISE = {"wettels2011": 0.15}  # share: nets end elsewhere with another BLAS


def numbers(text: str) -> set[int]:
    """1, 2 and 3 of "1 to 3", 1 and 2 of "1, 2"."""
    found: set[int] = set()
    for first, last in re.findall(r"(\d+)(?: to (\d+))?", text):
        found |= set(range(int(first), int(last or first) + 1))
    return found


@pytest.mark.parametrize(
    ("paper", "kind", "last"),
    [("lin2013", "Table", 2), ("lin2013", "Eq", 7), ("lin2013", "Fig", 10),
     ("navarro2015", "Table", 1), ("navarro2015", "Eq", 6), ("navarro2015", "Fig", 3),
     ("wettels2011", "Table", 4), ("wettels2011", "Eq", 7), ("wettels2011", "Fig", 13)],
)  # fmt: skip
def test_every_table_figure_and_equation_has_a_row(paper: str, kind: str, last: int) -> None:
    items = " ; ".join(row["item"] for row in seeds.ROWS[paper]).replace("Table I:", "Table 1:")
    texts = re.findall(rf"\b{kind} ((?:\d+(?: to |, )?)+)", items, re.IGNORECASE)
    assert set(range(1, last + 1)) <= set().union(*map(numbers, texts))
    for row in seeds.ROWS[paper]:
        assert row["verdict"].startswith(("right", "differs, because", "differs, but")), row["item"]
        assert ("experiment" in row) != ("command" in row) and (row["ours"] != "-" or "right:" in row["verdict"])


def test_all_figures_are_kept() -> None:
    """tests/docs/test_figures.py compares the page with the table."""
    for rows in seeds.ROWS.values():
        for row in rows:
            assert set(seeds.names(row)) <= set(KEPT.get(row.get("experiment", ""), {})), row["item"]
    assert not re.search(r"[{}]", " ".join(row[3] for row in seeds.table(KEPT).rows))


@pytest.mark.parametrize(
    "row", [r for rows in seeds.ROWS.values() for r in rows if "less" in r], ids=lambda r: r["item"]
)
def test_a_verdict_is_what_the_figures_say(row: dict) -> None:
    less, more = (KEPT[row["experiment"]][name] for name in row["less"])
    assert (less < more) == row["verdict"].startswith("right"), (less, more)


@pytest.mark.parametrize("name", [*CHEAP, *(pytest.param(name, marks=pytest.mark.nightly) for name in SLOW)])
def test_kept_figures_are_those_that_the_experiment_measures(name: str) -> None:
    found = seeds.measured(name, lambda text: None)
    assert found == pytest.approx(KEPT[name], rel=NOISE.get(name, 0.01), abs=0.02)


def test_a_finding_that_turns_round_is_not_met(monkeypatch: pytest.MonkeyPatch) -> None:
    facts = load("shear").run(Options()).facts("shear")
    (finding,) = seeds.findings("shear", facts)
    assert finding["met"] and "E1 377 to -276 counts" in finding["what"]
    row = next(row for row in seeds.ROWS["lin2013"] if row.get("experiment") == "shear")
    monkeypatch.setitem(row, "verdict", "differs, because it is a test")
    assert not seeds.findings("shear", facts)[0]["met"]
    with pytest.raises(KeyError, match=r"no figure Electrodes\|X\|E1: found None"):
        seeds.figure(facts, "Electrodes|X|E1")
