"""Asks z3 about a claim on a C function, together with everything that C leaves undefined in it.

Every question goes to a z3 process of its own, as text, with a limit in z3's own units of work. So z3's answer and its
cost depend on the question alone, not on earlier questions or on what else the computer does.
"""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
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
    """The claim is wrong; the witness is an input for which it fails."""

    def __init__(self, claim: str, witness: dict[str, int]) -> None:
        super().__init__(f"{claim}: fails for {witness}")
        self.claim = claim
        self.witness = witness


class Undecided(Exception):
    """z3 gave up, which never counts as a proof."""


# In z3's own units. The hardest nightly question takes 35 million (45 s), the hardest of the daily ones 17 million.
LIMIT = 400_000_000

VALUE = re.compile(r"\((\w+) (?:(\d+)|\(- (\d+)\)|#x([0-9a-f]+)|#b([01]+))\)")


def program() -> str:
    """Path of the z3 program, from z3-solver's wheel or from Debian."""
    found = shutil.which("z3", path=os.pathsep.join([os.path.dirname(sys.executable), os.environ.get("PATH", "")]))
    if found is None:
        raise FileNotFoundError("z3 is missing; install it: pip install z3-solver, or apt-get install z3")
    return found


def ask(claim: str, conditions: Sequence[Any], inputs: dict[str, Any], signed: dict[str, bool]) -> None:
    """Return if the conditions contradict each other, i.e. no counterexample exists. Raises Refuted or Undecided."""
    solver = z3.Solver()
    solver.add(*conditions)
    text = solver.to_smt2()
    named = [name for name in inputs if f"(declare-fun {name} ()" in text]
    text += f"(get-value ({' '.join(named)}))\n" if named else ""
    command = [program(), "-smt2", "-in", f"rlimit={LIMIT}"]
    done = subprocess.run(command, input=text, capture_output=True, text=True, check=False)
    answer, _, values = done.stdout.partition("\n")
    if answer == "unsat":
        return
    if answer != "sat":
        raise Undecided(f"{claim}: z3 says {answer or done.stderr.strip()!r} within {LIMIT} units of work")
    witness = dict.fromkeys(inputs, 0)  # 0 for whatever the conditions do not mention
    for name, plus, minus, hexadecimal, binary in VALUE.findall(values):
        witness[name] = int(plus or 0) - int(minus or 0) + int(hexadecimal or "0", 16) + int(binary or "0", 2)
        bits = 4 * len(hexadecimal) or len(binary)
        if bits and signed[name] and witness[name] >> (bits - 1):
            witness[name] -= 1 << bits
    raise Refuted(claim, witness)


def prove(
    unit: c_ast.FileAST,
    function: str,
    arguments: Sequence[Input],
    assume: Callable[..., Any],
    claim: Callable[..., Any],
    *,
    domain: IntegerDomain | BitVectorDomain,
) -> int:
    """Prove ``claim(result, **inputs)`` and that nothing undefined happens, where ``assume(**inputs)`` holds.

    Inputs reach both as z3 terms. Returns the number of queries answered.
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
        ask(f"{function}: {duty.what}", conditions, inputs, signed)
    ask(function, [*domain.facts, assumed, z3.Not(claim(term, **inputs))], inputs, signed)
    return len(domain.obligations) + 1
