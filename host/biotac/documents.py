"""JSON and TOML that somebody gives us: bounded in size and depth, and every number finite.

A file may be damaged, or made to hurt: 200 KB of brackets end in a RecursionError, and 1e999 is read as infinity. Here
all of it is ValueError, which the callers put into words about their kind of file.
"""

from __future__ import annotations

import json
import math
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

TOMLDecodeError = tomllib.TOMLDecodeError

#: A wrench map with every block is 2 MB of JSON; a scenario of thousands of steps 1 MB of TOML. `[],` takes 21 times as
#: much memory as text.
JSON_BYTES = 16 << 20
TOML_BYTES = 1 << 20
# Each dot of a key makes a table, and the parser remembers all that are above it; ours need two. What TOML is made of,
# so that no key is taken for a text or a comment; what does not end is one piece, and nothing is read twice.
_PART = r"""(?:[\w-]+|"[^"\\\n]*(?:\\.[^"\\\n]*)*"?|'[^'\n]*'?)"""
_TOKEN = re.compile(
    r"""#[^\n]*|"{3}[^"\\]*(?:(?:\\.|"(?!""))[^"\\]*)*(?:"{3,5}|\Z)|'{3}.*?(?:'{3,5}|\Z)"""
    rf"""|{_PART}(?P<dots>(?:[ \t]*\.[ \t]*{_PART})*)""",
    re.DOTALL,
)
_DOTS_MAX = 3


def read_json(path: Path) -> Any:
    """A JSON file's value. Raises OSError, or ValueError saying what is wrong with it."""
    return parse_json(read_text(path, JSON_BYTES))


def read_text(path: Path, limit_bytes: int) -> str:
    """A file's text. Raises OSError, or ValueError for a file that is longer, or no UTF-8."""
    with path.open("rb") as file:
        data = file.read(limit_bytes + 1)
    if len(data) > limit_bytes:
        raise ValueError(f"it has over {limit_bytes >> 20} MiB")
    return data.decode("utf-8")


def parse_json(text: str | bytes, object_hook: Callable[[dict[str, Any]], Any] | None = None) -> Any:
    """The value of JSON text. Raises ValueError saying what is wrong with it."""
    try:
        return json.loads(text, object_hook=object_hook, parse_float=_finite, parse_constant=_no_constant)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def parse_toml(text: str) -> dict[str, Any]:
    """The table of TOML text. Raises ValueError, of which TOMLDecodeError is one."""
    if len(text) > TOML_BYTES:
        raise ValueError(f"it has over {TOML_BYTES >> 20} MiB")
    if any(_is_deep(match["dots"] or "") for match in _TOKEN.finditer(text)):
        raise ValueError("a key has too many dots")
    try:
        table: dict[str, Any] = tomllib.loads(text)
        return table
    except tomllib.TOMLDecodeError:
        raise
    except RecursionError:
        raise ValueError("it is nested too deeply") from None
    except ValueError as error:
        raise ValueError("a number has thousands of digits") from error


def _is_deep(dots: str) -> bool:
    return dots.count(".") > _DOTS_MAX and len(re.findall(rf"\.[ \t]*{_PART}", dots)) > _DOTS_MAX


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ValueError(f"{text[:20]} is no number that can be used")
    return value


def _no_constant(text: str) -> float:
    raise ValueError(f"{text} is no number that can be used")
