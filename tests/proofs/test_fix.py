"""firmware/core/fixed_point.h, proved for all inputs of the ranges it states; nothing undefined happens in it.

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

FIX = text_of(CORE / "fixed_point.h")


def size(x: Any) -> Any:
    return z3.If(x < 0, -x, x)


def rounded_half_away(result: Any, num: Any, den: Any) -> Any:
    """|result| is the whole number nearest to |num / den|, the larger one at a tie; signs agree."""
    nearest = z3.And(2 * size(num) - den < 2 * size(result) * den, 2 * size(result) * den <= 2 * size(num) + den)
    return z3.And(nearest, z3.Implies(result > 0, num > 0), z3.Implies(result < 0, num < 0))


@dataclass(frozen=True)
class Claim:
    function: str
    arguments: list[Input]
    assume: Callable[..., Any]
    claim: Callable[..., Any]
    wrong: tuple[str, str]  # what to change in fix.h so that the claim no longer holds


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
        ("^ mask) - mask", "^ mask) + mask"),
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
for _bits in (16, 19):
    CLAIMS[f"shift_round_{_bits}"] = Claim(
        "bt_shift_round",
        [("value", INT64), _bits],
        lambda value: z3.And(value > -(2**62), value < 2**62),
        lambda result, value, bits=_bits: rounded_half_away(result, value, 1 << bits),
        ("(uint64_t)1 << (bits - 1)", "(uint64_t)1 << (bits - 2)"),
    )
# The magnitude, the multiplier and the bits as fix.h states them.
for _bits in range(1, 8):
    CLAIMS[f"scale_{_bits}"] = Claim(
        "bt_scale",
        [("magnitude", UINT), ("m_high", UINT), ("m_low", UINT), _bits],
        lambda magnitude, m_high, m_low: z3.And(
            magnitude < 2**31, m_low < 2**16, m_high * 65536 + m_low <= 2**30, m_high >= 0
        ),
        lambda result, magnitude, m_high, m_low, bits=_bits: rounded_half_away(
            result, magnitude * (m_high * 65536 + m_low), 1 << (32 + bits)
        ),
        ("(low * m_low >> 16)", "(low * m_low >> 17)"),
    )


def run(text: str, case: Claim) -> int:
    domain = IntegerDomain()
    unit = parse(text)
    return prove(unit, case.function, case.arguments, case.assume, case.claim, domain=domain)


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


@pytest.mark.parametrize("name", CLAIMS)
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
        ("scale_1", lambda magnitude, m_high, m_low: z3.And(magnitude < 2**31, m_low < 2**16, m_high < 2**16)),
        ("with_sign", lambda magnitude, sign: magnitude <= 2**31),
    ],
)
def test_the_stated_range_is_needed(name: str, assume: Callable[..., Any]) -> None:
    case = outside(CLAIMS[name], assume)
    with pytest.raises(Refuted) as refused:
        run(FIX, case)
    confirm(FIX, case, refused.value.witness)


def bit_length_is_right(text: str) -> None:
    """2^(n - 1) <= value < 2^n, and 0 for 0; as bit-vectors, which is what counting zeros is about."""

    def claim(result: Any, value: Any) -> Any:
        wide, one = z3.ZeroExt(32, value), z3.BitVecVal(1, 64)
        length = z3.ZeroExt(32, result)
        inside = z3.And(z3.ULT(wide, one << length), z3.UGE(wide, z3.LShR(one << length, 1)))
        return z3.And(result >= 0, result <= 32, z3.If(value == 0, result == 0, inside))

    domain = BitVectorDomain()
    prove(parse(text), "bt_bit_length", [("value", UINT)], lambda value: z3.BoolVal(True), claim, domain=domain)


def test_bit_length() -> None:
    bit_length_is_right(FIX)
    with pytest.raises(Refuted) as refused:  # without the test for 0, clz of 0 is undefined
        bit_length_is_right(changed(FIX, "value == 0 ? 0 : 32", "value == 5 ? 0 : 32"))
    assert refused.value.witness["value"] in (0, 5)


def test_bits_and_integers_agree_on_shifts_masks_and_products() -> None:
    """Once more as bit-vectors: the integers' reading of >>, & and wrapping products is the machine's.

    With a multiplier that is known, or z3 would have to find out how to multiply.
    """
    for m_high, m_low in ((0, 1), (0, 3), (1, 0), (0x4000, 0)):

        def claim(result: Any, magnitude: Any, multiplier: int = m_high * 65536 + m_low) -> Any:
            return z3.ZeroExt(32, result) == z3.LShR(z3.ZeroExt(32, magnitude) * multiplier + (1 << 32), 33)

        prove(
            parse(FIX),
            "bt_scale",
            [("magnitude", UINT), m_high, m_low, 1],
            lambda magnitude: z3.ULT(magnitude, 2**31),
            claim,
            domain=BitVectorDomain(),
        )
