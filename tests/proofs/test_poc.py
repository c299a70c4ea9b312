"""From the sums to the moments, and from the moments to x (firmware/core/solve/poc.c), as z3 integers.

What is run is the C: for the moments, what follows the call of the generated sum in its function, with
the sum's results as inputs anywhere within the bounds that test_sums.py proves for them.
"""

from __future__ import annotations

import re
from typing import Any

import pytest
import z3

from prover import Report
from prover.cnumbers import INT, INT64, UINT
from prover.integers import IntegerDomain
from prover.prove import Input, Refuted, prove
from prover.source import CORE, changed, parse, text_of
from prover.table import constants, table

POC = text_of(CORE / "solve/poc.c")
E_MAX, WEIGHT_MAX, SPLIT_SHIFT, SPLIT_BITS, LINEAR_BITS, X_UNIT, COUNT = constants(
    "solve/poc.c",
    *("BT_E_MAX_Q4", "WEIGHT_MAX", "BT_SUMS_SPLIT_BITS", "SPLIT_BITS", "LINEAR_BITS", "BT_SUMS_X_UNIT_UM"),
    "BT_ELECTRODES",
)
AHEAD, BEHIND, Y, Z, LOW, Y_LOW = constants(
    "solve/sums_gen.h",
    *(f"BT_SUMS_{name}" for name in ("AHEAD_UM", "BEHIND_UNITS", "Y_UM", "Z_UM", "LOW_MAX", "Y_LOW_MAX")),
)
X_MAX = max(abs(x) for x in table().column("um", 0))
Y_MAX = max(abs(y) for y in table().column("um", 1))


def size(x: Any) -> Any:
    return z3.If(x < 0, -x, x)


def tail(text: str, function: str, call: str) -> str:
    """The statements of a function behind the call of a generated sum."""
    body = re.search(rf"static void {function}\(.*?\n}}\n", text, re.S)
    assert body is not None
    after = re.search(rf"    {call}\(.*?;\n(.*)}}\n", body[0], re.S)
    assert after is not None
    return after[1]


# ---- squares: split sums to moments ----------------------------------------------------------------

SPLIT_FIELDS = ("ahead_hi", "ahead_lo", "z_hi", "z_lo", "total")
SPLIT_INPUTS: list[Input] = [*((name, UINT) for name in SPLIT_FIELDS), ("b0", UINT), ("b1", UINT)]
SPLIT_INPUTS += [("y_hi", INT), ("y_lo", INT)]


def split_harness(text: str) -> str:
    parameters = ", ".join(f"uint32_t {name}" for name in (*SPLIT_FIELDS, "b0", "b1"))
    stores = "".join(f"    sums.{name} = {name};\n" for name in (*SPLIT_FIELDS, "y_hi", "y_lo"))
    return f"""{text}
int32_t proof_split({parameters}, int32_t y_hi, int32_t y_lo, int which)
{{
    moments room;
    moments *m = &room;
    bt_split_sums sums;
{stores}    sums.behind[0] = b0;
    sums.behind[1] = b1;
{tail(text, "square_moments", "bt_sums_split")}
    return room.n[which];
}}
"""


def split_box(**v: Any) -> Any:
    reach = {"ahead_hi": (AHEAD >> SPLIT_SHIFT) + 1, "z_hi": (Z >> SPLIT_SHIFT) + 1, "ahead_lo": LOW, "z_lo": LOW}
    ends = [z3.And(v[name] >= 0, v[name] <= WEIGHT_MAX * um) for name, um in reach.items()]
    behind = [v["b0"] >= 0, v["b1"] >= 0, v["b0"] + v["b1"] <= WEIGHT_MAX * BEHIND]
    y = [size(v["y_hi"]) <= WEIGHT_MAX * ((Y >> SPLIT_SHIFT) + 1), size(v["y_lo"]) <= WEIGHT_MAX * Y_LOW]
    return z3.And(*ends, *behind, *y)


def split_moment(text: str, axis: int, off: int) -> None:
    """|2^SPLIT_BITS n - N| <= off * 2^SPLIT_BITS, where N is the whole moment of the split sums."""

    def claim(result: Any, **v: Any) -> Any:
        whole = [
            v["ahead_hi"] * (1 << SPLIT_SHIFT) + v["ahead_lo"] - X_UNIT * (v["b0"] + v["b1"]),
            v["y_hi"] * (1 << SPLIT_SHIFT) + v["y_lo"],
            -(v["z_hi"] * (1 << SPLIT_SHIFT) + v["z_lo"]),
        ][axis]
        return size(result * (1 << SPLIT_BITS) - whole) <= off << SPLIT_BITS

    prove(parse(split_harness(text)), "proof_split", [*SPLIT_INPUTS, axis], split_box, claim, domain=IntegerDomain())


SPLIT_OFF = (3, 2, 2)  # units: each part that is cut loses less than one, x behind is cut twice


@pytest.mark.parametrize("axis", range(3))
def test_moments_of_squares_fit_and_lose_only_what_is_cut(axis: int, proved: Report) -> None:
    split_moment(POC, axis, SPLIT_OFF[axis])
    proved(f"axis {'xyz'[axis]}: no step overflows; within {SPLIT_OFF[axis]} of N / 2^{SPLIT_BITS}")


