"""Parsing the text of a PORT: ``SCHEME:WHAT?key=value&...``."""

from __future__ import annotations

import math
from collections.abc import Collection
from urllib.parse import parse_qsl

from ..errors import PortError


def options_of(port: str, known: Collection[str], form: str) -> tuple[str, dict[str, str]]:
    """WHAT, and the options by key. Raises PortError, with the expected ``form``, for an option not in ``known``."""
    what, _, query = port.partition(":")[2].partition("?")
    options = dict(parse_qsl(query))
    unknown = sorted(set(options) - set(known))
    if unknown:
        raise PortError(f"{port}: unknown option {unknown[0]!r}; expected {form}")
    return what, options


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
