"""What every experiment takes and gives: options, figures as JSON types, a Markdown page, checks against limits."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Protocol

Facts = dict[str, Any]
Show = Callable[[str], None]


@dataclass(frozen=True)
class Options:
    """Options of an experiment.

    ``seed`` chooses the emulated finger; with ``recording`` there is none, and ``finger`` chooses one of the
    recording's. ``maps`` are files of fitted wrench maps to try beside the paper's model; ``show`` is called with
    progress. ``real`` are recordings with their force to try beside the emulated finger; ``quick`` asks for a smaller
    run, with worse figures.
    """

    seed: int = 1
    recording: Path | None = None
    finger: int = 0
    maps: tuple[Path, ...] = ()
    real: tuple[Path, ...] = ()
    quick: bool = False
    show: Show = field(default=lambda text: None)


class Experiment(Protocol):
    """The module of an experiment, host/biotac/lab/experiments/NAME.py.

    ``RECORDING`` says in words what a recording must hold, empty where none makes sense; ``MAPS`` whether wrench maps
    can be tried; ``REAL``, where it exists, whether Options.real and quick apply. ``facts`` are JSON types only;
    ``page`` is built from nothing else, so that table and JSON cannot differ. Facts hold ``experiment``, ``source``,
    ``checks`` (from check() and claim()) and ``notes``.
    """

    @property
    def RECORDING(self) -> str: ...

    @property
    def MAPS(self) -> bool: ...

    def run(self, options: Options) -> Any: ...

    def facts(self, result: Any) -> Facts: ...

    def page(self, facts: Facts) -> list[str]: ...

    def draw(self, result: Any, figure: Any) -> None: ...


def check(what: str, seen: float, limit: float, unit: str) -> Facts:
    """A check that ``seen`` is at most ``limit``; NaN fails."""
    return {"what": what, "seen": number(seen), "limit": limit, "unit": unit, "met": bool(seen <= limit)}


def claim(what: str, holds: bool) -> Facts:
    """A check that something that the paper says, or that was asked for, holds."""
    return {"what": what, "met": bool(holds)}


def verdicts(facts: Facts) -> list[str]:
    """The checks as lines of text."""
    lines = []
    for one in facts["checks"]:
        word = "met" if one["met"] else "NOT met"
        if "limit" not in one:
            lines.append(f"{word}: {one['what']}")
            continue
        seen = f"{text(one['seen'])} {one['unit']}".rstrip()  # a count has no unit
        lines.append(f"{word}: {one['what']}: {seen}, at most {one['limit']:g}")
    return lines


def number(value: float) -> float | None:
    """``value`` for JSON: None for NaN, rounded to four decimals, as many as a page shows."""
    return round(float(value), 4) if math.isfinite(value) else None


def numbers(values: Iterable[float]) -> list[float | None]:
    """number() of each."""
    return [number(value) for value in values]


def text(value: float | None, digits: int = 3) -> str:
    """``value`` for a table."""
    return "-" if value is None else f"{value:.{digits}f}"


def markdown(title: str, body: list[str], facts: Facts, picture: str) -> str:
    """The whole page; ``picture`` is the name of the image file in it."""
    lines = [f"# {title}", "", f"Source: {facts['source']}.", "", *body]
    if facts["checks"]:
        lines += ["## Checks", "", *[f"* {line}" for line in verdicts(facts)], ""]
    lines += ["## Notes", "", *[f"* {note}" for note in facts["notes"]], ""]
    return "\n".join([*lines, f"![{title}]({picture})", ""])
