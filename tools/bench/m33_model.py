"""Cycles of a Cortex-M33 from the addresses it executed: a model, not measured on silicon.

Costs are those that the RP2350 data sheet measured (3.7.4.9), with memory that never waits: most instructions one
cycle, one more where the next one reads a result that is late, a register of a list one, a taken branch two, less where
it is folded with the instruction before it. Costs that depend on data are the worst ones: a division 11. The data sheet
leaves the cost of a 64-bit load open: counted as a list of two.
"""

from __future__ import annotations

import re
from collections import Counter
from functools import cache

from m4f_model import BRANCHES, MANY, PLAIN, SINGLE, Instruction, UnknownInstruction, decode, registers_in

DIVISION = 11  # 4 + n / 4, of n up to 31
MULTIPLIES = re.compile(r"(mul|mla|mls|[su]ml?[au]l[bt]{0,2}l?|[su]mull|smulbb|smlabb|smlal|umlal)$")
SETS_FLAGS = re.compile(r"(cmp|cmn|tst|teq)$")
LATE_SHIFT = re.compile(r"\b(lsr|asr|ror|rrx)\b|\blsl #(?![0-3]\b)")
REGISTER = re.compile(r"\b(r\d+|sl|fp|ip|sp|lr)\b")
FOLDED = re.compile(r"(b|b(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le|hs|lo))$")
SHIFTS = ("lsl", "lsr", "asr", "ror", "rrx", "ubfx", "sbfx", "bfi", "bfc", "sxtb", "sxth", "uxtb", "uxth")


def alone(i: Instruction) -> int:
    """Cycles of one instruction by itself, of a branch without the cost of a jump."""
    if i.name in ("sdiv", "udiv"):
        return DIVISION
    if i.name in ("ldrd", "strd"):
        return 2
    if MANY.match(i.name) and not i.name.startswith("v"):
        return registers_in(i.operands)
    if BRANCHES.match(i.name):
        return 0
    if SINGLE.match(i.name) or (i.name in PLAIN and not i.name.startswith("v")):
        return 1
    raise UnknownInstruction(f"the Cortex-M33 model has no cycles for {i.name} {i.operands}; add them to m33_model.py")


def late(i: Instruction) -> set[str]:
    """Registers that the very next instruction has to wait for."""
    named = REGISTER.findall(i.operands)
    if not named:
        return set()
    if MULTIPLIES.match(i.name):
        return set(named[: 2 if "l" in i.name[3:] and i.name not in ("mul",) else 1])
    if i.name in ("sdiv", "udiv") or (i.name.startswith("ldr") and SINGLE.match(i.name)):
        return {named[0]}
    if i.name.startswith(("ldm", "pop", "ldrd")):
        return {named[1] if i.name == "ldrd" else named[-1]}
    if i.name not in SHIFTS and i.name in PLAIN and LATE_SHIFT.search(i.operands):
        return {named[0]}
    return set()


def reads(i: Instruction) -> set[str]:
    """Registers needed when an instruction begins: not the value of a store, nor the start of a sum."""
    named = REGISTER.findall(i.operands)
    if i.name.startswith(("push", "pop")):
        return {"sp"}
    if SINGLE.match(i.name) or i.name in ("ldrd", "strd"):
        return set(REGISTER.findall(i.operands.partition("[")[2]))
    if i.name.startswith(("ldm", "stm")):
        return set(named[:1])
    if MULTIPLIES.match(i.name):
        return set(named[2:4] if "l" in i.name[3:] else named[1:3])
    if SETS_FLAGS.match(i.name) or BRANCHES.match(i.name):
        return set(named)
    return set(named[1:] if len(named) > 1 else named)


def follows(b: Instruction, a: Instruction) -> bool:
    return b.address == a.address + a.size


@cache  # the same neighbours recur in every frame
def step(first: Instruction, before: Instruction, a: Instruction, b: Instruction) -> int:
    """Cycles of ``a`` behind two others and before ``b``."""
    whole = before.size == 2 and before.name not in ("nop", "it") and not BRANCHES.match(before.name)
    pairs_up = whole and follows(a, before) and (follows(before, first) or before.address % 4 == 0)
    cycles = alone(a)
    if a.name in ("nop", "it"):
        return 0 if b.size == 2 or (a.name == "nop" and pairs_up) else 1
    if late(a) & reads(b) or (a.sets_flags and LATE_SHIFT.search(a.operands) and a.name not in SHIFTS):
        cycles += 1
    if not follows(b, a):
        loaded = not BRANCHES.match(a.name)
        unaligned = b.address % 4 != 0 and b.size == 4 and not before.name.startswith(("pop", "push"))
        folds = pairs_up and (FOLDED.match(a.name) or (a.name, a.operands) == ("bx", "lr"))
        known = a.name in ("b", "bx") or not before.sets_flags
        return cycles + 2 + loaded + unaligned - bool(folds and known)
    if BRANCHES.match(a.name):  # not taken
        return cycles + 1 - bool(pairs_up and FOLDED.match(a.name))
    return cycles


class Model:
    """Cycles of a run of an image."""

    def __init__(self, disassembly: str) -> None:
        self.code = decode(disassembly)

    def cycles(self, fours: Counter[tuple[int, int, int, int]]) -> int:
        """Cycles of the third of four neighbours each, times how often the four occurred."""
        code = self.code
        return sum(times * step(*(code[at] for at in four)) for four, times in fours.items())
