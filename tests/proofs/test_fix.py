"""firmware/core/fix.h, proved for all inputs of the ranges it states; nothing undefined happens in it.

Every claim is also made about a copy of the source with one thing wrong in it, which must be refuted by
an input; that input then runs through the same C with known numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import pytest
import z3

from prover.bitvec import BitVectorDomain
from prover.cnumbers import INT, INT64, UINT, Undefined
from prover.integers import IntegerDomain
from prover.machine import Machine
from prover.prove import Input, Refuted, prove
from prover.source import CORE, changed, parse, text_of
from prover.storage import Value
from prover.table import constants

FIX = text_of(CORE / "fix.h")
SPLIT_BITS, ARM_SPLIT_BITS = constants("fold_gen.h", "BT_FOLD_SPLIT_BITS", "BT_FOLD_ARM_SPLIT_BITS")


def size(x: Any) -> Any:
    return z3.If(x < 0, -x, x)


def rounded_half_away(result: Any, num: Any, den: Any) -> Any:
    """|result| is the whole number nearest to |num / den|, the larger one at a tie; signs agree."""
    nearest = z3.And(2 * size(num) - den < 2 * size(result) * den, 2 * size(result) * den <= 2 * size(num) + den)
    return z3.And(nearest, z3.Implies(result > 0, num > 0), z3.Implies(result < 0, num < 0))


def rounded_from(result: Any, num: Any, bits: int, threshold: int) -> Any:
    """|num| / 2^bits, up from a remainder of ``threshold`` on, with the sign of num."""
    magnitude = (size(num) + (1 << bits) - threshold) / (1 << bits)  # z3's / of integers rounds down
    return result == z3.If(num < 0, -magnitude, magnitude)


@dataclass(frozen=True)
class Claim:
    function: str
    arguments: list[Input]
    assume: Callable[..., Any]
    claim: Callable[..., Any]
    wrong: tuple[str, str]  # what to change in fix.h so that the claim no longer holds
    timeout_s: int = 60


def joins(bits: int, threshold: int) -> Claim:
    room = 2**31 - 1 - (1 << (31 - bits))  # hi and the carry of lo together must fit: fix.h's callers assert it
    return Claim(
        "bt_join",
        [("hi", INT), ("lo", INT), bits, threshold],
        lambda hi, lo: size(hi) <= room,
        lambda result, hi, lo: rounded_from(result, hi * (1 << bits) + lo, bits, threshold),
        ("whole - (rest >= from)", "whole - (rest > from)"),
    )


CLAIMS = {
    "div_round": Claim(
        "bt_div_round",
        [("num", INT64), ("den", INT64)],
        lambda num, den: den > 0,
        lambda result, num, den: rounded_half_away(result, num, den),
        ("rest_abs >= den - rest_abs", "rest_abs > den - rest_abs"),
    ),
    "div_round_u32": Claim(
        "bt_div_round_u32",
        [("num", UINT), ("den", UINT)],
        lambda num, den: z3.And(den > 0, num < 2**32 - den / 2),
        lambda result, num, den: rounded_half_away(result, num, den),
        ("num + den / 2", "num + (den - 1) / 2"),
    ),
    "with_sign": Claim(
        "bt_with_sign",
        [("magnitude", UINT), ("sign", INT)],
        lambda magnitude, sign: magnitude < 2**31,
        lambda result, magnitude, sign: result == z3.If(sign < 0, -magnitude, magnitude),
        ("sign < 0 ?", "sign <= 0 ?"),
    ),
    "abs": Claim(
        "bt_abs",
        [("value", INT64)],
        lambda value: z3.BoolVal(True),
        lambda result, value: result == size(value),
        ("value < 0 ? 0 - (uint64_t)value", "value < 0 ? 1 - (uint64_t)value"),
    ),
    "abs32": Claim(
        "bt_abs32",
        [("value", INT)],
        lambda value: z3.BoolVal(True),
        lambda result, value: result == size(value),
        ("value < 0 ? 0 - (uint32_t)value", "value < 0 ? (uint32_t)-value"),  # undefined for the smallest number
    ),
}
# multiplier and value as fix.h states them. The smallest int32 is left out: its magnitude is 2^31.
for _bits in range(1, 8):
    CLAIMS[f"scale_{_bits}"] = Claim(
        "bt_scale",
        [("value", INT), ("multiplier", UINT), _bits],
        lambda value, multiplier: z3.And(value > -(2**31), multiplier <= 2**30),
        lambda result, value, multiplier, bits=_bits: rounded_half_away(result, value * multiplier, 1 << (32 + bits)),
        ("(low * m_low >> 16)", "(low * m_low >> 17)"),
    )
# Every number of bits, at the two thresholds fix.h names and at what lies between and below.
for _bits in range(1, 31):
    for _from in sorted({1, 1 << (_bits - 1), (1 << (_bits - 1)) + 1, 1 << _bits}):
        CLAIMS[f"join_{_bits}_{_from}"] = joins(_bits, _from)

REFUTED = [name for name in CLAIMS if not name.startswith("join_")] + [f"join_{SPLIT_BITS}_{1 << (SPLIT_BITS - 1)}"]


def run(text: str, case: Claim) -> int:
    domain = IntegerDomain()
    unit = parse(text)
    return prove(unit, case.function, case.arguments, case.assume, case.claim, domain=domain, timeout_s=case.timeout_s)


@pytest.mark.parametrize("name", CLAIMS)
def test_holds_for_every_input(name: str) -> None:
    assert run(FIX, CLAIMS[name]) >= 1


def confirm(text: str, case: Claim, witness: dict[str, int]) -> None:
    """The witness is real: C itself, on known numbers, gives a wrong answer or leaves C's rules."""
    machine = Machine(parse(text), IntegerDomain())
    known = [Value(INT64, a) if isinstance(a, int) else Value(a[1], witness[a[0]]) for a in case.arguments]
    symbols = {name: z3.IntVal(value) for name, value in witness.items()}
    assert z3.is_true(z3.simplify(case.assume(**symbols)))
    try:
        result = machine.call(case.function, *known)
    except Undefined:
        return
    assert z3.is_false(z3.simplify(case.claim(z3.IntVal(result.x), **symbols)))


