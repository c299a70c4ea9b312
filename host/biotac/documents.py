"""Reading JSON and TOML from outside: size and depth are bounded, and every number is finite.

A file may be damaged or malicious: 200 KB of brackets cause a RecursionError, and 1e999 is read as infinity. All of
this becomes ValueError here, which callers turn into a message about their kind of file.
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

#: A wrench map with every block is 2 MB of JSON; a scenario of thousands of steps is 1 MB of TOML. Parsed, `[],` takes
#: 21 times as much memory as its text.
JSON_BYTES = 16 << 20
TOML_BYTES = 1 << 20
# Each dot in a key makes a table, and the parser remembers all the tables above it; our files need two. These patterns
# match TOML's tokens, so that no key is mistaken for a string or a comment. An unterminated string is one token, so
# nothing is scanned twice.
_PART = r"""(?:[\w-]+|"[^"\\\n]*(?:\\.[^"\\\n]*)*"?|'[^'\n]*'?)"""
_TOKEN = re.compile(
    r"""#[^\n]*|"{3}[^"\\]*(?:(?:\\.|"(?!""))[^"\\]*)*(?:"{3,5}|\Z)|'{3}.*?(?:'{3,5}|\Z)"""
    rf"""|{_PART}(?P<dots>(?:[ \t]*\.[ \t]*{_PART})*)""",
    re.DOTALL,
)
_DOTS_MAX = 3


def read_json(path: Path) -> Any:
    """The value in a JSON file. Raises OSError, or ValueError saying what is wrong with the file."""
    return parse_json(read_text(path, JSON_BYTES))


def read_text(path: Path, limit_bytes: int) -> str:
    """The text of a file. Raises OSError, or ValueError for a file that is longer than the limit or not UTF-8."""
    with path.open("rb") as file:
        data = file.read(limit_bytes + 1)
    if len(data) > limit_bytes:
        raise ValueError(f"it is larger than {limit_bytes >> 20} MiB")
    return data.decode("utf-8")


def parse_json(text: str | bytes, object_hook: Callable[[dict[str, Any]], Any] | None = None) -> Any:
    """The value of JSON text. Raises ValueError saying what is wrong with the text."""
    try:
        return json.loads(text, object_hook=object_hook, parse_float=_finite, parse_constant=_no_constant)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def parse_toml(text: str) -> dict[str, Any]:
    """The table of TOML text. Raises ValueError, or its subclass TOMLDecodeError."""
    if len(text) > TOML_BYTES:
        raise ValueError(f"it is larger than {TOML_BYTES >> 20} MiB")
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
        raise ValueError(f"{text[:20]} is not a finite number")
    return value


def _no_constant(text: str) -> float:
    raise ValueError(f"{text} is not a finite number")
