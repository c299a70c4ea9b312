"""Parsing the text of a PORT: ``SCHEME:WHAT?key=value&...``."""

from __future__ import annotations

import math
import os
from collections.abc import Collection
from urllib.parse import parse_qsl

from ..errors import PortError

_PLAYERS = {".mcap": "replay", ".toml": "sim", ".npz": "sim", ".btd": "sim", ".bag": "bag", ".csv": "csv"}


def options_of(port: str, known: Collection[str], form: str) -> tuple[str, dict[str, str]]:
    """WHAT, and the options by key. Raises PortError, with ``form``, for one not in ``known`` or without a value."""
    target, query = file_and_query(port.partition(":")[2])
    options = dict(parse_qsl(query.replace("+", "%2B"), keep_blank_values=True))  # in a form, + is a space
    for key, value in sorted(options.items()):
        if key not in known and (value or "." not in key):  # a word may end the name of a file that is not there
            raise PortError(f"{port}: unknown option {key!r}; expected {form}")
        if key in known and not value:
            raise PortError(f"{port}: option {key!r} has no value; expected {form}")
    return target, {key: value for key, value in options.items() if value}


def file_and_options(port: str, known: Collection[str], form: str) -> tuple[str, dict[str, str]]:
    """As options_of, of a file: raises PortError also where none is named."""
    path, options = options_of(port, known, form)
    if not path:
        raise PortError(f"{port} names no file; expected {form}")
    return path, options


def file_of(port: str) -> str:
    """The file that a PORT plays; without one, the text behind the scheme."""
    return file_and_query(port.partition(":")[2])[0]


def file_and_query(text: str) -> tuple[str, str]:
    """The parts before and behind a question mark, unless the mark belongs to the name of a file."""
    longest, _, rest = text.rpartition("?")
    if os.path.exists(text):
        return text, ""
    if os.path.exists(longest):
        return longest, rest
    head, _, query = text.partition("?")
    return head, query


def player(path: object) -> str:
    """The kind of port that plays such a file, by its suffix; empty for any other."""
    name = os.path.normpath(str(path)).lower()
    return _PLAYERS.get(os.path.splitext(name.removesuffix(".gz") if name.endswith(".btd.gz") else name)[1], "")


def how_to_record(path: object) -> str:
    """How a bag or a table of another driver's messages becomes a recording; empty for any other file."""
    more = {"bag": "", "csv": "?columns=COLUMNS.toml"}.get(scheme := player(path))
    out = os.path.splitext(os.path.normpath(str(path)))[0]
    return "" if more is None else f"`biotac record '{scheme}:{path}{more}' {out}.mcap` makes a recording of it"


def parse_pace(text: str) -> float:
    """Device seconds per second: ``real`` is 1, ``fast`` is 0, else a number. Raises ValueError for anything else."""
    named = {"real": 1.0, "fast": 0.0}
    try:
        pace = named[text] if text in named else float(text)
    except ValueError:
        pace = math.nan
    if not 0 <= pace < math.inf:
        raise ValueError(f"pace is {text!r}, expected real, fast or device seconds per second")
    return pace
