"""Firmware against library."""

from __future__ import annotations

from collections.abc import Iterator

from ..errors import WireVersionError
from .catalogue import Finding
from .facts import Facts


def check(facts: Facts) -> Iterator[Finding]:
    """Another major, another schema."""
    if isinstance(facts.error, WireVersionError):
        yield Finding("wire_version", str(facts.error))
    for warning in facts.board.warnings if facts.board else []:
        yield Finding(warning.code, warning.text)
