"""Exact integer linear forms: the value of a sum over the electrodes, and the extremes of it and its parts.

A form is a sum of known multiples of atoms. An atom is an input, the compressed part min(e, 0) of one, the high or the
low part of a form that was split by a shift or a mask, or the remainder of a division. Expanding the low parts
(low = form - 2^bits high) decides exactly, as for polynomials, whether two sums are equal. The extremes of a form over
the box of its atoms are sums of |coefficient| times range, an L1 norm; they are reached if the atoms are inputs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

from .cnumbers import CType, Unsupported


class Overflow(Exception):
    """A signed result that leaves its type, with an input for which it does."""

    def __init__(self, message: str, witness: dict[str, int]) -> None:
        super().__init__(f"{message}; reached at {witness}")
        self.witness = witness


@dataclass(frozen=True)
class Atom:
    name: str
    low: int
    high: int
    # The form that a high or low part was split from, and whether it is the low part.
    of: Form | None = None
    bits: int = 0
    is_low: bool = False
    is_rest: bool = False


Rational = int | Fraction  # divisions leave fractions, but every form's value is a whole number


class Form:
    def __init__(self, terms: dict[Atom, Rational], constant: Rational = 0) -> None:
        self.terms = {atom: c for atom, c in terms.items() if c}
        self.constant = constant
        self.key = (frozenset(self.terms.items()), constant)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Form) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)

    def __add__(self, other: Form | Rational) -> Form:
        if not isinstance(other, Form):
            return Form(self.terms, self.constant + other)
        terms = dict(self.terms)
        for atom, c in other.terms.items():
            terms[atom] = terms.get(atom, 0) + c
        return Form(terms, self.constant + other.constant)

    def __mul__(self, factor: Rational) -> Form:
        return Form({atom: c * factor for atom, c in self.terms.items()}, self.constant * factor)

    def __sub__(self, other: Form | Rational) -> Form:
        return self + (other * -1)

    def __repr__(self) -> str:
        text = " + ".join(f"{c}*{atom.name}" for atom, c in self.terms.items())
        return f"{text} + {self.constant}"

    def extreme(self, sign: int) -> tuple[int, dict[str, int]]:
        """The largest (sign 1) or smallest (-1) value over the box, and an input where it is taken."""
        at = {atom.name: atom.high if c * sign > 0 else atom.low for atom, c in self.terms.items()}
        value = self.constant + sum(c * at[atom.name] for atom, c in self.terms.items())
        return math.floor(value) if sign > 0 else math.ceil(value), at

    @property
    def low(self) -> int:
        return self.extreme(-1)[0]

    @property
    def high(self) -> int:
        return self.extreme(1)[0]

    @property
    def size(self) -> int:
        return max(abs(self.low), abs(self.high))

    def expanded(self) -> Form:
        """The same form without low parts: low = form - 2^bits * high. High parts that do not cancel stay."""
        out = Form({}, self.constant)
        for atom, c in self.terms.items():
            if atom.of is None:
                out = out + Form({atom: c})
                continue
            whole = atom.of.expanded()
            # The same number may have been split in two notations: name parts by the form that they are part of.
            high = Atom(f"high{atom.bits}({sorted_text(whole)})", 0, 0)
            out = out + (whole * c - Form({high: c * (1 << atom.bits)}) if atom.is_low else Form({high: c}))
        return out

    def coefficients(self, names: list[str], *, cut: Rational = 0) -> list[Rational]:
        """Coefficients of the expanded form, in the order of ``names``.

        Raises ValueError if remainders of divisions may add up to ``cut`` or more, or if anything else is left.
        """
        expanded = self.expanded()
        rests = [(atom, c) for atom, c in expanded.terms.items() if atom.is_rest]
        by_name = {atom.name: c for atom, c in expanded.terms.items() if not atom.is_rest}
        strange = set(by_name) - set(names)
        if strange or expanded.constant:
            raise ValueError(f"not a sum over the inputs: {expanded.constant} and {sorted(strange)[:3]} are left")
        lost = sum((Fraction(max(c, -c)) * max(-atom.low, atom.high) for atom, c in rests), Fraction(0))
        if rests and lost >= cut:
            raise ValueError(f"divisions cut {cut} or more")
        return [by_name.get(name, 0) for name in names]


def sorted_text(form: Form) -> str:
    return " ".join(f"{c:+d}*{atom.name}" for atom, c in sorted(form.terms.items(), key=lambda item: item[0].name))


def inputs(count: int, low: int, high: int) -> list[Form]:
    return [Form({Atom(f"v{i}", low, high): 1}) for i in range(count)]


class LinearDomain:
    """Refuses whatever is not linear, and any signed result that can leave its type.

    Unsigned forms may wrap: they are kept as a congruent form. A conversion to a signed type, a shift, a mask or a
    comparison requires that the form itself fits, and then it is what C computes.
    """

    def __init__(self) -> None:
        self.peak = 0  # largest magnitude of any signed intermediate result, in the order of the C
        self.steps = 0

    def checked(self, form: Form, kind: CType, what: str) -> Form:
        for sign in (-1, 1):
            value, at = form.extreme(sign)
            if not kind.holds(value):
                raise Overflow(f"{what} reaches {value}, beyond {kind.bits} bits", at)
        return form

    def signed(self, form: Form, kind: CType, what: str) -> Form:
        self.steps += 1
        if not kind.signed:
            return form
        self.peak = max(self.peak, form.size)
        return self.checked(form, kind, what)

    def binary(self, op: str, kind: CType, a: Any, b: Any, guard: Any) -> Any:
        if guard is not True:
            raise Unsupported("a condition on a signal inside a sum")
        if op in ("+", "-"):
            a = a if isinstance(a, Form) else Form({}, a)
            return self.signed(a + b if op == "+" else a - b, kind, "a sum")
        if op == "*" and (isinstance(a, int) or isinstance(b, int)):
            form, factor = (b, a) if isinstance(a, int) else (a, b)
            if not kind.signed and factor >> (kind.bits - 1):
                factor -= 1 << kind.bits  # congruent; a negative coefficient had become the unsigned factor
            return self.signed(form * factor, kind, "a product")
        if op in ("<<", ">>", "&") and isinstance(b, int) and isinstance(a, Form):
            return self.split(op, kind, a, b)
        if op == "/" and isinstance(b, int) and b > 0:
            return self.divide(kind, a, b)
        if op == "&" and kind.signed and b == self.split(">>", kind, a, kind.bits - 1):
            # The sign, copied into every bit, keeps all bits of a negative number and none of others.
            return Form({Atom(f"min({sorted_text(a)},0)", min(a.low, 0), min(a.high, 0)): 1})
        raise Unsupported(f"{op} of signals is not linear")

    def split(self, op: str, kind: CType, a: Form, b: int) -> Form:
        self.checked(a, kind, "what is split")
        if op in ("<<", ">>") and b == 0:
            return a
        if op == "<<":
            if kind.signed and a.low < 0:
                raise Overflow("left shift of a negative number", a.extreme(-1)[1])
            return self.signed(a * (1 << b), kind, "a shift")
        if op == ">>":
            return Form({Atom(f"high{b}({a})", a.low >> b, a.high >> b, a, b): 1})
        if b & (b + 1):
            raise Unsupported(f"a mask of {b:#x}")
        bits = b.bit_length()
        return Form({Atom(f"low{bits}({a})", 0, b, a, bits, True): 1})

    def divide(self, kind: CType, a: Form, b: int) -> Form:
        """Division towards 0: a = b q + rest, where the rest has the sign of a."""
        self.checked(a, kind, "what is divided")
        rest = Atom(f"rest{b}({a})", -(b - 1) if a.low < 0 else 0, b - 1 if a.high > 0 else 0, is_rest=True)
        return (a - Form({rest: 1})) * Fraction(1, b)

    def convert(self, x: Any, source: CType, target: CType, guard: Any) -> Any:
        if target.signed or target.bits > source.bits:
            # Narrowing keeps the value modulo 2^bits, so a form that fits comes out unchanged.
            self.checked(x, target if target.signed else source, "a conversion")
        return x

    def refuse(self, *operands: Any) -> Any:
        raise Unsupported("a condition on a signal, a choice by it or its clz inside a sum")

    compare = choose = both = inverse = clz = refuse