@pytest.mark.parametrize(
    ("axis", "wrong"),
    [
        (0, ("(half & 31) * QUARTER_X >> 5", "(half & 15) * QUARTER_X >> 5")),
        (0, ("half >> 5) * QUARTER_X + ((half", "half * QUARTER_X >> 5) + ((half")),
        (1, ("(sums.y_hi + sums.y_lo / (1 << BT_SUMS_SPLIT_BITS)) / (1 << LOW_BITS)", "sums.y_hi / (1 << LOW_BITS)")),
        (2, ("(sums.z_lo >> SPLIT_BITS)", "(sums.z_lo >> BT_SUMS_SPLIT_BITS)")),
    ],
)
def test_wrong_moments_of_squares_are_refuted(axis: int, wrong: tuple[str, str]) -> None:
    """A bit less, a product that wraps, a part left out, a wrong shift."""
    with pytest.raises(Refuted):
        split_moment(changed(POC, *wrong), axis, SPLIT_OFF[axis])


# ---- linear weights ----------------------------------------------------------------------------------

LINEAR_INPUTS: list[Input] = [*((name, UINT) for name in ("ahead", "behind", "z", "total")), ("y", INT)]


def linear_harness(text: str) -> str:
    return f"""{text}
int32_t proof_linear(uint32_t ahead, uint32_t behind, uint32_t z, uint32_t total, int32_t y, int which)
{{
    moments room;
    bt_linear_sums sums;
    sums.ahead = ahead;
    sums.behind = behind;
    sums.z = z;
    sums.total = total;
    sums.y = y;
    linear_moments(&sums, &room);
    return room.n[which];
}}
"""


def linear_box(ahead: Any, behind: Any, z: Any, total: Any, y: Any) -> Any:
    """Within the box, and within the hull: a moment is at most the longest coordinate times the weight."""
    box = [ahead <= E_MAX * AHEAD, behind <= E_MAX * BEHIND, z <= E_MAX * Z, size(y) <= E_MAX * Y]
    hull = [ahead <= X_MAX * total, X_UNIT * behind <= X_MAX * total, z <= X_MAX * total, size(y) <= Y_MAX * total]
    return z3.And(*box, *hull, total <= E_MAX * COUNT)


def linear_moment(text: str, axis: int) -> None:
    """Exact, or within one of N / 2^LINEAR_BITS (x: two parts are cut): whichever the total asks for."""
    (whole_total,) = constants("solve/poc.c", "WHOLE_TOTAL")

    def claim(result: Any, ahead: Any, behind: Any, z: Any, total: Any, y: Any) -> Any:
        whole = [ahead - X_UNIT * behind, y, -z][axis]
        cut = size(result * (1 << LINEAR_BITS) - whole) < 1 << LINEAR_BITS
        return z3.If(total <= whole_total, result == whole, cut)

    prove(
        parse(linear_harness(text)), "proof_linear", [*LINEAR_INPUTS, axis], linear_box, claim, domain=IntegerDomain()
    )


@pytest.mark.parametrize("axis", range(3))
def test_moments_of_linear_weights_fit_and_are_exact_or_cut_once(axis: int) -> None:
    linear_moment(POC, axis)


def test_linear_weights_beyond_the_whole_total_are_refuted() -> None:
    with pytest.raises(Refuted):
        linear_moment(changed(POC, "sums->total <= WHOLE_TOTAL", "sums.total <= 2 * WHOLE_TOTAL"), 0)


# ---- x on the cylinder -------------------------------------------------------------------------------

RATIO = """
int32_t proof_ratio(int64_t backward, int32_t n, uint32_t total, int bits)
{
    moments m;
    m.n[0] = n;
    m.bits = bits;
    m.x_backward = (uint32_t)backward;
    m.total = total;
    return ratio_um(&m);
}
"""


def ratio(text: str, bits: int, total_min: int, total_max: int, off: int) -> None:
    """x is -N_x / W, rounded half away from zero, for every N_x and W that n is the cut moment of."""

    def assume(backward: Any, n: Any, total: Any) -> Any:
        near = size(backward + n * (1 << bits)) <= off << bits
        hull = z3.And(backward >= 0, backward <= X_MAX * total)
        return z3.And(total_min <= total, total <= total_max, n <= 0, n > -(2**31), near, hull)

    def claim(result: Any, backward: Any, n: Any, total: Any) -> Any:
        um = -result
        return z3.And(2 * um * total <= 2 * backward + total, 2 * backward + total < 2 * um * total + 2 * total)

    inputs: list[Input] = [("backward", INT64), ("n", INT), ("total", UINT), bits]
    prove(parse(text + RATIO), "proof_ratio", inputs, assume, claim, domain=IntegerDomain())


(WHOLE_TOTAL,) = constants("solve/poc.c", "WHOLE_TOTAL")
# Squares (bits = SPLIT_BITS, totals from 2^21 on) are left out: z3 does not decide that product in minutes.
# tests/fuzz and tests/core/solve/test_kernels.c judge them.
RANGES = {
    "whole": (0, 1, WHOLE_TOTAL, 0),
    "linear": (LINEAR_BITS, WHOLE_TOTAL + 1, E_MAX * COUNT, 1),
}


@pytest.mark.parametrize("line", ["um += 2 * rest >= total;", "um -= 2 * rest < -total;"])
def test_x_without_what_the_remainder_says_is_refuted(line: str) -> None:
    """The quotient alone is not enough, in either direction; one total shows it."""
    bits, total, _, off = RANGES["linear"]
    with pytest.raises(Refuted):
        ratio(changed(POC, line, ""), bits, total, total, off)


@pytest.mark.parametrize("name", ["whole", pytest.param("linear", marks=pytest.mark.nightly)])
def test_x_on_the_cylinder_is_correctly_rounded(name: str, proved: Report) -> None:
    ratio(POC, *RANGES[name])
    proved(f"{name}: x is -N_x / W rounded half away from zero, for all totals of {RANGES[name][1:3]}")
