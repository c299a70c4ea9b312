"""Tests speak to doors, not walls: they replace few names of this project, and read nothing that a connection hides."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

TESTS = Path(__file__).resolve().parents[1]
MOST = 20  #: names of this project that tests replace
OURS = {path.stem for folder in ("support", "../tools") for path in (TESTS / folder).rglob("*.py")}
#: A board, a session or a link, or a part of one, and an attribute of it that is nobody else's, notebooks' neither.
HIDDEN = re.compile(
    r"\b(board|hand|link|session|reader|recorder|connection|share|outlet)(\[0\])?\._(?!repr|ipy)[a-z_]+$"
)


def is_ours(module: str) -> bool:
    return module.startswith("biotac") or module in OURS


def replaced(source: str) -> Iterator[str]:
    """The lines that replace a name which is not another project's, by setattr or delattr, or by an assignment."""
    tree, theirs, ours = ast.parse(source), {"rclpy"}, set[str]()
    for node in ast.walk(tree):
        for name in node.names if isinstance(node, ast.Import | ast.ImportFrom) else ():
            is_own = is_ours(getattr(node, "module", None) or name.name)
            (ours if is_own else theirs).add((name.asname or name.name).partition(".")[0])
    for node in ast.walk(tree):
        if isinstance(node, ast.Call) and getattr(node.func, "attr", "") in ("setattr", "delattr"):
            of = ast.unparse(node.args[0]).strip("'").partition(".")[0]
            is_own = of not in theirs and (of in ours or is_ours(of) or not isinstance(node.args[0], ast.Constant))
        else:
            targets = [ast.unparse(one) for one in node.targets] if isinstance(node, ast.Assign) else []
            is_own = any("." in one and one.partition(".")[0] in ours for one in targets)
        if is_own:
            yield source.splitlines()[node.lineno - 1].strip()


def hidden(source: str) -> list[str]:
    """What is read of a connection's parts that begins with an underscore."""
    reads = (ast.unparse(node) for node in ast.walk(ast.parse(source)) if isinstance(node, ast.Attribute))
    return [text for text in reads if HIDDEN.search(text)]


def test_tests_speak_to_doors() -> None:
    sources = {path: path.read_text(encoding="utf-8") for path in sorted(TESTS.rglob("*.py")) if path != Path(__file__)}
    lines = [line for source in sources.values() for line in replaced(source)]
    assert [line for line in lines if "  # " not in line] == [], "say at the line's end why no door shows it"
    assert len(lines) <= MOST, lines
    assert {path.name: found for path, source in sources.items() if (found := hidden(source))} == {}


@pytest.mark.parametrize(
    "line",
    ["m.setattr(stream, 'A', 1)", "m.setattr('biotac.a.B', 1)", "m.setattr(hand, 'tare', 1)", "Link.patience = 1"],
)
def test_what_is_replaced_is_found(line: str) -> None:
    head = "import time\nfrom biotac.board import stream\nfrom biotac.link import Link\nm.setattr(time, 'sleep', 1)\n"
    assert list(replaced(head + line)) == [line]
    assert hidden("hand._reader.rows\nself._board\nhand._repr_html_()") == ["hand._reader"]
