"""Tests speak to doors, not walls: they replace few names of this project, and read nothing that a connection hides."""

import ast
import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any

TESTS = Path(__file__).resolve().parents[1]
MOST = 20  #: names of this project that tests replace
OURS = {path.stem for folder in ("support", "../tools") for path in (TESTS / folder).rglob("*.py")}
PARTS = r"\b(board|hand|link|session|reader|recorder|connection|share|outlet)(\[0\])?\._(?!repr|ipy)[a-z_]+$"


@cache
def nodes(source: str) -> list[Any]:
    return list(ast.walk(ast.parse(source)))


def replaced(source: str) -> Iterator[str]:
    """Lines with setattr, delattr or an assignment to a module's or class's attribute, but of other projects' names."""
    theirs, ours = {"rclpy"}, set[str]()
    for node in nodes(source):
        for name in node.names if isinstance(node, ast.Import | ast.ImportFrom) else ():
            module = getattr(node, "module", None) or name.name
            is_own = module.startswith("biotac") or module in OURS
            (ours if is_own else theirs).add((name.asname or name.name).partition(".")[0])
    for node in nodes(source):
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") in ("setattr", "delattr"):
            first = ast.unparse(node.args[0]).partition(".")[0]
            is_own = first.startswith("'biotac") or not (first in theirs or first.startswith("'"))
        else:
            targets = [ast.unparse(one) for one in node.targets] if isinstance(node, ast.Assign) else []
            is_own = any("." in one and one.partition(".")[0] in ours for one in targets)
        if is_own:
            yield source.splitlines()[node.lineno - 1].strip()


def hidden(source: str) -> list[str]:
    private = (node for node in nodes(source) if isinstance(node, ast.Attribute) and node.attr[0] == "_")
    return [text for text in map(ast.unparse, private) if re.search(PARTS, text)]


def test_tests_speak_to_doors() -> None:
    sources = [path.read_text(encoding="utf-8") for path in sorted(TESTS.rglob("*.py")) if path != Path(__file__)]
    lines = [line for source in sources for line in replaced(source)]
    assert [line for line in lines if "  # " not in line] == [], "say at the line's end why no door shows it"
    assert len(lines) <= MOST, lines
    assert [text for source in sources for text in hidden(source)] == []


def test_what_speaks_to_walls_is_found() -> None:
    walls = [
        "m.setattr(stream, 'A', 1)",
        "m.setattr('biotac.a.B', 1)",
        "m.setattr(hand, 'tare', 1)",
        "Link.patience = 1",
    ]
    head = "import time\nfrom biotac.board import Link, stream\nm.setattr(time, 'sleep', 1)\n"
    assert {*replaced(head + "\n".join(walls))} == {*walls}
    assert hidden("hand._reader.rows\nself._board\nhand._repr_html_()") == ["hand._reader"]
