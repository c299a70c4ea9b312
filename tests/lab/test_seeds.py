"""The table of the papers' methods, equations, tables and figures: complete, as measured, and in the page."""

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
        assert ("experiment" in row) != ("command" in row) and (row["ours"] != "-" or "nothing" in row)
        assert any(key in row for key in ("nothing", "exact", "theirs", "same", "why")), row["item"]
        assert ("theirs" in row) == ("within" in row) and ("same" in row) == ("kind" in row)
        assert ("why" in row) == ("shown" in row) and "less" not in row and "verdict" not in row
        assert "exact" not in row or "command" in row, "an experiment's numbers are compared, not said to be exact"


def test_all_figures_are_kept() -> None:
    """tests/docs/test_figures.py compares the page with the table."""
    for rows in seeds.ROWS.values():
        for row in rows:
            assert set(seeds.names(row)) <= set(KEPT.get(row.get("experiment", ""), {})), row["item"]
    assert not re.search(r"[{}]", " ".join(row[3] for row in seeds.table(KEPT).rows))


@pytest.mark.parametrize(
    ("figures", "said"),
    [({"a": 1.1, "b": 3.0}, "within tolerance"), ({"a": 1.3, "b": 3.0}, "same in kind: a is less"),
     ({"a": 5.0, "b": 3.0}, "differs: c; shown by d")],
)  # fmt: skip
def test_a_verdict_follows_from_number_tolerance_and_the_papers_figure(figures: dict, said: str) -> None:
    row = {"theirs": {"a": 1.0}, "within": [0.2, "N"], "same": [["a", "b"]], "kind": "a is less"}
    row |= {"why": "c", "shown": "d"}
    assert seeds.verdict(row, figures) == said
    del row["theirs"]
    assert seeds.verdict(row, {"a": 1.0, "b": 3.0}).startswith("same in kind"), "less is not within"
    assert seeds.verdict({"same": [["a", 0.5]], "kind": "-"}, {"a": 1.0}) == "differs: why is not known"


@pytest.mark.parametrize("name", [*CHEAP, *(pytest.param(name, marks=pytest.mark.nightly) for name in SLOW)])
def test_kept_figures_are_those_that_the_experiment_measures(name: str) -> None:
    found = seeds.measured(name, lambda text: None)
    assert found == pytest.approx(KEPT[name], rel=NOISE.get(name, 0.01), abs=0.02)


def test_a_finding_that_turns_round_is_not_met(monkeypatch: pytest.MonkeyPatch) -> None:
    facts = load("shear").run(Options()).facts("shear")
    finding = seeds.findings("shear", facts)[0]
    assert finding["met"] and "E1 358 to -431 counts" in finding["what"]
    row = next(row for row in seeds.ROWS["lin2013"] if row.get("experiment") == "shear")
    monkeypatch.setitem(row, "same", [pair[::-1] for pair in row["same"]])
    now = seeds.findings("shear", facts)[0]
    assert now["met"] and "differs: why is not known" in now["what"], "the figures kept say so, too"
    for table in facts["tables"]:
        table["rows"] = [[cell if isinstance(cell, str | None) else -cell for cell in row] for row in table["rows"]]
    assert not seeds.findings("shear", facts)[0]["met"]
    with pytest.raises(KeyError, match=r"no figure Electrodes\|X\|E1: found None"):
        seeds.figure(facts, "Electrodes|X|E1")
