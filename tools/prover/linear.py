"""Exact integer linear forms: what a sum over the electrodes is, and how large it and its parts can be.

A form is a sum of known multiples of atoms. An atom is an input, or the high or the low part of a form
that was split by a shift or a mask. Expanding the low parts (low = form - 2^bits high) decides equality
of two sums exactly, as polynomials; the extreme values of a form over the box of its atoms are sums of
|coefficient| times range, an L1 norm, and are reached when the atoms are inputs.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from .cnumbers import CType, Unsupported


class Overflow(Exception):
    """A signed result that leaves its type, with an input that makes it do so."""

    def __init__(self, message: str, witness: dict[str, int]) -> None:
        super().__init__(f"{message}; reached at {witness}")
        self.witness = witness


@dataclass(frozen=True)
class Atom:
    name: str
    low: int
    high: int
    # A split's high part knows what it is part of; so does a low part, and that it is one.
    of: Form | None = None
    bits: int = 0
    is_low: bool = False


class Form:
    def __init__(self, terms: dict[Atom, int], constant: int = 0) -> None:
        self.terms = {atom: c for atom, c in terms.items() if c}
        self.constant = constant
        self.key = (frozenset(self.terms.items()), constant)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Form) and self.key == other.key

    def __hash__(self) -> int:
        return hash(self.key)

    def __add__(self, other: Form | int) -> Form:
        if isinstance(other, int):
            return Form(self.terms, self.constant + other)
        terms = dict(self.terms)
        for atom, c in other.terms.items():
            terms[atom] = terms.get(atom, 0) + c
        return Form(terms, self.constant + other.constant)

    def __mul__(self, factor: int) -> Form:
        return Form({atom: c * factor for atom, c in self.terms.items()}, self.constant * factor)

    def __sub__(self, other: Form | int) -> Form:
        return self + (-other if isinstance(other, int) else other * -1)

    def __repr__(self) -> str:
        text = " + ".join(f"{c}*{atom.name}" for atom, c in self.terms.items())
        return f"{text} + {self.constant}"

    def extreme(self, sign: int) -> tuple[int, dict[str, int]]:
        """The largest (sign 1) or smallest (-1) value over the box, and where it is taken."""
        at = {atom.name: atom.high if c * sign > 0 else atom.low for atom, c in self.terms.items()}
        return self.constant + sum(c * at[atom.name] for atom, c in self.terms.items()), at

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
        """The same without low parts: low = form - 2^bits * high. High parts that do not cancel stay."""
        out = Form({}, self.constant)
        for atom, c in self.terms.items():
            if atom.of is None:
                out = out + Form({atom: c})
                continue
            whole = atom.of.expanded()
            # The same number may have been split in two ways of writing it: name parts by what they are of.
            high = Atom(f"high{atom.bits}({sorted_text(whole)})", 0, 0)
            out = out + (whole * c - Form({high: c << atom.bits}) if atom.is_low else Form({high: c}))
        return out

    def coefficients(self, names: list[str]) -> list[int]:
        """Of the expanded form, in that order; anything else in it is refused."""
        expanded = self.expanded()
        by_name = {atom.name: c for atom, c in expanded.terms.items()}
        strange = set(by_name) - set(names)
        if strange or expanded.constant:
            raise ValueError(f"not a sum over the inputs: {expanded.constant} and {sorted(strange)[:3]} are left")
        return [by_name.get(name, 0) for name in names]


def sorted_text(form: Form) -> str:
    return " ".join(f"{c:+d}*{atom.name}" for atom, c in sorted(form.terms.items(), key=lambda item: item[0].name))


def inputs(count: int, low: int, high: int) -> list[Form]:
    return [Form({Atom(f"v{i}", low, high): 1}) for i in range(count)]


class LinearDomain:
    """Refuses what is not linear, and any signed result that can leave its type.

    Unsigned forms may wrap: they are kept as what they are congruent to, and a conversion to a signed
    type, a shift, a mask or a comparison asks that the form itself fits, which then is what C computes.
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
                factor -= 1 << kind.bits  # congruent, and what a negative coefficient turns into
            return self.signed(form * factor, kind, "a product")
        if op in ("<<", ">>", "&") and isinstance(b, int) and isinstance(a, Form):
            return self.split(op, kind, a, b)
        raise Unsupported(f"{op} of signals is not linear")

    def split(self, op: str, kind: CType, a: Form, b: int) -> Form:
        self.checked(a, kind, "what is split")
        if op == "<<":
            if kind.signed and a.low < 0:
                raise Overflow("a negative number shifted to the left", a.extreme(-1)[1])
            return self.signed(a * (1 << b), kind, "a shift")
        if op == ">>":
            return Form({Atom(f"high{b}({a})", a.low >> b, a.high >> b, a, b): 1})
        if b & (b + 1):
            raise Unsupported(f"a mask of {b:#x}")
        bits = b.bit_length()
        return Form({Atom(f"low{bits}({a})", 0, b, a, bits, True): 1})

    def convert(self, x: Any, source: CType, target: CType, guard: Any) -> Any:
        if target.signed or target.bits > source.bits:
            # Narrowing keeps the value modulo 2^bits, so a form that fits is what comes out.
            self.checked(x, target if target.signed else source, "a conversion")
        return x

    def compare(self, op: str, kind: CType, a: Any, b: Any) -> Any:
        raise Unsupported("a condition on a signal inside a sum")

    def choose(self, condition: Any, kind: CType, a: Any, b: Any) -> Any:
        raise Unsupported("a choice by a signal inside a sum")

    def both(self, a: Any, b: Any) -> Any:
        raise Unsupported("a condition on a signal inside a sum")

    def inverse(self, a: Any) -> Any:
        raise Unsupported("a condition on a signal inside a sum")

    def clz(self, x: Any, guard: Any) -> Any:
        raise Unsupported("clz inside a sum")
