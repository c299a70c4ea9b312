"""tools/bench without the emulators: the Cortex-M4F's cycle model and QEMU's log."""

from collections import Counter
from itertools import pairwise

import pytest

import m4f_model
import m33_model


def listing(*instructions: str) -> str:
    """objdump's lines: two bytes each, four with a .w or a v in front."""
    lines, address = [], 0x100
    for text in instructions:
        wide = ".w" in text.split()[0] or text.startswith("v")
        name, _, operands = text.partition(" ")
        lines.append(f"{address:8x}:\t{'e000 e000' if wide else 'e000'}      \t{name}\t{operands}")
        address += 4 if wide else 2
    return "\n".join(lines)


@pytest.mark.parametrize(
    ("instructions", "cycles"),
    [
        (("adds r0, r0, #1", "bx lr"), 1),
        (("ldr r0, [r1, #4]", "adds r0, #1"), 2),
        (("ldr r0, [r1, #4]", "ldr.w r2, [r1, #8]", "adds r0, #1"), 3),
        (("str r0, [r1, #4]", "adds r0, #1"), 1),
        (("str r0, [r1, r2]", "adds r0, #1"), 2),
        (("push {r4, r5, r6, lr}", "nop"), 5),
        (("stmdb.w sp!, {r4-r11, lr}", "nop"), 10),
        (("smlal.w r0, r1, r2, r3", "nop"), 1),
        (("udiv.w r0, r1, r2", "nop"), 12),
        (("vsqrt.f32 s0, s1", "vmov r0, s2"), 14),
        (("vsqrt.f32 s0, s1", "vmul.f32 s2, s0, s3"), 15),
        (("vmul.f32 s0, s1, s2", "vmul.f32 s0, s1, s2"), 1),
        (("vpush {d8, d9}", "nop"), 5),
        (("moveq r0, #1", "nop"), 1),
        (("itte ne", "nop"), 1),
    ],
)
def test_cycles_of_neighbours(instructions, cycles) -> None:
    code = m4f_model.Model(listing(*instructions))
    assert code.cycles(Counter(pairwise(sorted(code.code)))) == cycles


def test_a_branch_costs_more_when_it_is_taken() -> None:
    code = m4f_model.Model(listing("beq.n 104", "nop", "nop"))
    assert code.cycles(Counter([(0x100, 0x102)])) == 1
    assert code.cycles(Counter([(0x100, 0x104)])) == 3


def test_an_unknown_instruction_is_named() -> None:
    code = m4f_model.Model(listing("qadd16 r0, r1, r2", "nop"))
    with pytest.raises(m4f_model.UnknownInstruction, match="no cycles for qadd16"):
        code.cycles(Counter([(0x100, 0x102)]))


@pytest.mark.parametrize("size", [1, 7, 60, 61, 1000])
def test_runs_are_cut_out_of_the_log_whatever_its_chunks(size) -> None:
    addresses = [0x10, 0x40, 0x20, 0x22, 0x40, 0x30, 0x40, 0x24, 0x40, 0x50]
    log = b"".join(b"Trace 0: 0x7f00 [00800408/%08x/00000110/ff000201] name\n" % a for a in addresses)
    chunks = [log[k : k + size] for k in range(0, len(log), size)]
    assert list(m4f_model.runs(chunks, 0x40)) == [[0x20, 0x22], [0x24]]


def m33_cycles(start: int, *body: str) -> int:
    """Instructions of a loop of a hundred turns, MOVS R5,#100 before it and BNE after; 16 bits each."""
    lines = ["movs r5, #100", *body, "bne.n 100", "mov r0, r1"]
    at = [start + 2 * k for k in range(len(lines))]
    text = "\n".join(f" {a:x}:\t0000\t{line.replace(' ', chr(9), 1)}" for a, line in zip(at, lines, strict=True))
    run = [at[0], *(at[1:-1] * 100), at[-1]]
    fours = Counter(zip([run[0], run[0], *run], [run[0], *run], run, run[1:], strict=False))
    return m33_model.Model(text).cycles(fours)


def test_the_m33_takes_the_cycles_of_the_data_sheets_loops() -> None:
    assert m33_cycles(0x10000002, "subs r5, r5, #1") == 299  # RP2350 data sheet, 3.7.4.9.7
    assert m33_cycles(0x10000000, "subs r5, r5, #1") == 300
    assert m33_cycles(0x10000000, "subs r5, r5, #1", "mov r1, r2") == 300
    # a late result costs one cycle a turn, for a load, a product and a shifted operand
    alone = m33_cycles(0x10000000, "subs r5, r5, #1", "mov r1, r2", "mov r3, r4")
    for late in ("ldr r1, [r2]", "mul r1, r2, r1"):
        assert m33_cycles(0x10000000, "subs r5, r5, #1", late, "add r3, r1") == alone + 100
    assert m33_cycles(0x10000000, "subs r5, r5, #1", "str r1, [r2]", "add r3, r1") == alone


def test_the_m33_model_says_what_it_does_not_know() -> None:
    with pytest.raises(m4f_model.UnknownInstruction, match=r"no cycles for qadd16 .*m33_model\.py"):
        m33_cycles(0x10000000, "qadd16 r0, r1")
