"""C's numbers: types with a width, promotions, and arithmetic on known numbers."""

from __future__ import annotations

import operator
from typing import Any, NamedTuple


class Unsupported(Exception):
    """C that this interpreter does not know."""


class Undefined(Exception):
    """Known numbers that lead to undefined behaviour."""


class CType(NamedTuple):
    signed: bool
    bits: int

    @property
    def low(self) -> int:
        return -(1 << (self.bits - 1)) if self.signed else 0

    @property
    def high(self) -> int:
        return (1 << (self.bits - self.signed)) - 1

    def holds(self, value: int) -> bool:
        return self.low <= value <= self.high


INT = CType(True, 32)
UINT = CType(False, 32)
INT64 = CType(True, 64)
BOOL = CType(False, 1)
NAMES = {
    "_Bool": BOOL,
    "char": CType(True, 8),
    "signed char": CType(True, 8),
    "unsigned char": CType(False, 8),
    "short": CType(True, 16),
    "unsigned short": CType(False, 16),
    "int": INT,
    "unsigned": UINT,
    "unsigned int": UINT,
    "long long": INT64,
    "unsigned long long": CType(False, 64),
}
# These work on z3's terms, too.
COMPARE: dict[str, Any] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}
COMPUTE: dict[str, Any] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "<<": operator.lshift,
    ">>": operator.rshift,
    "&": operator.and_,
    "|": operator.or_,
    "^": operator.xor,
}


def promoted(kind: CType) -> CType:
    return INT if kind.bits < 32 else kind


def common(a: CType, b: CType) -> CType:
    a, b = promoted(a), promoted(b)
    if a.bits != b.bits:
        return a if a.bits > b.bits else b
    return a if not a.signed else b


def wrapped(kind: CType, value: int) -> int:
    value &= (1 << kind.bits) - 1
    return value - (1 << kind.bits) if kind.signed and value >> (kind.bits - 1) else value


def known_binary(op: str, kind: CType, a: int, b: int) -> int:
    if op in ("/", "%") and b == 0:
        raise Undefined("division by 0")
    if op in ("<<", ">>") and not 0 <= b < kind.bits:
        raise Undefined(f"shift by {b}")
    if op == "<<" and kind.signed and a < 0:
        raise Undefined("left shift of a negative number")
    if op in ("/", "%"):
        quotient = abs(a) // abs(b) * (1 if (a < 0) == (b < 0) else -1)
        value = quotient if op == "/" else a - quotient * b
    else:
        value = COMPUTE[op](a, b)
    if kind.signed and not kind.holds(value):
        raise Undefined(f"{a} {op} {b} overflows")
    return wrapped(kind, value)
