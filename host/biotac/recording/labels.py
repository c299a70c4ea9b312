"""Labels of a recording: notes, marks and spans, made while it was recorded or afterwards.

Those made live are in the blocks of the recording itself. Later ones go to a file beside it, ``press.labels.jsonl`` for
``press.mcap``, a line each, so that the recording is never rewritten and a crash costs at most the last line. A line
names the recording by its start, so that another one of the same name does not inherit it. A label that is removed is
named once more, as ``removed``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..board.gap import Gap
from ..errors import InputError, RecordingError, printable
from ..wire.frames import StructArray

MAX_BYTES = 16 << 20  # of the file beside a recording: a hundred thousand labels
AROUND_US = 500_000  # of a point, to both sides, where rows are selected by it


@dataclass(frozen=True)
class Label:
    """``text`` at device time ``t_us``, or until ``end_us``; without ``t_us``, about the whole recording.

    ``finger`` is the chip select it is about, None for all. ``facts`` are texts and numbers by name, such as the
    subject, the trial, or ``video_s``, the time in a video. A later label of the same text, time and finger replaces an
    earlier one.
    """

    text: str
    t_us: int | None = None
    end_us: int | None = None
    finger: int | None = None
    facts: Mapping[str, str | float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        numbers = (self.t_us, self.end_us, self.finger)
        good = isinstance(self.text, str) and all(n is None or (type(n) is int and abs(n) < 2**62) for n in numbers)
        if not good or not all(isinstance(v, (str, int, float)) for v in self.facts.values()):
            raise InputError(f"a label is a text with whole times and facts that are texts or numbers, not {self!r}")
        if self.end_us is not None and (self.t_us is None or self.end_us < self.t_us):
            raise InputError(f"label {self.text!r} ends before it begins")
        try:
            " ".join([self.text, *(f"{name}={value}" for name, value in self.facts.items())]).encode()
        except UnicodeEncodeError as error:
            subject = f"the label {self.text!r} with the facts {dict(self.facts)!r} is"
            raise InputError(f"{subject} not UTF-8 ({error.reason}); write it so") from None
        object.__setattr__(self, "text", printable(self.text))

    def line(self) -> str:
        """The text and the facts in a line."""
        return printable(" ".join([self.text, *(f"{name}={value}" for name, value in self.facts.items())]).strip())


def beside(recording: Path) -> Path:
    """The file of the labels that were made afterwards."""
    return recording.with_suffix(".labels.jsonl")


def append(recording: Path, begin_ns: int, label: Label, *, removed: bool = False) -> None:
    """Add a line for the recording that began at ``begin_ns``. Raises InputError where it cannot be written."""
    removal = {"removed": True} if removed else {}
    try:
        with beside(recording).open("a+b") as file:
            end = file.seek(0, 2)
            file.seek(max(0, end - 1))
            torn = file.read() not in (b"", b"\n")  # a kill in the middle of a line
            line = json.dumps({"recording": begin_ns} | removal | asdict(label)).encode()
            file.write(b"\n" * torn + line + b"\n")
    except OSError as error:
        raise InputError(f"{beside(recording)} cannot be written ({error.strerror})") from error


def read(recording: Path, begin_ns: int, live: Iterable[Label] = ()) -> tuple[list[Label], list[str]]:
    """A recording's labels, and in words the lines beside it that belong to another.

    By time, those about the whole recording first; of the same text, time and finger only the last.
    """
    latest = {(label.text, label.t_us, label.finger): label for label in live}
    path = beside(recording)
    if not os.path.isfile(path):  # nor can be: a name may be too long with this suffix
        return _in_order(latest.values()), []
    if (size := path.stat().st_size) > MAX_BYTES:
        raise RecordingError(f"{path} has {size} bytes, expected at most {MAX_BYTES}; split the recording")
    problems = []
    for k, line in enumerate(path.read_bytes().splitlines()):
        try:
            facts = json.loads(line)
            if facts.pop("recording") != begin_ns:
                problems.append(f"line {k + 1} of {path.name} is about another recording of that name")
                continue
            removed = facts.pop("removed", False)
            label = Label(**facts)
            latest[label.text, label.t_us, label.finger] = label
            if removed:
                del latest[label.text, label.t_us, label.finger]
        except (ValueError, TypeError, KeyError, AttributeError, RecursionError, InputError):
            problems.append(f"line {k + 1} of {path.name} is damaged and was skipped")
    return _in_order(latest.values()), problems


def _in_order(labels: Iterable[Label]) -> list[Label]:
    return sorted(labels, key=lambda label: -1 if label.t_us is None else label.t_us)


def spans_us(labels: list[Label], wanted: str | Iterable[str], begin_us: int) -> list[tuple[int, int]]:
    """Times in us from the first to the last row of labels of these texts, joined where they meet.

    A point reaches half a second to both sides; none is before ``begin_us``, the first row's. Raises InputError for a
    text that no timed label has.
    """
    names = {wanted} if isinstance(wanted, str) else set(wanted)
    timed = [label for label in labels if label.t_us is not None]
    if missing := sorted(names - {label.text for label in timed}):
        texts = ", ".join(sorted({repr(label.text) for label in timed})) or "none"
        raise InputError(f"no label {missing[0]!r} with a time: expected one or more of {texts}")
    spans: list[tuple[int, int]] = []
    for label in timed:
        if label.text in names and label.t_us is not None:
            reach, at_us = AROUND_US if label.end_us is None else 0, max(label.t_us, begin_us)
            begin, end = at_us - reach, max(at_us, label.end_us or at_us) + reach
            if spans and begin <= spans[-1][1]:
                before = spans.pop()
                begin, end = before[0], max(end, before[1])
            spans.append((begin, end))
    return spans


# ---- the rows of a table at which labels and gaps hold: none is lost for want of a row at that time -------

_NEXT_US = 1_000_000  # A point holds at each finger's next row, if it comes within this.

#: Times of each finger's rows in a whole recording, in order.
Times = Mapping[int, NDArray[np.int64]]


def times_of(finger: NDArray[np.uint8], t_us: NDArray[np.int64]) -> Times:
    """Times of a recording's rows (n,), by finger."""
    return {f: np.sort(t_us[finger == f]) for f in np.unique(finger).tolist()}


