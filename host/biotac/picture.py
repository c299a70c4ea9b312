"""A picture as a PNG, by matplotlib, which is imported only where something is drawn."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .errors import InputError


@contextlib.contextmanager
def picture(path: Path) -> Iterator[Any]:
    """A matplotlib figure to draw in, written to ``path`` at the end. Raises InputError without matplotlib."""
    try:
        import matplotlib
    except ImportError:
        raise InputError("a picture needs the package matplotlib; install it: pip install matplotlib") from None
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    page = plt.figure(layout="constrained")
    try:
        yield page
        page.savefig(path, dpi=100)
    finally:
        plt.close(page)
