"""Typed reading of TOML tables, with errors that name the line and the key.

The standard parser gives no line numbers, so Lines finds headers and keys again by scanning the text. A multi-line
string that looks like a header or a key can make it wrong by a few lines.
"""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Sequence
from typing import Any

from .. import documents
from ..errors import ScenarioError

_HEADER = re.compile(r"^\s*\[{1,2}\s*([A-Za-z0-9_\"'.-]+)\s*\]{1,2}\s*(#.*)?$")


class Lines:
    """Where tables and keys stand in a TOML text; lines count from 1."""

    def __init__(self, text: str) -> None:
        self._lines = text.split("\n")  # not splitlines: TOML ends lines at \n alone
        self._headers = [
            (number, match.group(1))
            for number, line in enumerate(self._lines, 1)
            if (match := _HEADER.match(line)) is not None
        ]
        self._tables: dict[str, list[int]] = {}
        for number, header in self._headers:
            self._tables.setdefault(header, []).append(number)

    def table(self, name: str, index: int) -> int:
        """Line of the header of the ``index``-th table called ``name``; 1 if it has no header."""
        found = self._tables.get(name, [])
        return found[index] if index < len(found) else 1

    def key(self, start: int, key: str) -> int:
        """Line of ``key`` in the table with the header at line ``start`` (0: the top level).

        A table under that key counts too; the header's line when there is neither.
        """
        ends = [number for number, _ in self._headers if number > start]
        pattern = re.compile(rf"^\s*[\"']?{re.escape(key)}[\"']?\s*[=.]")
        for number in range(start + 1, ends[0] if ends else len(self._lines) + 1):
            if pattern.match(self._lines[number - 1]):
                return number
        found = [number for number, header in self._headers if header.strip("\"'") == key]
        return found[0] if found and start == 0 else max(start, 1)


def parse_toml(data: bytes, file: str) -> tuple[dict[str, Any], Lines]:
    """Parse TOML. Raises ScenarioError, with the parser's line number, for invalid TOML."""
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise ScenarioError(f"{file}:{line}: not UTF-8 text: expected a TOML scenario; save it as UTF-8") from None
    try:
        return documents.parse_toml(text), Lines(text)
    except documents.TOMLDecodeError as error:
        seen = str(error)
        match = re.search(r"\s*\(at line (\d+), column \d+\)|\s*\(at end of document\)", seen)
        line = text.rstrip().count("\n") + 1
        if match is not None:
            line = int(match.group(1) or line)
            seen = seen[: match.start()]
        raise ScenarioError(f"{file}:{line}: not valid TOML: {seen}: expected `key = value`; correct it") from None
    except ValueError as error:
        raise ScenarioError(
            f"{file}:1: this TOML cannot be read: {error}: expected a TOML scenario; correct it"
        ) from None


class TomlTable:
    """A TOML table: reads keys with type and range checks, and refuses unknown keys; one with a default may be missing.

    Every method raises ScenarioError ``file:LINE: label: key 'k' seen: expected ...; cure``.
    """

    def __init__(self, values: dict[str, Any], file: str, label: str, lines: Lines, start: int) -> None:
        self.values = values
        self._file = file
        self._label = label
        self._lines = lines
        self._start = start

    def __contains__(self, key: str) -> bool:
        return key in self.values

    def error(self, key: str, seen: str, expected: str, cure: str = "correct the value") -> ScenarioError:
        line = self._lines.key(self._start, key)
        label = f"{self._label}: " if self._label else ""
        return ScenarioError(f"{self._file}:{line}: {label}key '{key}' {seen}: expected {expected}; {cure}")

    def only(self, allowed: Sequence[str], context: str = "") -> None:
        """Refuse keys other than ``allowed``; ``context`` names their table."""
        for key in self.values:
            if key not in allowed:
                near = difflib.get_close_matches(key, allowed, 1)
                cure = f"did you mean '{near[0]}'?" if near else "remove it"
                raise self.error(key, "is unknown" + context, "one of " + ", ".join(allowed), cure)

    def _checked(self, key: str, is_good: Callable[[Any], object], expected: str, default: Any = None) -> Any:
        if key in self.values and is_good(self.values[key]):
            return self.values[key]
        if key in self.values:
            raise self.error(key, f"is {_show(self.values[key])}", expected)
        if default is None:
            raise self.error(key, "is missing", expected, "add it")
        return default

    def number(self, key: str, low: float, high: float, unit: str, default: float | None = None) -> float:
        """A finite number in low..high."""
        expected = f"a number {low:g} to {high:g} {unit}".rstrip()
        return float(self._checked(key, lambda value: _is_number(value) and low <= value <= high, expected, default))

    def integer(self, key: str, low: int, high: int, default: int | None = None) -> int:
        """A whole number in low..high."""
        expected = f"a whole number {low} to {high}"
        return int(self._checked(key, lambda value: type(value) is int and low <= value <= high, expected, default))

    def pair(self, key: str, limit: float, unit: str) -> tuple[float, float]:
        """Two finite numbers in -limit..limit."""

        def is_good(value: Any) -> bool:
            is_pair = isinstance(value, list) and len(value) == 2
            return is_pair and all(_is_number(part) and abs(part) <= limit for part in value)

        x, y = self._checked(key, is_good, f"[x, y], each -{limit:g} to {limit:g} {unit}")
        return float(x), float(y)

    def choice(self, key: str, choices: Sequence[str], default: str | None = None) -> str:
        """One of the given words."""
        expected = "one of " + ", ".join(choices)
        value = self._checked(key, lambda value: True, expected, default)
        if not isinstance(value, str) or value not in choices:
            near = difflib.get_close_matches(str(value), choices, 1)
            cure = f"did you mean '{near[0]}'?" if near else "correct the value"
            raise self.error(key, f"is {_show(value)}", expected, cure)
        return value

    def text(self, key: str, pattern: str, expected: str, default: str | None = None) -> str:
        """Text that matches ``pattern`` as a whole."""
        matches = re.compile(pattern).fullmatch
        return str(self._checked(key, lambda value: isinstance(value, str) and matches(value), expected, default))

    def indices(self, key: str, count: int, default: Any = None) -> tuple[int, ...]:
        """A list of distinct indices below ``count``."""

        def is_good(value: Any) -> bool:
            is_list = isinstance(value, list) and all(type(part) is int and 0 <= part < count for part in value)
            return is_list and 0 < len(value) == len(set(value))

        return tuple(self._checked(key, is_good, f"a list of distinct finger indices 0 to {count - 1}", default))

    def tables(self, key: str) -> list[TomlTable]:
        """The ``[[key]]`` tables; none when there are none."""
        value = self.values.get(key, [])
        if not isinstance(value, list) or not all(isinstance(part, dict) for part in value):
            raise self.error(key, f"is {_show(value)}", f"[[{key}]] tables", "use double brackets")
        return [
            TomlTable(part, self._file, f"{key} {index + 1}", self._lines, self._lines.table(key, index))
            for index, part in enumerate(value)
        ]


def _is_number(value: object) -> bool:
    # bool is an int to Python; it is no quantity. NaN and inf fail every range that follows.
    return isinstance(value, int | float) and not isinstance(value, bool)


def _show(value: object) -> str:
    if isinstance(value, int) and value.bit_length() > 200:
        return "a huge number"  # Python refuses to print some of them
    text = repr(value).replace("\n", " ")
    return text if len(text) <= 60 else text[:57] + "..."
