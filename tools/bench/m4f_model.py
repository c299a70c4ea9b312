"""Cycles of a Cortex-M4F from the addresses it executed: a model, not measured on silicon.

Costs are those of the Cortex-M4 technical reference manual (r0p1, 3.3.1 and 7.2.2), with memory that never waits. Where
the manual gives a range, the worst counts: integer division 12, a taken branch 3. Cases that it leaves open do not:
folded ITs, VDIV in parallel with integer work. An instruction skipped by an IT block costs as much as if it ran.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from functools import cache

TAKEN = 2  # cycles that a taken branch adds to refill the pipeline
BRANCHES = re.compile(r"(b|bl|bx|blx|b(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le|hs|lo)|cbn?z|tb[bh])$")
SINGLE = re.compile(r"(ldr|str)s?[bh]?t?$")
MANY = re.compile(r"(ldm|stm|push|pop|vldm|vstm|vpush|vpop)")
REGISTER_LIST = re.compile(r"\{([^}]*)\}")
FP_REGISTER = re.compile(r"\bs\d+\b")
CONDITION = re.compile(r"(eq|ne|cs|cc|mi|pl|vs|vc|hi|ls|ge|lt|gt|le|hs|lo)$")
FP_ACCUMULATE = ("vmla", "vmls", "vnmla", "vnmls", "vfma", "vfms")
FP_ARITHMETIC = (*FP_ACCUMULATE, "vadd", "vsub", "vmul", "vnmul", "vdiv", "vsqrt", "vcvt")
READS_FIRST = (*FP_ACCUMULATE, "vcmp", "vcmpe", "vstr", "vpush", "vstm")
OTHERS = (*FP_ACCUMULATE, "sdiv", "udiv", "vdiv", "vsqrt", "ldrd", "strd", "vldr", "vstr")
# one cycle each
ONE_CYCLE = """
adc add addw and asr bfi bic clz cmn cmp eor it lsl lsr mla mls mov movt movw mul mvn neg nop orn orr rbit rev
ror rrx rsb sbc sbfx smlal smlabb smulbb smull sub subw sxtb sxth teq tst ubfx uadd8 umlal umull uxtab uxtah uxtb uxth
vabs vadd vcmp vcmpe vcvt vmov vmrs vmul vneg vnmul vsub
"""
PLAIN = frozenset(ONE_CYCLE.split())


class UnknownInstruction(ValueError):
    """The model has no cost for this instruction."""


@dataclass(frozen=True)
class Instruction:
    """One line of objdump."""

    address: int
    size: int
    name: str  # without width, type and condition
    operands: str
    sets_flags: bool = False


def decode(disassembly: str) -> dict[int, Instruction]:
    """Address -> instruction, from the output of `objdump -d` with raw bytes."""
    out: dict[int, Instruction] = {}
    for line in disassembly.splitlines():
        cells = line.split("\t")
        if len(cells) < 3 or not cells[0].strip().endswith(":"):
            continue
        address = int(cells[0].strip()[:-1], 16)
        size = len(cells[1].replace(" ", "")) // 2
        operands = cells[3].split(";")[0].split("@")[0].strip() if len(cells) > 3 else ""
        name, raw = base_name(cells[2].strip()), cells[2].strip().split(".")[0]
        sets = (raw.endswith("s") and name not in (raw, raw[:-2])) or name in ("cmp", "cmn", "tst", "teq")
        out[address] = Instruction(address, size, name, operands, sets)
    return out


def base_name(text: str) -> str:
    """subs.w -> sub, vmul.f32 -> vmul, moveq -> mov, itte -> it."""
    name = text.split(".")[0]
    if re.match(r"it[te]{0,3}$", name):
        return "it"
    if name in PLAIN or BRANCHES.match(name) or SINGLE.match(name) or MANY.match(name) or name in OTHERS:
        return name
    for shorter in (name[:-1] if name.endswith("s") else name, CONDITION.sub("", name)):
        if shorter in PLAIN or BRANCHES.match(shorter) or SINGLE.match(shorter) or shorter in OTHERS:
            return shorter
    return re.sub(r"s$", "", CONDITION.sub("", name))


def registers_in(operands: str) -> int:
    """Number of registers in a register list."""
    count = 0
    found = REGISTER_LIST.search(operands)
    for part in (found.group(1) if found else "").split(","):
        first, _, last = part.strip().partition("-")
        words = 2 if first.startswith("d") else 1
        count += words * (int(last[1:]) - int(first[1:]) + 1 if last else 1)
    return count


def alone(i: Instruction) -> int:
    """Cycles of one instruction by itself."""
    if i.name in ("sdiv", "udiv"):
        return 12
    if i.name in ("vdiv", "vsqrt"):
        return 14
    if i.name in (*FP_ACCUMULATE, "ldrd", "strd"):
        return 3
    if i.name in ("vldr", "vstr"):
        return 3 if i.operands.startswith("d") else 2
    if i.name in ("tbb", "tbh"):
        return 2
    if MANY.match(i.name):
        return 1 + registers_in(i.operands)
    if SINGLE.match(i.name):
        stored_at_once = i.name.startswith("str") and not re.search(r"\[[^\],]+, [a-z]", i.operands)
        return 1 if stored_at_once else 2
    if i.name == "vmov":
        return 2 if i.operands.count(",") > 1 else 1
    if i.name in PLAIN or BRANCHES.match(i.name):
        return 1
    raise UnknownInstruction(f"the Cortex-M4F model has no cycles for {i.name} {i.operands}; add them to m4f_model.py")


@cache  # the same pairs recur in every frame
def step(a: Instruction, b: Instruction) -> int:
    """Cycles of ``a`` when ``b`` follows, including taken branches, waits for a result and pipelined loads."""
    cycles = alone(a)
    jumped = b.address != a.address + a.size
    if jumped:
        cycles += TAKEN
    if SINGLE.match(a.name) and SINGLE.match(b.name) and alone(b) == 2 and not jumped:
        cycles -= 1  # b's cycle: the address goes out while a's data comes in
    if a.name in FP_ARITHMETIC and reads(b, a.operands.split(",")[0]):
        cycles += 1
    return cycles


def reads(i: Instruction, register: str) -> bool:
    if not FP_REGISTER.fullmatch(register):
        return False
    operands = i.operands if i.name in READS_FIRST else i.operands.partition(",")[2]
    return register in FP_REGISTER.findall(operands)


class Model:
    """Cycles of a run of an image."""

    def __init__(self, disassembly: str) -> None:
        self.code = decode(disassembly)

    def cycles(self, pairs: Counter[tuple[int, int]]) -> int:
        """Cycles of the first instruction of each pair of neighbours, times how often the pair occurred."""
        return sum(times * step(self.code[first], self.code[second]) for (first, second), times in pairs.items())


TRACE = re.compile(rb"\[[0-9a-f]+/([0-9a-f]+)/")


def runs(chunks: Iterable[bytes], mark: int) -> Iterable[list[int]]:
    """The addresses between two marks, run by run, from QEMU's log of executed one-instruction blocks."""
    wanted = b"%08x" % mark
    rest = b""
    open_run: list[bytes] | None = None
    for chunk in chunks:
        whole, newline, rest = (rest + chunk).rpartition(b"\n")
        seen = TRACE.findall(whole + newline)
        at = 0
        while True:
            try:
                end = seen.index(wanted, at)
            except ValueError:
                end = len(seen)
            if open_run is not None:
                open_run += seen[at:end]
            if end == len(seen):
                break
            if open_run is None:
                open_run = []
            else:
                yield [int(a, 16) for a in open_run]
                open_run = None
            at = end + 1
