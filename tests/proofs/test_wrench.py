"""Force and torque (firmware/core/solve/wrench.c): every product fits, and how far each result is from the exact one.

The bounds proved are the parts of firmware/reference/kernel_bounds.h that these functions are answerable for.
"""

from __future__ import annotations

from fractions import Fraction
from typing import Any

import pytest
import z3

from prover import Report
from prover.cnumbers import INT
from prover.integers import IntegerDomain
from prover.prove import Refuted, prove
from prover.source import CORE, changed, parse, text_of
from prover.table import constants

WRENCH = text_of(CORE / "solve/wrench.c")
(
    GAIN_MAX,
    FORCE_DIVISOR,
    FORCE_BITS,
    TORQUE_DIVISOR,
    TORQUE_BITS,
    FORCE_SUM_MAX,
    TORQUE_SUM_MAX,
    FORCE_MAX,
    LEVER_MAX,
    LEVER_BITS,
    LEVER_SPLIT_BITS,
) = constants(
    "solve/wrench.c",
    "BT_GAIN_MAX_NN",
    "FORCE_DIVISOR",
    "FORCE_BITS",
    "TORQUE_DIVISOR",
    "TORQUE_BITS",
    "BT_SUM_NORMAL_MAX_Q4_MILLI",
    "BT_SUM_ARM_MAX_Q4_NM / BT_SUMS_TORQUE_UNIT_NM + 2 + BT_ELECTRODES * (int64_t)BT_E_MAX_Q4",
    "FORCE_MAX_100UN",
    "LEVER_MAX",
    "LEVER_BITS",
    "LEVER_SPLIT_BITS",
)

# What the C does to one sum, from the setting to the result, and to one frame's lever.
HARNESS = """
int32_t proof_force(int32_t sum, int32_t gain_nn)
{
    bt_gain gain = multiplier(gain_nn, FORCE_BITS, FORCE_DIVISOR);
    return scale(sum, &gain, FORCE_BITS);
}
int32_t proof_torque(int32_t sum, int32_t gain_nn)
{
    bt_gain gain = multiplier(gain_nn, TORQUE_BITS, TORQUE_DIVISOR);
    return scale(sum, &gain, TORQUE_BITS);
}
int32_t proof_lever(int32_t y, int32_t z, int32_t fy, int32_t fz)
{
    int32_t lever[2] = {y, z};
    int32_t force[3] = {0, fy, fz};
    return bt_torque_x_derived(lever, force);
}
"""


def size(x: Any) -> Any:
    return z3.If(x < 0, -x, x)


def within(x: Any, limit: int) -> Any:
    return z3.And(-limit <= x, x <= limit)


def scaled(
    text: str,
    function: str,
    sum_max: int,
    bits: int,
    divisor: int,
    *,
    multiplier_error: Fraction,
    sum_min: int | None = None,
) -> Fraction:
    """|result - sum * gain / divisor| <= 1/2 + |sum| * error of the multiplier; returns the bound.

    For sums from -sum_max, or from sum_min, to sum_max.
    """
    least = -sum_max if sum_min is None else sum_min
    bound = Fraction(1, 2) + sum_max * multiplier_error / (1 << bits)

    def claim(result: Any, sum: Any, gain_nn: Any) -> Any:
        off = size(result * divisor - sum * gain_nn)
        return off * bound.denominator <= divisor * bound.numerator

    prove(
        parse(text + HARNESS),
        function,
        [("sum", INT), ("gain_nn", INT)],
        lambda sum, gain_nn: z3.And(least <= sum, sum <= sum_max, within(gain_nn, GAIN_MAX)),
        claim,
        domain=IntegerDomain(),
    )
    return bound


FORCE = ("proof_force", FORCE_SUM_MAX, FORCE_BITS, FORCE_DIVISOR)
TORQUE = ("proof_torque", TORQUE_SUM_MAX, TORQUE_BITS, TORQUE_DIVISOR)


def test_force_is_within_its_bound(proved: Report) -> None:
    bound = scaled(WRENCH, *FORCE, multiplier_error=Fraction(1, 2))
    # kernel_bounds.h: FORCE_BOUND_MN; a unit is 0.1 mN and the force's sum is exact.
    proved(f"{float(bound) / 10:.6f} mN of the exact force, for every gain")
    assert bound / 10 <= Fraction("0.0524")


def test_torque_is_within_its_bound_of_its_sum(proved: Report) -> None:
    bound = scaled(WRENCH, *TORQUE, multiplier_error=Fraction(1, 2))
    proved(f"{float(bound):.6f} mN*mm of gain times the sum that was added")
    # kernel_bounds.h has half a unit and, of the sum in units of 0.2 count*um, half of 2^-35.
    assert bound == Fraction(1, 2) + Fraction(TORQUE_SUM_MAX, 1 << 36)


@pytest.mark.parametrize("which", [FORCE, TORQUE])
def test_a_tighter_bound_is_refuted(which: tuple[str, int, int, int]) -> None:
    """Without the multiplier's share there is a sum and a gain that are further off."""
    with pytest.raises(Refuted):
        scaled(WRENCH, *which, multiplier_error=Fraction(0))


def test_a_lost_bit_of_the_multiplier_is_refuted() -> None:
    """Looked for at the largest sum, where the bit weighs most: among all sums z3 looks for minutes."""
    text = changed(WRENCH, "(uint16_t)magnitude,", "(uint16_t)(magnitude / 2 * 2),")
    with pytest.raises(Refuted):
        scaled(text, *FORCE, multiplier_error=Fraction(1, 2), sum_min=FORCE_SUM_MAX)


def lever(text: str, bound: Fraction, force_max: int = FORCE_MAX) -> None:
    """|result - (y fz - z fy) / 2^LEVER_BITS| <= bound, in mN*mm, for points and forces that occur."""

    def claim(result: Any, y: Any, z: Any, fy: Any, fz: Any) -> Any:
        off = size(result * (1 << LEVER_BITS) - (y * fz - z * fy))
        return off * bound.denominator <= bound.numerator * (1 << LEVER_BITS)

    prove(
        parse(text + HARNESS),
        "proof_lever",
        [("y", INT), ("z", INT), ("fy", INT), ("fz", INT)],
        lambda y, z, fy, fz: z3.And(
            within(y, LEVER_MAX), within(z, LEVER_MAX), within(fy, force_max), within(fz, force_max)
        ),
        claim,
        domain=IntegerDomain(),
    )


def test_torque_x_is_the_lever_to_its_rounding(proved: Report) -> None:
    """Half a unit, and what two cuts of less than one 2^-4 each lose."""
    bound = Fraction(1, 2) + Fraction(1, 1 << (LEVER_BITS - LEVER_SPLIT_BITS))
    lever(WRENCH, bound)
    proved(f"{float(bound)} mN*mm of point times force")


CHANGES = {
    "a tighter bound": lambda: lever(WRENCH, Fraction(1, 2)),
    "a wrong sign": lambda: lever(changed(WRENCH, "- z * fy_low", "+ z * fy_low"), Fraction(9, 16)),
    "forces that do not fit": lambda: lever(WRENCH, Fraction(9, 16), 16 * FORCE_MAX),
}
BY_DAY = "forces that do not fit"  # a second; the others take twenty


@pytest.mark.parametrize("wrong", [pytest.param(w, marks=() if w == BY_DAY else pytest.mark.nightly) for w in CHANGES])
def test_a_wrong_lever_is_refuted(wrong: str) -> None:
    with pytest.raises(Refuted):
        CHANGES[wrong]()
