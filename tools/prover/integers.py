"""C's arithmetic as z3 integers: exact numbers, with every place where C would wrap made explicit.

Shifts, masks and divisions become fresh integers with the equations that define them, so that the rest is linear or
nearly so; with 64-bit bit-vectors z3 would have to rediscover how division works. A fact that rests on an earlier
obligation holds only where that obligation was asked for, hence the guards.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import z3

from .cnumbers import COMPARE, CType, Unsupported


@dataclass(frozen=True)
class Number:
    term: Any
    low: int
    high: int


@dataclass(frozen=True)
class Obligation:
    what: str
    guard: Any
    condition: Any
    facts: int  # how many facts existed when it arose; only those may be used for it


class Questions:
    """The questions for z3: for these inputs, given the facts, whether each obligation holds."""

    def __init__(self) -> None:
        self.facts: list[Any] = []
        self.obligations: list[Obligation] = []
        self.inputs: dict[str, Any] = {}

    def require(self, what: str, condition: Any, guard: Any) -> None:
        self.obligations.append(Obligation(what, guard, condition, len(self.facts)))

    def both(self, a: Any, b: Any) -> Any:
        return z3.And(a, b)

    def inverse(self, a: Any) -> Any:
        return z3.Not(a)


def number(x: Any) -> Number:
    return x if isinstance(x, Number) else Number(z3.IntVal(x), x, x)


class IntegerDomain(Questions):
    def __init__(self) -> None:
        super().__init__()
        self.parts: dict[tuple[int, int, int], tuple[Number, Number]] = {}
        self.kept: list[Any] = []  # keeps alive the terms whose ids are keys
        self.made = 0  # fresh numbers; counted here, so that a question's text does not depend on earlier questions

    def input(self, name: str, kind: CType) -> Number:
        term = self.inputs.setdefault(name, z3.Int(name))
        self.facts.append(z3.And(kind.low <= term, term <= kind.high))
        return Number(term, kind.low, kind.high)

    def fresh(self, name: str, low: int, high: int, guard: Any) -> Number:
        self.made += 1
        out = Number(z3.Int(f"{name}.{self.made}"), low, high)
        self.fact(z3.And(low <= out.term, out.term <= high), guard)
        return out

    def fact(self, condition: Any, guard: Any) -> None:
        self.facts.append(condition if guard is True else z3.Implies(guard, condition))

    def fitted(self, term: Any, low: int, high: int, kind: CType, what: str, guard: Any) -> Number:
        """A result in its type: signed types require that it fits, unsigned types wrap it."""
        if kind.holds(low) and kind.holds(high):
            return Number(term, low, high)
        if kind.signed:
            self.require(f"{what} overflows", z3.And(kind.low <= term, term <= kind.high), guard)
            return Number(term, max(low, kind.low), min(high, kind.high))
        return self.modulo(Number(term, low, high), kind.bits, guard)[1]

    def modulo(self, x: Number, bits: int, guard: Any) -> tuple[Number, Number]:
        """floor(x / 2^bits) and the remainder, as an arithmetic shift and a mask give, also below 0."""
        key = (x.term.get_id(), 0, bits)
        if key not in self.parts:
            quotient = self.fresh("high", x.low >> bits, x.high >> bits, True)
            rest = self.fresh("low", 0, (1 << bits) - 1, True)
            self.facts.append(x.term == quotient.term * (1 << bits) + rest.term)
            self.parts[key] = (quotient, rest)
            self.kept.append(x.term)
        return self.parts[key]

    def divide(self, kind: CType, x: Number, y: Number, guard: Any) -> tuple[Number, Number]:
        key = (x.term.get_id(), y.term.get_id(), 0)
        if key in self.parts:
            return self.parts[key]
        self.require("division by 0", y.term != 0, guard)
        if kind.signed and x.low == kind.low and y.low <= -1 <= y.high:
            self.require("division overflows", z3.Or(x.term != kind.low, y.term != -1), guard)
        largest = max(abs(x.low), abs(x.high))
        rest_max = min(largest, max(abs(y.low), abs(y.high)) - 1)
        quotient = self.fresh("quotient", 0 if x.low >= 0 <= y.low else -largest, largest, guard)
        rest = self.fresh("rest", 0 if x.low >= 0 else -rest_max, rest_max, guard)
        size = z3.If(y.term < 0, -y.term, y.term)
        left = z3.If(rest.term < 0, -rest.term, rest.term)
        defines = [x.term == quotient.term * y.term + rest.term, left < size]
        defines += [z3.Implies(x.term >= 0, rest.term >= 0), z3.Implies(x.term <= 0, rest.term <= 0)]
        for part in defines:
            self.fact(z3.Implies(y.term != 0, part), guard)
        self.parts[key] = (quotient, rest)
        self.kept += [x.term, y.term]
        return quotient, rest

    def binary(self, op: str, kind: CType, a: Any, b: Any, guard: Any) -> Any:
        x, y = number(a), number(b)
        if op in ("<<", ">>") and not isinstance(b, int):
            raise Unsupported("a shift by an unknown number: run the proof once per number")
        if op == ">>":
            return self.modulo(x, b, guard)[0]
        if op == "&" and isinstance(b, int) and b & (b + 1) == 0:
            return self.modulo(x, b.bit_length(), guard)[1]
        if op == "&" and kind.signed and self.parts.get((x.term.get_id(), 0, kind.bits - 1), (None,))[0] is b:
            # The sign, copied into every bit, keeps all bits of a negative number and none of others.
            return Number(z3.If(x.term < 0, x.term, 0), min(x.low, 0), min(x.high, 0))
        if op == "^" and kind.signed and (y.low >= -1 and y.high <= 0):
            # With 0, or with -1, which inverts every bit: -x - 1.
            turned = Number(-x.term - 1, -x.high - 1, -x.low - 1)
            if y.low == y.high:
                return turned if y.low else x
            low, high = min(x.low, turned.low), max(x.high, turned.high)
            return Number(z3.If(y.term < 0, turned.term, x.term), low, high)
        if op in ("/", "%"):
            return self.divide(kind, x, y, guard)[op == "%"]
        if op == "<<":
            if kind.signed and x.low < 0:
                self.require("left shift of a negative number", x.term >= 0, guard)
            op, y = "*", number(1 << b)
        if op == "+":
            return self.fitted(x.term + y.term, x.low + y.low, x.high + y.high, kind, "a sum", guard)
        if op == "-":
            return self.fitted(x.term - y.term, x.low - y.high, x.high - y.low, kind, "a difference", guard)
        if op == "*":
            corners = [p * q for p in (x.low, x.high) for q in (y.low, y.high)]
            product = x.term * y.term
            low, high = min(corners), max(corners)
            self.fact(z3.And(low <= product, product <= high), guard)
            return self.fitted(product, low, high, kind, "a product", guard)
        raise Unsupported(f"operator {op} on integers")

    def compare(self, op: str, kind: CType, a: Any, b: Any) -> Any:
        return COMPARE[op](number(a).term, number(b).term)

    def convert(self, x: Any, source: CType, target: CType, guard: Any) -> Any:
        if target.holds(x.low) and target.holds(x.high):
            return x
        if not target.signed:
            return self.modulo(x, target.bits, guard)[1]
        moved = Number(x.term - target.low, x.low - target.low, x.high - target.low)
        rest = self.modulo(moved, target.bits, guard)[1]
        return Number(rest.term + target.low, target.low, target.high)

    def choose(self, condition: Any, kind: CType, a: Any, b: Any) -> Any:
        x, y = number(a), number(b)
        return Number(z3.If(condition, x.term, y.term), min(x.low, y.low), max(x.high, y.high))

    def clz(self, x: Any, guard: Any) -> Any:
        raise Unsupported("clz of an integer: use bit-vectors")
