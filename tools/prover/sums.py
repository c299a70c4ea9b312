"""The generated sums of fold_gen.c as exact linear forms."""

from __future__ import annotations

from dataclasses import dataclass

from pycparser import c_ast

from .cnumbers import INT, UINT, CType, Undefined
from .linear import Form, LinearDomain, inputs
from .machine import Domain, Machine
from .storage import Pointer, Struct, Value

KINDS = {"bt_fold_moments": UINT, "bt_fold_force": INT, "bt_fold_torque": INT}


@dataclass(frozen=True)
class Sums:
    hi: list[Form]  # or, where a sum is not split, the sum
    lo: list[Form]
    peak: int  # largest magnitude of any signed intermediate result, as the C orders them
    steps: int


def number_form(x: Form | int | None) -> Form:
    if x is None:
        raise Undefined("a sum that is never stored")
    return x if isinstance(x, Form) else Form({}, x)


def call(
    machine: Machine, function: str, kind: CType, values: list[Form] | list[int]
) -> tuple[list[Value], list[Value]]:
    """Run one of the sums; (hi, lo), lo empty for the force."""
    signals = Pointer([Value(kind, value) for value in values], 0)
    if function == "bt_fold_force":
        out: list[Value] = [Value(INT, None) for _ in range(3)]
        machine.call(function, signals, Pointer(out, 0))
        return out, []
    sums = machine.build(machine.types["bt_split_sums"])
    assert isinstance(sums, Struct)
    machine.call(function, signals, Pointer([sums], 0))
    return sums.fields["hi"][0], sums.fields["lo"][0]


def forms(unit: c_ast.FileAST, function: str, count: int, low: int, high: int) -> Sums:
    """The sums for inputs anywhere in low..high; raises where the C would not compute them exactly."""
    domain = LinearDomain()
    hi, lo = call(Machine(unit, domain), function, KINDS[function], inputs(count, low, high))
    return Sums([number_form(v.x) for v in hi], [number_form(v.x) for v in lo], domain.peak, domain.steps)


class Known:
    """For runs in which every number is known: nothing may reach the domain."""

    def __getattr__(self, name: str) -> object:
        raise AssertionError(f"{name} of an unknown number")


def evaluate(unit: c_ast.FileAST, function: str, values: list[int]) -> tuple[list[int], list[int]]:
    """The same C on known numbers; raises Undefined where C leaves the result open."""
    domain: Domain = Known()  # type: ignore[assignment]
    hi, lo = call(Machine(unit, domain), function, KINDS[function], values)
    return [v.x for v in hi], [v.x for v in lo]
