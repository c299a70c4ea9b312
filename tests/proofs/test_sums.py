"""Every generated sum is the plain sum over Table 1, and no step of it can leave its type.

What is read is firmware/core/fold_gen.c itself, not its generator. That each proof can fail is shown by
changing every number in that file by one.
"""

from __future__ import annotations

import copy
from collections.abc import Callable
from functools import cache

import pytest
from pycparser import c_ast

from prover import sums
from prover.cnumbers import UINT, Undefined, Unsupported
from prover.linear import Form, LinearDomain, Overflow, inputs
from prover.source import CORE, parse, text_of
from prover.table import constants, table

NAMES = [f"v{i}" for i in range(len(table().um))]
WEIGHT_BITS, SPLIT_BITS, ARM_SPLIT_BITS, ARM_PER_UM, HI_MAX, LO_MAX, ARM_HI_MAX, ARM_LO_MAX = constants(
    "fold_gen.h",
    *(f"BT_FOLD_{name}" for name in ("WEIGHT_BITS", "SPLIT_BITS", "ARM_SPLIT_BITS", "ARM_PER_UM")),
    *(f"BT_FOLD_{name}_MAX" for name in ("HI", "LO", "ARM_HI", "ARM_LO")),
)
INT32_MAX = 2**31 - 1
BOXES = {
    "bt_fold_moments": (0, (1 << WEIGHT_BITS) - 1),
    "bt_fold_force": (-table().e_max_q4, table().e_max_q4),
    "bt_fold_torque": (-table().e_max_q4, table().e_max_q4),
}


@cache
def shipped() -> c_ast.FileAST:
    return parse(text_of(CORE / "fold_gen.c"))


def forms(unit: c_ast.FileAST, function: str, larger: int = 1) -> sums.Sums:
    low, high = BOXES[function]
    return sums.forms(unit, function, len(NAMES), low * larger, high * larger)


def joined(hi: Form, lo: Form, bits: int) -> list[int]:
    return (hi * (1 << bits) + lo).coefficients(NAMES)


def check_moments(unit: c_ast.FileAST) -> None:
    found = forms(unit, "bt_fold_moments")
    for d in range(3):
        assert joined(found.hi[d], found.lo[d], SPLIT_BITS) == table().column("um", d)


def check_force(unit: c_ast.FileAST) -> None:
    found = forms(unit, "bt_fold_force")
    for d in range(3):
        assert found.hi[d].coefficients(NAMES) == table().column("milli", d)


def check_torque(unit: c_ast.FileAST) -> None:
    found = forms(unit, "bt_fold_torque")
    assert joined(found.hi[0], found.lo[0], ARM_SPLIT_BITS) == [0] * len(NAMES)
    assert (found.hi[0], found.lo[0]) == (Form({}), Form({}))
    for d in (1, 2):
        for arm, coefficient in zip(
            table().column("arm_nm", d), joined(found.hi[d], found.lo[d], ARM_SPLIT_BITS), strict=True
        ):
            # The nearest whole multiple of 1/16 um to an arm in nm; a tie would leave two.
            assert abs(1000 * coefficient - ARM_PER_UM * arm) < 500


IDENTITIES: dict[str, Callable[[c_ast.FileAST], None]] = {
    "bt_fold_moments": check_moments,
    "bt_fold_force": check_force,
    "bt_fold_torque": check_torque,
}


@pytest.mark.parametrize("function", IDENTITIES)
def test_the_folded_sum_is_the_sum_over_table_1(function: str) -> None:
    IDENTITIES[function](shipped())


def test_the_tables_in_c_are_table_1() -> None:
    count = len(NAMES)
    for name, rows in (
        ("bt_electrode_um", table().um),
        ("bt_normal_milli", table().milli),
        ("bt_arm_nm", table().arm_nm),
    ):
        places = [f"{name}[{i}][{d}]" for i in range(count) for d in range(3)]
        assert constants("sensor_gen.c", *places) == [value for row in rows for value in row]


def test_no_step_of_a_sum_leaves_int32_and_the_asserted_bounds_hold() -> None:
    """`forms` raises where any signed result, in the order in which the C adds, can leave its type."""
    for function, hi_max, lo_max in (
        ("bt_fold_moments", HI_MAX, LO_MAX),
        ("bt_fold_torque", ARM_HI_MAX, ARM_LO_MAX),
    ):
        found = forms(shipped(), function)
        hi, lo = max(f.size for f in found.hi), max(f.size for f in found.lo)
        print(f"{function}: |hi| <= {hi} of {hi_max}, |lo| <= {lo} of {lo_max}, {found.steps} steps <= {found.peak}")
        assert hi <= hi_max <= INT32_MAX and lo <= lo_max <= INT32_MAX
        assert max(hi, lo) <= found.peak <= INT32_MAX
    force = forms(shipped(), "bt_fold_force")
    (asserted,) = constants("sensor_gen.h", "BT_SUM_NORMAL_MAX_Q4_MILLI")
    largest = max(f.size for f in force.hi)
    print(f"bt_fold_force: |sum| <= {largest}, asserted {asserted}, {force.steps} steps <= {force.peak}")
    # The assertion is an L1 norm and so is this: the corner of the box reaches it.
    assert largest == asserted <= force.peak <= INT32_MAX


def test_a_bound_is_reached_by_the_corner_it_names() -> None:
    for form in forms(shipped(), "bt_fold_force").hi:
        largest, corner = form.extreme(1)
        hi, _ = sums.evaluate(shipped(), "bt_fold_force", [corner.get(name, 0) for name in NAMES])
        assert largest in hi


@pytest.mark.parametrize("function", ["bt_fold_force", "bt_fold_torque"])
def test_larger_signals_are_refuted_by_a_corner_that_overflows(function: str) -> None:
    """The proof sees where the room ends: one multiple of the box fits, the next one does not."""
    enough = INT32_MAX // forms(shipped(), function).peak
    forms(shipped(), function, larger=enough)
    with pytest.raises(Overflow) as refused:
        forms(shipped(), function, larger=enough + 1)
    corner = [refused.value.witness.get(name, 0) for name in NAMES]
    with pytest.raises(Undefined):
        sums.evaluate(shipped(), function, corner)


def test_weights_of_more_bits_are_refuted() -> None:
    low, high = BOXES["bt_fold_moments"]
    peak = forms(shipped(), "bt_fold_moments").hi[0].size
    factor = 1
    while peak * factor <= INT32_MAX:  # hi doubles with every bit of a weight, lo does not
        factor *= 2
    with pytest.raises(Overflow):
        sums.forms(shipped(), "bt_fold_moments", len(NAMES), low, (high + 1) * factor - 1)


class Numbers(c_ast.NodeVisitor):  # type: ignore[misc]
    """The constants in the bodies of fold_gen.c's own functions; fix.h's are proved in test_fix.py."""

    def __init__(self, unit: c_ast.FileAST) -> None:
        self.found: list[c_ast.Constant] = []
        for node in unit.ext:
            if isinstance(node, c_ast.FuncDef) and "inline" not in node.decl.funcspec:
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
    node = next(n for n in Numbers(unit).found if int(n.value) in {abs(v) for v in table().column("milli", 1)} - {0})
    node.value = str(int(node.value) + 1)
    differences = []
    for i in range(len(NAMES)):
        one = [int(k == i) for k in range(len(NAMES))]
        hi, _ = sums.evaluate(unit, "bt_fold_force", one)
        if hi != list(table().milli[i]):
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
