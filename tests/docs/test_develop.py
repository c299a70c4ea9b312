"""The pages for developers of this project: functions, calls and constants that they name are those of the code."""

import re
from functools import cache
from pathlib import Path

import pytest

from biotac.wire.messages_gen import TareReason, TareState

ROOT = Path(__file__).parents[2]
DEVELOP = ROOT / "host/docs/develop"
ROUND = (DEVELOP / "one_round.md").read_text(encoding="utf-8")
PICTURES = "".join((DEVELOP / name).read_text(encoding="utf-8") for name in re.findall(r"\((\w+\.svg)\)", ROUND))


@cache
def bodies() -> dict[str, str]:
    """By name, all bodies of functions of the firmware's C; of one that every port has, the declaration."""
    found: dict[str, str] = {}
    for path in sorted((ROOT / "firmware").rglob("*.[ch]")):
        text = path.read_text(encoding="utf-8")
        for name, body in re.findall(r"^[a-zA-Z][\w *]*?(\w+)\([^;{}]*\)(;|\n\{\n.*?^\})", text, flags=re.M | re.S):
            found[name] = found.get(name, "") + body
    return found


def calls() -> list[tuple[str, str]]:
    """Caller and called in the page's trees."""
    out, above = [], [""]
    for line in ROUND.splitlines():
        if tree := re.match(r"    ((?:  )*)(\w+)$", line):
            depth = len(tree[1]) // 2
            above[depth:] = [tree[2]]
            out += [(above[depth - 1], tree[2])] if depth else []
    return out


def test_every_function_that_is_named_is_one_and_is_called_from_where_the_page_says() -> None:
    named = set(re.findall(r"(\w+)\(\)", ROUND + PICTURES))
    assert len(named) > 15 and len(calls()) > 60
    assert named - set(bodies()) == set()
    assert [pair for pair in calls() if not re.search(rf"\b{pair[1]}\(", bodies().get(pair[0], ""))] == []


def test_the_state_chart_has_every_state_and_every_reason() -> None:
    names = set(re.findall(r"\b[A-Z_]{4,}\b", PICTURES))
    assert {state.name for state in TareState} <= names
    assert {reason.name for reason in TareReason} - {"NONE"} <= names


CONSTANTS = (DEVELOP / "constants.md").read_text(encoding="utf-8")
CORE = ROOT / "firmware/core"
CONSTANT_FILES = sorted(p for room in ("signal", "touch") for p in (CORE / room).glob("*.[ch]") if "_gen" not in p.name)


@pytest.mark.parametrize("path", [ROOT / "protocol/touch.toml", *CONSTANT_FILES], ids=lambda path: path.name)
def test_the_table_has_every_constant_with_its_value(path: Path) -> None:
    text = path.read_text(encoding="utf-8")
    found = re.findall(r"^#define (\w+) +(.*?) *(?://.*)?$", text, flags=re.M)
    found = found or re.findall(r"^(\w+) = \{ value = (\d+)", text, flags=re.M)
    heading = path.relative_to(CORE if CORE in path.parents else ROOT)
    section = re.search(rf"^## `{heading}`$(.*?)(?=^## |\Z)", CONSTANTS, flags=re.M | re.S)
    cells = re.findall(r"^\| (`.*?) \|", section[1] if section else "", flags=re.M)
    assert sorted(re.findall(r"`(.*?)`", ", ".join(cells))) == sorted(f"{name} {value}" for name, value in found)
    tests = re.findall(r"`(tests/[\w/.]+)`", section[1] if section else "")
    assert [test for test in tests if not (ROOT / test).exists()] == []