@pytest.mark.parametrize("name", REFUTED)
def test_a_wrong_variant_is_refuted_with_a_witness(name: str) -> None:
    case = CLAIMS[name]
    text = changed(FIX, *case.wrong)
    with pytest.raises(Refuted) as refused:
        run(text, case)
    confirm(text, case, refused.value.witness)


def outside(case: Claim, assume: Callable[..., Any]) -> Claim:
    return Claim(case.function, case.arguments, assume, case.claim, case.wrong)


@pytest.mark.parametrize(
    ("name", "assume"),
    [
        ("div_round", lambda num, den: den >= 0),
        ("div_round_u32", lambda num, den: z3.And(den > 0, num <= 2**32 - den / 2)),
        ("scale_1", lambda value, multiplier: z3.And(value > -(2**31), multiplier <= 2**32 - 1)),
        (f"join_{ARM_SPLIT_BITS}_1", lambda hi, lo: z3.BoolVal(True)),
        ("with_sign", lambda magnitude, sign: magnitude <= 2**31),
    ],
)
def test_the_stated_range_is_needed(name: str, assume: Callable[..., Any]) -> None:
    case = outside(CLAIMS[name], assume)
    with pytest.raises(Refuted) as refused:
        run(FIX, case)
    confirm(FIX, case, refused.value.witness)


def test_bits_and_integers_agree_on_what_a_shift_and_a_mask_do() -> None:
    """bt_join once more as bit-vectors: the integers' reading of >> and & of negative numbers is C's."""
    bits, threshold = ARM_SPLIT_BITS, 1 << (ARM_SPLIT_BITS - 1)

    def wide(x: Any) -> Any:
        return z3.SignExt(32, x)

    def claim(result: Any, hi: Any, lo: Any) -> Any:
        num = wide(hi) * (1 << bits) + wide(lo)
        magnitude = z3.If(num < 0, -num, num)
        return wide(result) == z3.If(num < 0, -(magnitude + threshold >> bits), magnitude + threshold >> bits)

    prove(
        parse(FIX),
        "bt_join",
        [("hi", INT), ("lo", INT), bits, threshold],
        lambda hi, lo: z3.And(hi < 2**30, hi > -(2**30)),
        claim,
        domain=BitVectorDomain(),
    )
