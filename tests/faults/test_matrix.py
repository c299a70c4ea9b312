"""The table of faults points at tests that there are."""

import ast
import re
from pathlib import Path
from typing import Any

import pytest

from biotac.documents import tomllib

ROOT = Path(__file__).parents[2]
RIGS = {name: tomllib.loads((ROOT / f"tests/hil/rigs/{name}.toml").read_text()) for name in ("sim", "pico_emulated")}
ROWS: list[dict[str, Any]] = tomllib.loads(Path(__file__).with_name("matrix.toml").read_text())["row"]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["fault"])
def test_a_row_says_what_must_happen_and_who_tries_it(row: dict[str, Any]) -> None:
    assert row["must"] and row["never"] and ("play" in row or row["tests"])
    for test in row.get("tests", []):
        file, name = test.split("::")
        text = (ROOT / file).read_text()
        assert not name or re.search(rf"^(def |static void |int |TEST\(){name}[()]", text, re.MULTILINE), test


def needs(file: Path, function: str) -> set[object]:
    """Abilities that a test of tests/hil asks of the rig: by itself, by fixtures and by calls in the same file."""
    tree = ast.parse(file.read_text())
    known = {node.name: node for node in tree.body if isinstance(node, (ast.FunctionDef, ast.ClassDef))}
    found: set[object] = set()
    ahead, seen = [function], set()
    while ahead:
        name = ahead.pop()
        seen.add(name)
        for node in ast.walk(known[name]):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == "rig.need":
                where = (
                    node.args if isinstance(node.args[0], ast.Constant) else known[name].decorator_list
                )  # parameters
                found |= {one.value for part in where for one in ast.walk(part) if isinstance(one, ast.Constant)}
            word = node.id if isinstance(node, ast.Name) else node.arg if isinstance(node, ast.arg) else ""
            if word in known and word not in seen:
                ahead.append(word)
    return found


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["fault"])
@pytest.mark.parametrize("rig", RIGS)
def test_a_row_is_tried_on_each_rig_or_says_why_not(row: dict[str, Any], rig: str) -> None:
    cannot = RIGS[rig].get("cannot", {})
    tests = [test.split("::") for test in row.get("tests", []) if test.startswith("tests/hil/")]
    tried = "play" in row or any(not needs(ROOT / file, name) & set(cannot) for file, name in tests)
    why = row.get("not_on", {})
    assert tried != bool(why if isinstance(why, str) else why.get(rig)), f"{row['fault']}: on {rig}"


def test_no_fault_stands_twice() -> None:
    assert len({row["fault"] for row in ROWS}) == len(ROWS)
