"""Checks the firmware against the library."""

from __future__ import annotations

import re
from collections.abc import Iterator

from ..errors import WireVersionError
from ..version import __version__
from ..wire.identity import version_text
from .catalogue import Finding
from .facts import Facts


def check(facts: Facts) -> Iterator[Finding]:
    """Another major version, another schema, firmware older than the package."""
    if isinstance(facts.error, WireVersionError):
        yield Finding("wire_version", str(facts.error))
    for warning in facts.board.warnings if facts.board else []:
        yield Finding(warning.code, warning.text)
    hello = facts.board.hello if facts.board else None
    if hello and (hello.firmware_major, hello.firmware_minor, hello.firmware_patch) < release(__version__):
        yield Finding("firmware_older", f"firmware {version_text(hello)}, this package {__version__}")


def release(version: str) -> tuple[int, ...]:
    """The numbers of a version, without a development version's suffix."""
    numbers = re.match(r"\d+(\.\d+)*", version)
    return tuple(map(int, numbers[0].split("."))) if numbers else ()
