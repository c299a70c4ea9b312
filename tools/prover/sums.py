"""The generated sums of sums_gen.c as exact linear forms."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from pycparser import c_ast

from .cnumbers import INT, Undefined
from .linear import Form, LinearDomain, inputs
from .machine import Domain, Machine
from .storage import Pointer, Struct, Value


@dataclass(frozen=True)
class Sums:
    out: dict[str, Form]  # by field of the result, arrays as name[index]
    peak: int  # largest magnitude of any signed intermediate result, in the order of the C
    steps: int

    def __getitem__(self, name: str) -> Form:
        return self.out[name]


def flat(value: Any, name: str) -> dict[str, Value]:
    if isinstance(value, Value):
        return {name: value}
    entries: dict[str, Value] = {}
    if isinstance(value, Struct):
        for field, room in value.fields.items():
            entries |= flat(room[0], f"{name}.{field}" if name else field)
    else:
        for index, entry in enumerate(value):
            entries |= flat(entry, f"{name}[{index}]")
    return entries


def call(machine: Machine, function: str, values: Sequence[Any], *options: int) -> dict[str, Value]:
    """Run ``function(v, options..., out)``; return what it writes, by field."""
    parameters = machine.functions[function].decl.type.args.params
    kind = machine.scalar(parameters[0].type.type)
    assert kind is not None
    signals = Pointer([Value(kind, value) for value in values], 0)
    pointed = parameters[-1].type
    # Only an array parameter tells how long its array is.
    room = [machine.build(pointed)] if isinstance(pointed, c_ast.ArrayDecl) else [machine.build(pointed.type)]
    target = Pointer(room[0], 0) if isinstance(room[0], list) else Pointer(room, 0)
    machine.call(function, signals, *(Value(INT, option) for option in options), target)
    return flat(room[0], "")


def exact(name: str, value: Value, domain: LinearDomain) -> Form:
    if value.x is None:
        raise Undefined(f"{name} is never written")
    form = value.x if isinstance(value.x, Form) else Form({}, value.x)
    # So far an unsigned result is only congruent to its form; if the form fits the type, they are equal.
    return domain.checked(form, value.kind, name)


def forms(
    unit: c_ast.FileAST, function: str, count: int, low: int, high: int, *options: int, wraps: Sequence[str] = ()
) -> Sums:
    """The sums for inputs anywhere in low..high. Raises where the C would not compute them exactly.

    Results in ``wraps`` may leave their unsigned type: they are meant modulo 2^bits.
    """
    domain = LinearDomain()
    found = call(Machine(unit, domain), function, inputs(count, low, high), *options)
    out = {name: value.x if name in wraps else exact(name, value, domain) for name, value in found.items()}
    return Sums(out, domain.peak, domain.steps)


class Known:
    """A domain for runs in which every number is known: nothing may reach it."""

    def __getattr__(self, name: str) -> object:
        raise AssertionError(f"{name} of an unknown number")


def evaluate(unit: c_ast.FileAST, function: str, values: list[int], *options: int) -> dict[str, int]:
    """Results of the same C on known numbers. Raises Undefined where C leaves the result open."""
    domain: Domain = Known()  # type: ignore[assignment]
    return {name: value.x for name, value in call(Machine(unit, domain), function, values, *options).items()}
