"""What every experiment gives: options in, figures that JSON can hold, a page of markdown, checks against limits."""

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
    """What an experiment is told.

    ``seed`` chooses the emulated finger; with ``recording`` there is none, and ``finger`` is which of the
    recording's is meant. ``maps`` are files of fitted wrench maps to try beside the paper's model; ``show`` is
    told what is going on. ``real`` are recordings with their force to try beside the emulated finger; ``quick`` asks
    for a smaller run of the same, whose figures are worse.
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

    ``RECORDING`` says in words what a recording must hold, empty where none makes sense; ``MAPS`` whether
    wrench maps can be tried; ``REAL``, where there is one, whether Options.real and quick are for it. ``facts`` are
    JSON types only; ``page`` is built from nothing else, so that table and JSON cannot differ. Facts hold
    ``experiment``, ``source``, ``checks`` (of check()) and ``notes``.
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
    """That ``seen`` is at most ``limit``; NaN never is."""
    return {"what": what, "seen": number(seen), "limit": limit, "unit": unit, "met": bool(seen <= limit)}


def claim(what: str, holds: bool) -> Facts:
    """That something the paper says, or the issue asks, is so."""
    return {"what": what, "met": bool(holds)}


def verdicts(facts: Facts) -> list[str]:
    """The checks as lines of text."""
    lines = []
    for one in facts["checks"]:
        word = "met" if one["met"] else "NOT met"
        asked = f": {text(one['seen'])} {one['unit']}, at most {one['limit']:g}" if "limit" in one else ""
        lines.append(f"{word}: {one['what']}{asked}")
    return lines


def number(value: float) -> float | None:
    """For JSON, which has no NaN; four digits after the point, as many as a page shows."""
    return round(float(value), 4) if math.isfinite(value) else None


def numbers(values: Iterable[float]) -> list[float | None]:
    """number() of each."""
    return [number(value) for value in values]


def text(value: float | None, digits: int = 3) -> str:
    """For a table."""
    return "-" if value is None else f"{value:.{digits}f}"


def markdown(title: str, body: list[str], facts: Facts, picture: str) -> str:
    """The whole page; ``picture`` is the file name it shows."""
    lines = [f"# {title}", "", f"Source: {facts['source']}.", "", *body]
    if facts["checks"]:
        lines += ["## Checks", "", *[f"* {line}" for line in verdicts(facts)], ""]
    lines += ["## Taken for granted", "", *[f"* {note}" for note in facts["notes"]], ""]
    return "\n".join([*lines, f"![{title}]({picture})", ""])
