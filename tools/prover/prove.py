"""Asking z3: a claim about a C function, together with everything C leaves undefined in it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import z3
from pycparser import c_ast

from .bitvec import BitVectorDomain
from .cnumbers import CType
from .integers import IntegerDomain, Number
from .machine import Machine
from .storage import Value

Input = tuple[str, CType] | int  # a symbol, or a known number


class Refuted(Exception):
    """The claim is wrong; the witness is an input for which it is."""

    def __init__(self, claim: str, witness: dict[str, int]) -> None:
        super().__init__(f"{claim}: wrong for {witness}")
        self.claim = claim
        self.witness = witness


class Undecided(Exception):
    """z3 gave up; never taken for a proof."""


def ask(claim: str, conditions: Sequence[Any], inputs: dict[str, Any], signed: dict[str, bool], timeout_s: int) -> None:
    """Return when the conditions contradict each other, i.e. no counterexample exists."""
    solver = z3.Solver()
    solver.set("timeout", timeout_s * 1000)
    solver.add(*conditions)
    answer = solver.check()
    if answer == z3.unsat:
        return
    if answer == z3.unknown:
        raise Undecided(f"{claim}: {solver.reason_unknown()}")
    model = solver.model()
    witness = {}
    for name, term in inputs.items():
        value = model.eval(term, model_completion=True)
        is_vector = isinstance(value, z3.BitVecNumRef)
        witness[name] = value.as_signed_long() if is_vector and signed[name] else value.as_long()
    raise Refuted(claim, witness)


def prove(
    unit: c_ast.FileAST,
    function: str,
    arguments: Sequence[Input],
    assume: Callable[..., Any],
    claim: Callable[..., Any],
    *,
    domain: IntegerDomain | BitVectorDomain,
    timeout_s: int = 60,
) -> int:
    """Prove ``claim(result, **inputs)`` and that nothing undefined happens, where ``assume(**inputs)`` holds.

    Inputs reach both as z3 terms. Returns how many queries were answered.
    """
    machine = Machine(unit, domain)
    values = []
    signed = {}
    for argument in arguments:
        if isinstance(argument, int):
            values.append(Value(CType(True, 64), argument))
        else:
            name, kind = argument
            signed[name] = kind.signed
            values.append(Value(kind, domain.input(name, kind)))
    result = machine.call(function, *values)
    term = result.x.term if isinstance(result.x, Number) else result.x
    inputs = domain.inputs
    assumed = assume(**inputs)
    for duty in domain.obligations:
        guard = [] if duty.guard is True else [duty.guard]
        conditions = [*domain.facts[: duty.facts], assumed, *guard, z3.Not(duty.condition)]
        ask(f"{function}: {duty.what}", conditions, inputs, signed, timeout_s)
    ask(function, [*domain.facts, assumed, z3.Not(claim(term, **inputs))], inputs, signed, timeout_s)
    return len(domain.obligations) + 1
