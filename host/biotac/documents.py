"""Reading JSON and TOML from outside: size and depth are bounded, and every number is finite.

A file may be damaged or malicious: 200 KB of brackets cause a RecursionError, and 1e999 is read as infinity. All of
this becomes ValueError here, which callers turn into a message about their kind of file.

The project's own documents (calibrations, maps, backups of settings) end in a CRC-32 of their content: a flipped bit
turns a gain of 3850691 into 7850691, which is a number like any other.
"""

from __future__ import annotations

import json
import math
import re
import sys
import zlib
from collections.abc import Callable
from datetime import datetime, timezone
from pathlib import Path
from typing import Any, TypeVar

from .errors import InputError
from .partial_file import whole

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

TOMLDecodeError = tomllib.TOMLDecodeError

#: A wrench map with every block is 2 MB of JSON; a scenario of thousands of steps is 1 MB of TOML. Parsed, `[],` takes
#: 21 times as much memory as the text.
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

FORMAT = "format"
CRC32 = "crc32"
EDITED = "edited"  # in place of the CRC-32

#: How something was made, for people to read: any keys, any JSON values. Nothing is computed from it.
Provenance = dict[str, Any]

DOUBT = "not_worth_using"  # the member with the reason, of a document written by force

Read = TypeVar("Read")


# ---- our own documents -------------------------------------------------------------------------


def sealed(document: dict[str, Any]) -> dict[str, Any]:
    """The document with the CRC-32 of the content as last member."""
    return {**document, CRC32: _crc32(document)}


def unsealed(document: Any, format_name: str) -> dict[str, Any]:
    """The document without the CRC-32, which is checked.

    Raises ValueError for another format, and for changed content. After a change on purpose, the member says "edited".
    It may not just be missing, as damage to its name would then pass.
    """
    if not isinstance(document, dict) or document.get(FORMAT) != format_name:
        seen = document.get(FORMAT) if isinstance(document, dict) else None
        raise ValueError(f'it has "{FORMAT}": {json.dumps(seen)}, expected "{format_name}"')
    content = {key: value for key, value in document.items() if key != CRC32}
    seen, computed = document.get(CRC32), _crc32(content)
    if seen not in (computed, EDITED):
        raise ValueError(
            f'it has "{CRC32}": {json.dumps(seen)}, but its content has "{computed}": it is damaged; take an intact '
            f'copy, or, if you edited it, write "{CRC32}": "{EDITED}"'
        )
    return content


def _crc32(content: dict[str, Any]) -> str:
    # of one spelling, after a round trip that makes numbered members named ones: spaces and order do not matter
    text = json.dumps(json.loads(json.dumps(content)), sort_keys=True, separators=(",", ":"))
    return f"{zlib.crc32(text.encode('ascii')):08x}"


def read_document(path: Path, format_name: str, parse: Callable[[dict[str, Any]], Read], cure: str) -> Read:
    """The result of ``parse`` on the content of one of our JSON files, with the CRC-32 checked.

    Raises InputError that names the fault and ends with ``cure``, also for the errors that wrong content makes
    ``parse`` raise.
    """
    return _parsed(lambda: read_json(path), str(path), format_name, parse, cure)


def parse_document(text: str, where: str, format_name: str, parse: Callable[[dict[str, Any]], Read], cure: str) -> Read:
    """read_document() of a text from ``where``."""
    return _parsed(lambda: parse_json(text), where, format_name, parse, cure)


def _parsed(
    load: Callable[[], Any], where: str, format_name: str, parse: Callable[[dict[str, Any]], Read], cure: str
) -> Read:
    try:
        return parse(unsealed(load(), format_name))
    except OSError as error:
        raise InputError(f"{where} cannot be read ({error.strerror}); check the path; {cure}") from error
    except KeyError as error:
        raise InputError(f"{where} is not usable: {error} is missing; {cure}") from error
    except (InputError, ValueError, TypeError, AttributeError, OverflowError) as error:
        raise InputError(f"{where} is not usable: {str(error) or type(error).__name__}; {cure}") from error


def write_new(path: Path, text: str, *, overwrite: bool = False) -> None:
    """Write a text file, whole. Raises InputError when it exists and may not be overwritten, or cannot be written."""
    with whole(path, overwrite=overwrite) as part:
        part.write_text(text, encoding="utf-8")


def made_text(made_s: int) -> str:
    """When something was made, in seconds since 1970 UTC, as text for people; 0: unknown."""
    if made_s == 0:
        return "made at an unknown time"
    return f"made {datetime.fromtimestamp(made_s, timezone.utc):%Y-%m-%d %H:%M} UTC"


# ---- anybody's ---------------------------------------------------------------------------------


def read_json(path: Path) -> Any:
    """The value in a JSON file. Raises OSError, or ValueError that names the fault."""
    return parse_json(read_text(path, JSON_BYTES))


def read_text(path: Path, limit_bytes: int) -> str:
    """The text of a file. Raises OSError, or ValueError for a file that is longer than the limit or not UTF-8."""
    with path.open("rb") as file:
        data = file.read(limit_bytes + 1)
    if len(data) > limit_bytes:
        raise ValueError(f"it is larger than {limit_bytes >> 20} MiB")
    return data.decode("utf-8-sig")  # Windows' editors begin a file with a mark


def parse_json(text: str | bytes, object_hook: Callable[[dict[str, Any]], Any] | None = None) -> Any:
    """The value of JSON text. Raises ValueError that names the fault."""
    try:
        return json.loads(text, object_hook=object_hook, parse_float=_finite, parse_constant=_no_constant)
    except RecursionError:
        raise ValueError("it is nested too deeply") from None


def parse_toml(text: str) -> dict[str, Any]:
    """The table of TOML text. Raises ValueError, or TOMLDecodeError, a subclass of it."""
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
