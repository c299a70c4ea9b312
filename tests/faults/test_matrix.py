"""The table of faults points at tests that there are."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest
import tomllib

ROOT = Path(__file__).parents[2]
ROWS: list[dict[str, Any]] = tomllib.loads(Path(__file__).with_name("matrix.toml").read_text())["row"]


@pytest.mark.parametrize("row", ROWS, ids=lambda row: row["fault"])
def test_a_row_says_what_must_happen_and_who_tries_it(row: dict[str, Any]) -> None:
    assert row["must"] and row["never"] and ("play" in row or row["tests"])
    for test in row.get("tests", []):
        file, name = test.split("::")
        text = (ROOT / file).read_text()
        assert not name or re.search(rf"^(def |static void |int ){name}\(", text, re.MULTILINE), test


def test_no_fault_stands_twice() -> None:
    assert len({row["fault"] for row in ROWS}) == len(ROWS)
