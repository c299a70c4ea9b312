"""Labels of a recording: notes, marks and spans, made while it was recorded or afterwards.

Those made live are in the blocks of the recording itself. Later ones go to a file beside it, ``press.labels.jsonl`` for
``press.mcap``, a line each, so that the recording is never rewritten and a crash costs at most the last line. A line
names the recording that it belongs to by when that began: another one of the same name does not inherit it. One that
is removed is named once more, as ``removed``.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError, RecordingError, printable

MAX_BYTES = 16 << 20  # of the file beside a recording: a hundred thousand labels
AROUND_US = 500_000  # that a point reaches to both sides, where rows are selected by it


@dataclass(frozen=True)
class Label:
    """``text`` at device time ``t_us``, or until ``end_us``; without ``t_us``, about the whole recording.

    ``finger`` is the chip select it is about, None for all. ``facts`` are whatever else is known by name, such as the
    subject, the trial, or ``video_s``, the time in a video: texts and numbers. A later label of the same text, time and
    finger replaces an earlier one.
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
    """A recording's labels, and in words which lines beside it are none of its own.

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


def of_rows(labels: list[Label], t_us: NDArray[np.int64], finger: NDArray[np.uint8]) -> NDArray[np.str_]:
    """What holds at each row (n,), texts with their facts, joined by "; ". A point holds at each finger's next row."""
    texts = [""]
    code = np.zeros(len(t_us), np.int64)
    for label in labels:
        covered = np.ones(len(t_us), np.bool_) if label.finger is None else finger == label.finger
        if label.t_us is not None:
            covered &= t_us >= label.t_us
            covered &= t_us <= (label.end_us if label.end_us is not None else label.t_us + 1_000_000)
        at = np.flatnonzero(covered)
        if label.t_us is not None and label.end_us is None:
            at = at[np.unique(finger[at], return_index=True)[1]]
        for before in np.unique(code[at]).tolist():
            code[at[code[at] == before]] = len(texts)
            texts.append("; ".join(filter(None, (texts[before], label.line()))))
    return np.array(texts)[code]


def spans_us(labels: list[Label], wanted: str | Iterable[str]) -> list[tuple[int, int]]:
    """Times in us from the first to the last row of labels of these texts, joined where they meet.

    A point reaches half a second to both sides. Raises InputError for a text that no timed label has.
    """
    names = {wanted} if isinstance(wanted, str) else set(wanted)
    timed = [label for label in labels if label.t_us is not None]
    if missing := sorted(names - {label.text for label in timed}):
        texts = ", ".join(sorted({repr(label.text) for label in timed})) or "none"
        raise InputError(f"no label {missing[0]!r} with a time: expected one or more of {texts}")
    spans: list[tuple[int, int]] = []
    for label in timed:
        if label.text in names and label.t_us is not None:
            reach = AROUND_US if label.end_us is None else 0
            begin, end = label.t_us - reach, (label.t_us if label.end_us is None else label.end_us) + reach
            if spans and begin <= spans[-1][1]:
                before = spans.pop()
                begin, end = before[0], max(end, before[1])
            spans.append((begin, end))
    return spans
