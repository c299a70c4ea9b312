"""A picture as a PNG, by matplotlib, which is imported only where something is drawn."""

from __future__ import annotations

import contextlib
import importlib.util
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .errors import InputError, installing


def check_drawable() -> None:
    """Raise InputError where matplotlib is missing: to be called before minutes of work, not after them."""
    if importlib.util.find_spec("matplotlib") is None:
        raise InputError(f"a picture needs matplotlib, which is not installed; {installing('plot')}")


@contextlib.contextmanager
def picture(path: Path) -> Iterator[Any]:
    """A matplotlib figure to draw in, written to ``path`` at the end. Raises InputError without matplotlib."""
    check_drawable()
    from matplotlib.figure import Figure  # without pyplot, a second of imports, no window can come of it

    page = Figure(layout="constrained")
    yield page
    page.savefig(path, dpi=100)
