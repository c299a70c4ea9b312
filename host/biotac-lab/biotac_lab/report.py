"""An experiment's inputs and outputs: options, and a report of tables, checks and a picture.

Page and JSON are made from the same tables, so that they cannot differ.
"""

from __future__ import annotations

import contextlib
import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from biotac import InputError

Facts = dict[str, Any]
Show = Callable[[str], None]


@dataclass(frozen=True)
class Options:
    """Options of an experiment.

    ``seed`` chooses the emulated finger; with ``recording`` there is none, and ``finger`` chooses one of the
    recording's. ``maps`` are files of fitted wrench maps to try beside the paper's model; ``show`` is called with
    progress. ``real`` are recordings with their force to try beside the emulated finger; ``quick`` asks for a smaller
    run, with worse figures, ``filter`` for the paper's low-pass.
    """

    seed: int = 1
    recording: Path | None = None
    finger: int = 0
    maps: tuple[Path, ...] = ()
    real: tuple[Path, ...] = ()
    quick: bool = False
    filter: bool = False
    show: Show = field(default=lambda text: None)

    @property
    def source(self) -> str:
        """The finger or recording, in words."""
        return str(self.recording) if self.recording is not None else f"emulated finger, seed {self.seed}"


@dataclass(frozen=True)
class Table:
    """Rows of texts and numbers; ``digits`` are the decimals on a page, None and NaN are shown as -."""

    title: str
    head: Sequence[str]
    rows: Sequence[Sequence[Any]]
    text: str = ""
    digits: int = 3

    def facts(self) -> Facts:
        """As JSON types, rounded to four decimals."""
        return {"title": self.title, "head": list(self.head), "rows": [[plain(c) for c in row] for row in self.rows]}

    def page(self) -> list[str]:
        """As Markdown."""
        cells = [[self._cell(value) for value in row] for row in self.rows]
        lines = ["| " + " | ".join(row) + " |" for row in [list(self.head), ["---"] * len(self.head), *cells]]
        return [f"## {self.title}", "", *([self.text, ""] if self.text else []), *lines, ""]

    def _cell(self, value: Any) -> str:
        value = plain(value)
        if value is None:
            return "-"
        return f"{value:.{self.digits}f}" if isinstance(value, float) else str(value)


def plain(value: Any) -> Any:
    """As a JSON type: None for NaN, numbers rounded to four decimals."""
    if value is None or isinstance(value, str | int):
        return value
    return round(float(value), 4) if math.isfinite(value) else None


@dataclass(frozen=True)
class Outcome:
    """A verb's output, as Markdown or as JSON types, and whether all limits are ``met`` that --check asks for."""

    page: str
    facts: Any
    met: bool = True


def of_tables(tables: Sequence[Table], facts: Any, *, met: bool = True) -> Outcome:
    """The outcome of a verb with a page of tables."""
    return Outcome("\n".join(line for table in tables for line in table.page()), facts, met)


@dataclass(frozen=True)
class Report:
    """``figures`` are JSON types beside the tables, for programs; ``draw`` draws the picture into a figure."""

    source: str
    tables: list[Table]
    checks: list[Facts]
    notes: list[str]
    draw: Callable[[Any], None]
    figures: Facts = field(default_factory=dict)

    def facts(self, name: str) -> Facts:
        """All of it as JSON types."""
        tables = [table.facts() for table in self.tables]
        more = {"tables": tables, "checks": self.checks, "notes": self.notes}
        return {"experiment": name, "source": self.source, **self.figures, **more}

    def page(self, name: str, about: str) -> str:
        """As Markdown."""
        lines = [f"# {name}: {about}", "", f"Source: {self.source}.", ""]
        lines += [line for table in self.tables for line in table.page()]
        for title, items in (("Checks", self.verdicts()), ("Notes", self.notes)):
            lines += [f"## {title}", "", *[f"* {item}" for item in items], ""] if items else []
        return "\n".join(lines)

    def outcome(self, name: str, about: str, out: Path | None = None, *, overwrite: bool = False) -> Outcome:
        """To be printed; and written into the folder ``out``, if there is one. Raises InputError."""
        written = [] if out is None else [str(path) for path in write(self, out, name, about, overwrite=overwrite)]
        page = self.page(name, about) + "".join(f"\nwritten: {path}" for path in written)
        met = all(item["met"] for item in self.checks)
        return Outcome(page, self.facts(name) | {"written": written}, met)

    def verdicts(self) -> list[str]:
        """The checks as lines of text."""
        return [("met: " if item["met"] else "NOT met: ") + item["what"] + _against(item) for item in self.checks]


def _against(item: Facts) -> str:
    if "limit" not in item:
        return ""
    seen = "-" if item["seen"] is None else f"{item['seen']:.3f}"
    return f": {seen} {item['unit']}".rstrip() + f", at most {item['limit']:g}"


def check(subject: str, seen: float, limit: float, unit: str) -> Facts:
    """A check that ``seen`` is at most ``limit``; NaN fails."""
    return {"what": subject, "seen": plain(float(seen)), "limit": limit, "unit": unit, "met": bool(seen <= limit)}


def claim(subject: str, holds: bool) -> Facts:
    """A check that something that the paper says, or that was asked for, holds."""
    return {"what": subject, "met": bool(holds)}


@contextlib.contextmanager
def picture(path: Path) -> Iterator[Any]:
    """A matplotlib figure to draw in, written to ``path`` at the end."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure = plt.figure(layout="constrained")
    try:
        yield figure
        figure.savefig(path, dpi=100)
    finally:
        plt.close(figure)


def write(report: Report, folder: Path, name: str, about: str, *, overwrite: bool) -> list[Path]:
    """NAME.md, NAME.png and NAME.json in ``folder``. Raises InputError."""
    page, drawn, facts = check_free(folder, name, overwrite=overwrite)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        page.write_text(f"{report.page(name, about)}\n![{about}]({drawn.name})\n", encoding="utf-8")
        facts.write_text(json.dumps(report.facts(name), indent=1) + "\n", encoding="utf-8")
        with picture(drawn) as figure:
            report.draw(figure)
    except OSError as error:
        raise InputError(f"{error.filename} cannot be written ({error.strerror}); choose another folder") from error
    return [page, drawn, facts]


def check_file(path: Path | None, *, overwrite: bool) -> None:
    """Raises InputError for a file that exists and may not be overwritten: before the work."""
    if path is not None and path.exists() and not overwrite:
        raise InputError(f"{path} exists; overwrite it (--force) or choose another name")


def check_free(folder: Path, name: str, *, overwrite: bool) -> list[Path]:
    """The files of write(). Raises InputError for one that exists and may not be overwritten."""
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is not a folder; choose another name")
    files = [folder / f"{name}.{ending}" for ending in ("md", "png", "json")]
    for path in files:
        check_file(path, overwrite=overwrite)
    return files
