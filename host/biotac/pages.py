"""What pages are made of: Markdown tables, and pictures."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import Any

from .errors import InputError


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Lines of a Markdown table."""
    return ["| " + " | ".join(row) + " |" for row in [head, ["---"] * len(head), *rows]]


def pyplot() -> Any:
    """matplotlib.pyplot, drawing into files. Raises InputError where it is not installed."""
    try:
        import matplotlib
    except ImportError as error:
        raise InputError(f"pictures need matplotlib ({error}); pip install 'biotac-gateway[plot]'") from error
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    return plt
