"""Every generated sum is the plain sum over Table 1, and no step of it can leave its type.

What is read is firmware/core/solve/sums_gen.c itself, not its generator. That each proof can fail is shown by
changing every number in that file by one.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from fractions import Fraction
from functools import cache

import pytest
from pycparser import c_ast

from prover import Report, sums
from prover.cnumbers import UINT, Undefined, Unsupported
from prover.linear import Form, LinearDomain, Overflow, inputs
from prover.source import CORE, parse, text_of
from prover.table import constants, table

COUNT = len(table().um)
E_MAX = table().e_max_q4
SIGNALS = [f"v{i}" for i in range(COUNT)]
COMPRESSED = [f"min(+1*v{i},0)" for i in range(COUNT)]
WEIGHT_BITS, SPLIT_BITS, X_UNIT_UM, TORQUE_UNIT_NM, ARM_BITS = constants(
    "solve/sums_gen.h",
    *(f"BT_SUMS_{name}" for name in ("WEIGHT_BITS", "SPLIT_BITS", "X_UNIT_UM", "TORQUE_UNIT_NM", "ARM_BITS")),
)
AHEAD_UM, BEHIND_UNITS, Y_UM, Z_UM, LOW_MAX, Y_LOW_MAX = constants(
    "solve/sums_gen.h",
    *(f"BT_SUMS_{name}" for name in ("AHEAD_UM", "BEHIND_UNITS", "Y_UM", "Z_UM", "LOW_MAX", "Y_LOW_MAX")),
)
INT32_MAX, UINT32_MAX = 2**31 - 1, 2**32 - 1
WEIGHT_MAX = (1 << WEIGHT_BITS) - 1
# Squares of signals are shifted so that the largest has WEIGHT_BITS: (up, down) for each length it may have.
SHIFTS = [(max(WEIGHT_BITS - bits, 0), max(bits - WEIGHT_BITS, 0)) for bits in range(1, 33)]


@cache
def shipped() -> c_ast.FileAST:
    return parse(text_of(CORE / "solve/sums_gen.c"))


def linear(unit: c_ast.FileAST, larger: int = 1) -> sums.Sums:
    return sums.forms(unit, "bt_sums_linear", COUNT, -E_MAX * larger, E_MAX * larger)


def split(unit: c_ast.FileAST, up: int = 0, down: int = 0, bits: int = WEIGHT_BITS) -> sums.Sums:
    """Weights of as many bits as leave ``bits`` once they are shifted."""
    return sums.forms(unit, "bt_sums_split", COUNT, 0, (1 << (bits - up + down)) - 1, up, down)


def force(unit: c_ast.FileAST, larger: int = 1) -> sums.Sums:
    return sums.forms(unit, "bt_sums_force", COUNT, -E_MAX * larger, E_MAX * larger)


def torque(unit: c_ast.FileAST, larger: int = 1) -> sums.Sums:
    return sums.forms(unit, "bt_sums_torque", COUNT, -E_MAX * larger, E_MAX * larger)


def negated(values: list[int]) -> list[int]:
    return [-v for v in values]


def check_linear(unit: c_ast.FileAST) -> None:
    """Weights are -min(e, 0); x = ahead - unit * behind, z counts downwards."""
    found = linear(unit)
    x = found["ahead"] - found["behind"] * X_UNIT_UM
    assert x.coefficients(COMPRESSED) == negated(table().column("um", 0))
    assert found["y"].coefficients(COMPRESSED) == negated(table().column("um", 1))
    assert found["z"].coefficients(COMPRESSED) == table().column("um", 2)
    assert found["total"].coefficients(COMPRESSED) == [-1] * COUNT


def check_split(unit: c_ast.FileAST, shifts: list[tuple[int, int]] | None = None) -> None:
    """For every shift: the weights are what is left of them, and the two parts make the sum."""
    for up, down in shifts or [(0, 0), (1, 0), (0, 1)]:
        found = split(unit, up, down)
        names = [f"high{down}(+1*v{i})" for i in range(COUNT)] if down else SIGNALS

        def whole(name: str, found: sums.Sums = found) -> Form:
            return found[f"{name}_hi"] * (1 << SPLIT_BITS) + found[f"{name}_lo"]

        x = whole("ahead") - (found["behind[0]"] + found["behind[1]"]) * X_UNIT_UM
        for form, want in (
            (x, table().column("um", 0)),
            (whole("y"), table().column("um", 1)),
            (whole("z"), negated(table().column("um", 2))),
            (found["total"], [1] * COUNT),
        ):
            assert form.coefficients(names) == [value << up for value in want]


def check_force(unit: c_ast.FileAST) -> None:
    found = force(unit)
    for d in range(3):
        assert found[f"[{d}]"].coefficients(SIGNALS) == table().column("milli", d)


def check_torque(unit: c_ast.FileAST) -> None:
    """Exact behind the seam, rounded to 1/2^ARM_BITS of the unit ahead of it; less than two units are cut."""
    found = torque(unit)
    for d in (1, 2):
        parts = [c * (1 << ARM_BITS) for c in found[f"[{d - 1}]"].coefficients(SIGNALS, cut=2)]
        for (x, _, _), arm, part in zip(table().um, table().column("arm_nm", d), parts, strict=True):
            off_nm = abs(Fraction(part * TORQUE_UNIT_NM, 1 << ARM_BITS) - arm)
            assert off_nm == 0 if x <= 0 else 2 * off_nm <= Fraction(TORQUE_UNIT_NM, 1 << ARM_BITS)


IDENTITIES: dict[str, Callable[[c_ast.FileAST], None]] = {
    "bt_sums_linear": check_linear,
    "bt_sums_split": check_split,
    "bt_sums_force": check_force,
    "bt_sums_torque": check_torque,
}


@pytest.mark.parametrize("function", IDENTITIES)
def test_the_mirrored_sum_is_the_sum_over_table_1(function: str) -> None:
    IDENTITIES[function](shipped())


def test_the_split_sum_is_right_for_every_shift() -> None:
    check_split(shipped(), SHIFTS)


def test_the_tables_in_c_are_table_1() -> None:
    for name, rows in (
        ("bt_electrode_um", table().um),
        ("bt_normal_milli", table().milli),
        ("bt_arm_nm", table().arm_nm),
    ):
        places = [f"{name}[{i}][{d}]" for i in range(COUNT) for d in range(3)]
        assert constants("wire/sensor_gen.c", *places) == [value for row in rows for value in row]


def check_bounds(found: sums.Sums, asserted: dict[str, int], proved: Report) -> None:
    """Exact extremes against what the core asserts at compile time, and that against the type."""
    for name, bound in asserted.items():
        # `forms` has already refused every result and every signed step that can leave its type.
        assert found[name].size <= bound <= (UINT32_MAX if found[name].low >= 0 else INT32_MAX)
    largest = ", ".join(f"{name} {found[name].size:,} of {bound:,}" for name, bound in asserted.items())
    proved(f"{largest}; {found.steps} steps, the largest signed one {found.peak:,}")


def test_linear_sums_stay_within_what_is_asserted(proved: Report) -> None:
    asserted = {"ahead": AHEAD_UM, "behind": BEHIND_UNITS, "y": Y_UM, "z": Z_UM, "total": COUNT}
    check_bounds(linear(shipped()), {name: E_MAX * um for name, um in asserted.items()}, proved)


def test_split_sums_stay_within_what_is_asserted(proved: Report) -> None:
    """With weights of WEIGHT_BITS, which is the largest box of all the shifts."""
    high = {"ahead_hi": AHEAD_UM, "y_hi": Y_UM, "z_hi": Z_UM}
    asserted = {name: WEIGHT_MAX * ((um >> SPLIT_BITS) + 1) for name, um in high.items()}
    asserted |= {"ahead_lo": WEIGHT_MAX * LOW_MAX, "z_lo": WEIGHT_MAX * LOW_MAX, "y_lo": WEIGHT_MAX * Y_LOW_MAX}
    found = split(shipped())
    check_bounds(found, asserted, proved)
    behind = found["behind[0]"] + found["behind[1]"]
    assert behind.size <= WEIGHT_MAX * BEHIND_UNITS
    for up, down in SHIFTS:
        others = split(shipped(), up, down)
        assert all(others[name].size <= found[name].size for name in others.out)


def test_force_sums_reach_exactly_what_is_asserted(proved: Report) -> None:
    (asserted,) = constants("wire/sensor_gen.h", "BT_SUM_NORMAL_MAX_Q4_MILLI")
    found = force(shipped())
    check_bounds(found, {f"[{d}]": asserted for d in range(3)}, proved)
    assert max(form.size for form in found.out.values()) == asserted


def test_torque_sums_stay_within_what_is_asserted(proved: Report) -> None:
    (asserted,) = constants(
        "solve/wrench.c", "BT_SUM_ARM_MAX_Q4_NM / BT_SUMS_TORQUE_UNIT_NM + 2 + BT_ELECTRODES * (int64_t)BT_E_MAX_Q4"
    )
    found = torque(shipped())
    check_bounds(found, {"[0]": asserted, "[1]": asserted}, proved)


def test_a_bound_is_reached_by_the_corner_it_names() -> None:
    for name, form in force(shipped()).out.items():
        largest, corner = form.extreme(1)
        values = [corner.get(signal, 0) for signal in SIGNALS]
        assert sums.evaluate(shipped(), "bt_sums_force", values)[name] == largest


def test_larger_signals_are_refuted_by_a_corner_that_overflows() -> None:
    """The proof sees where the room of a force ends: one multiple of the box fits, the next one does not."""
    enough = INT32_MAX // force(shipped()).peak
    force(shipped(), enough)
    with pytest.raises(Overflow) as refused:
        force(shipped(), enough + 1)
    corner = [refused.value.witness.get(name, 0) for name in SIGNALS]
    with pytest.raises(Undefined):
        sums.evaluate(shipped(), "bt_sums_force", corner)


@pytest.mark.parametrize("run", [linear, torque, lambda unit, _: split(unit, bits=WEIGHT_BITS + 1)])
def test_twice_the_input_is_refuted(run: Callable[[c_ast.FileAST, int], sums.Sums]) -> None:
    """Neither signals nor weights may have one bit more: these sums use all of their 32."""
    with pytest.raises(Overflow):
        run(shipped(), 2)


class Numbers(c_ast.NodeVisitor):  # type: ignore[misc]
    """The constants in the bodies of sums_gen.c's own functions; fix.h's are proved in test_fix.py."""

    def __init__(self, unit: c_ast.FileAST, prefix: str = "bt_sums_") -> None:
        self.found: list[c_ast.Constant] = []
        for node in unit.ext:
            if isinstance(node, c_ast.FuncDef) and node.decl.name.startswith(prefix):
                self.visit(node.body)

    def visit_Constant(self, node: c_ast.Constant) -> None:
        self.found.append(node)


def test_every_number_of_the_file_matters() -> None:
    unit = copy.deepcopy(shipped())
    numbers = Numbers(unit).found
    unnoticed = []
    for node in numbers:
        before, node.value = node.value, str(int(node.value) + 1)
        try:
            for check in IDENTITIES.values():
                check(unit)
            unnoticed.append(f"{before} -> {node.value} at {node.coord}")
        except (AssertionError, ValueError, Overflow, Undefined, Unsupported):
            pass
        node.value = before
    assert len(numbers) > 100
    assert unnoticed == []


def test_a_wrong_coefficient_shows_in_a_frame_with_one_electrode() -> None:
    unit = copy.deepcopy(shipped())
    node = next(n for n in Numbers(unit, "bt_sums_force").found if int(n.value) in table().column("milli", 1))
    node.value = str(int(node.value) + 1)
    differences = []
    for i in range(COUNT):
        one = [int(k == i) for k in range(COUNT)]
        if list(sums.evaluate(unit, "bt_sums_force", one).values()) != list(table().milli[i]):
            differences.append(i)
    assert differences


def test_what_is_split_comes_together_only_if_all_of_it_is_there() -> None:
    """The expansion of low parts itself: hi and lo of different forms must not cancel."""
    a, b = inputs(2, 0, 100)
    domain = LinearDomain()
    high, low = (domain.split(op, UINT, a + b, n) for op, n in ((">>", 3), ("&", 7)))
    assert (high * 8 + low).coefficients(["v0", "v1"]) == [1, 1]
    with pytest.raises(ValueError, match="not a sum over the inputs"):
        (high * 8 + domain.split("&", UINT, a, 7)).coefficients(["v0", "v1"])