class _Rows:
    """Some of a recording's rows, which may have labels and gaps."""

    def __init__(self, rows: StructArray) -> None:
        self._order = {}
        for finger in np.unique(rows["finger"]).tolist():
            own = np.flatnonzero(rows["finger"] == finger)
            own = own[np.argsort(rows["t_us"][own], kind="stable")]
            self._order[finger] = own, rows["t_us"][own]

    def between(self, finger: int, begin_us: float, end_us: float) -> NDArray[np.intp]:
        rows, t_us = self._order.get(finger, (np.empty(0, np.intp), np.empty(0)))
        return rows[np.searchsorted(t_us, begin_us) : np.searchsorted(t_us, end_us, "right")]


def labels_at(labels: Iterable[Label], rows: StructArray, times: Times) -> NDArray[np.str_]:
    """The labels that hold at each of ``rows`` (n,), texts and facts, joined by "; "; the recording's are at ``times``.

    A point holds at each finger's next row, within a second, or else at the next row of any; after the last, at that.
    A span without a row is a point.
    """
    there = _Rows(rows)
    texts = [""]
    code = np.zeros(len(rows), np.int64)
    for label in labels:
        own = {f: t_us for f, t_us in times.items() if label.finger in (None, f)}
        at = np.concatenate([np.arange(0), *(there.between(*reach) for reach in _reach(label, own))])
        for before in np.unique(code[at]).tolist():
            code[at[code[at] == before]] = len(texts)
            texts.append("; ".join(filter(None, (texts[before], label.line()))))
    return np.array(texts)[code]


def _reach(label: Label, own: Times) -> list[tuple[int, float, float]]:
    """The fingers at which a label holds, each from and until when, where the rows are at times ``own``."""
    if label.t_us is None:
        return [(finger, -np.inf, np.inf) for finger in own]
    if label.end_us is not None and any(_next(t_us, label.t_us) <= label.end_us for t_us in own.values()):
        return [(finger, label.t_us, label.end_us) for finger in own]
    next_us = {finger: _next(t_us, label.t_us) for finger, t_us in own.items()}
    first_us = min(next_us.values(), default=np.inf)
    if first_us == np.inf:
        next_us = {finger: float(t_us[-1]) for finger, t_us in own.items()}
        last_us = max(next_us.values(), default=np.inf)
        return [(finger, at_us, at_us) for finger, at_us in next_us.items() if at_us >= last_us - _NEXT_US]
    until_us = _NEXT_US + (first_us if first_us > label.t_us + _NEXT_US else label.t_us)
    return [(finger, at_us, at_us) for finger, at_us in next_us.items() if at_us <= until_us]


def _next(t_us: NDArray[np.int64], at_us: int) -> float:
    k = int(np.searchsorted(t_us, at_us))
    return float(t_us[k]) if k < len(t_us) else np.inf


def gap_s_at(gaps: Iterable[Gap], rows: StructArray, times: Times) -> NDArray[np.float32]:
    """How long the finger was away just before each of ``rows`` (n,), in s; 0 where it was there."""
    there = _Rows(rows)
    out = np.zeros(len(rows), np.float32)
    for gap in gaps:
        for finger, t_us in times.items() if gap.next_t_us is not None else ():
            if not gap.fingers or gap.fingers >> finger & 1:
                next_us = _next(t_us, gap.next_t_us or 0)
                at = there.between(finger, next_us, next_us)[:1]
                out[at] = np.maximum(out[at], gap.seconds)  # of two that end here, one includes the other
    return out
