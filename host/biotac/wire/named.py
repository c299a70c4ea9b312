"""Flags that people can read."""

from __future__ import annotations

from enum import IntFlag


class NamedFlag(IntFlag):
    """Flags that print as names, as in ``CONTACT|MAPPED``; with a format code (``:08x``) they are the number."""

    def __str__(self) -> str:
        unknown = int(self) & ~sum(type(self))
        names = [flag.name or "" for flag in type(self) if flag in self]
        return "|".join([*names, *([hex(unknown)] if unknown else [])]) or "0"

    def __format__(self, code: str) -> str:
        return format(int(self), code) if code else str(self)
