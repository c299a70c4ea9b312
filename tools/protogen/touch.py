"""The tare machine's thresholds: a header in C, and the tables of verdicts and thresholds in SPEC.md."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from .schema import c_header, tomllib

BEGIN, END = "<!-- verdicts: generated from touch.toml -->\n", "<!-- end of verdicts -->\n"


def load(root: Path) -> dict[str, Any]:
    """protocol/touch.toml, parsed."""
    return tomllib.loads((root / "protocol/touch.toml").read_text(encoding="utf-8"))


def header(table: dict[str, Any]) -> str:
    """Every threshold as a constant, with the reason."""
    about = ["The thresholds of the tare machine's verdicts: protocol/touch.toml."]
    body = [f"#define BT_{name.upper()} {entry['value']} // {entry['doc']}" for name, entry in table["limit"].items()]
    return c_header("TOUCH", about, body)


def spec(root: Path, table: dict[str, Any]) -> str:
    """SPEC.md with the table of verdicts by the thresholds, and the thresholds."""
    limits = {name: entry["value"] for name, entry in table["limit"].items()}
    rows = [f"| {v['to']} | {v['reason']} | {v['when'].format(**limits)} |\n" for v in table["verdict"]]
    head, rest = (root / "protocol/SPEC.md").read_text(encoding="utf-8").split(BEGIN)
    rows += ["\n| threshold | value | |\n|---|---|---|\n"]
    rows += [f"| `{name}` | {entry['value']} | {entry['doc']} |\n" for name, entry in table["limit"].items()]
    return head + BEGIN + "| to | reason | when |\n|---|---|---|\n" + "".join(rows) + END + rest.split(END)[1]
