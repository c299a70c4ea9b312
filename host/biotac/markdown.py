"""Tables in Markdown, and in HTML for notebooks."""

from __future__ import annotations

import html
from collections.abc import Sequence


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table, then the empty one that ends it."""
    return ["| " + " | ".join(row) + " |" for row in [head, ["---"] * len(head), *rows]] + [""]


def html_table(about: str, rows: Sequence[Sequence[str]]) -> str:
    """A line, then a table without a head."""
    lines = ("".join(f"<td>{html.escape(cell)}</td>" for cell in row) for row in rows)
    return f"{html.escape(about)}<table>{''.join(f'<tr>{line}</tr>' for line in lines)}</table>"
