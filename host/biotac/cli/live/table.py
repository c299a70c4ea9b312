"""All fingers as a table updated in place, on a terminal with ``rich`` (the extra ``terminal``)."""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING, Any

import biotac

from ...wire.messages_gen import INVALID_COUNT, FrameFlags

if TYPE_CHECKING:
    from rich.table import Table

REDRAW_S = 0.1
COLUMNS = ("finger", "force x", "y", "z N", "|force| N", "point x", "y", "z mm", "pressure", "tac", "tdc", "notes")
#: Flags that are not shown, as they say only that a finger is at rest or a result was not asked for.
DULL = FrameFlags.CONTACT | FrameFlags.NOT_ASKED | FrameFlags.POC_INVALID


class LiveTable:
    """Call ``show`` as often as you like; use as a context manager. ``console`` is rich's; default stdout."""

    def __init__(self, hand: biotac.Hand, title: str, console: Any = None) -> None:
        from rich.live import Live

        self._hand = hand
        self._title = title
        self._due_s = 0.0
        self._live = Live(self._table("waiting for frames"), console=console, auto_refresh=False)

    def __enter__(self) -> LiveTable:
        self._live.start()
        return self

    def __exit__(self, *error: object) -> None:
        self._live.stop()

    def show(self, words: str, *, now: bool = False) -> None:
        """Draw the latest of each finger with ``words`` below, at most ten times a second unless ``now``."""
        now_s = time.monotonic()
        if now or now_s >= self._due_s:
            self._due_s = now_s + REDRAW_S
            self._live.update(self._table(words), refresh=True)

    def _table(self, words: str) -> Table:
        from rich.box import SIMPLE_HEAD
        from rich.table import Table

        stats = self._hand.stats
        health = f"{stats.frames_lost} lost, {stats.crc_errors} damaged"
        if stats.gaps:
            health += f", {stats.gaps} gap(s)"
        table = Table(box=SIMPLE_HEAD, title=self._title, caption=f"{words}; {health}", caption_justify="left")
        for name in COLUMNS:
            left = name in (COLUMNS[0], COLUMNS[-1])
            # Fixed widths, so that nothing moves.
            width = 30 if name == COLUMNS[-1] else 8 if left or "N" in name or "mm" in name else 7
            table.add_column(name, justify="left" if left else "right", width=width, no_wrap=True)
        for name in self._hand:
            row = cells(self._hand[name])
            table.add_row(name, *row, style="bold" if self._hand[name].touched else "dim")
        return table


def cells(finger: biotac.FingerView) -> list[str]:
    """A finger's values as text; an invalid one is a dash."""
    frame = finger.frame
    force_n, poc_mm = (v.tolist() for v in (frame.force_n, frame.poc_mm))
    strength_n = sum(v * v for v in force_n) ** 0.5
    doubts = [flag.name or "" for flag in FrameFlags if flag in frame.flags & ~DULL]
    return [
        *(number(v, 3) for v in (*force_n, strength_n)),
        *(number(v, 2) for v in poc_mm),
        *("-" if v == INVALID_COUNT else str(v) for v in (frame.pdc, frame.tac, frame.tdc)),
        ", ".join(doubts).lower(),
    ]


def number(value: float, digits: int) -> str:
    """``value`` with that many digits; a dash for NaN."""
    return "-" if value != value else f"{value:.{digits}f}"


def is_possible() -> bool:
    """Whether stdout is a terminal and rich is installed."""
    if not sys.stdout.isatty():
        return False
    try:
        import rich  # noqa: F401
    except ImportError:
        return False
    return True
