"""What the core rests on beyond its own lines: the point of contact always has a direction, and sums that
follow one electrode at a time are the sums over all of them."""

from __future__ import annotations

from typing import Any

import pytest
import z3

from prover.prove import Refuted, Undecided, ask
from prover.table import constants, table

COUNT = len(table().um)
E_MAX = table().e_max_q4


def contradict(claim: str, inputs: dict[str, Any], *conditions: Any) -> None:
    ask(claim, conditions, inputs, dict.fromkeys(inputs, True))


# ---- the hull: no point of contact on the axis ---------------------------------------------------


def hull(z_max_um: int) -> None:
    """Weights >= 0 with W > 0 imply N_z <= z_max W: the centroid cannot lie above the highest electrode."""
    weights = {f"w{i}": z3.Int(f"w{i}") for i in range(COUNT)}
    total = z3.Sum(*weights.values())
    moment = z3.Sum(*(w * z for w, z in zip(weights.values(), table().column("um", 2), strict=True)))
    contradict(
        f"N_z <= {z_max_um} W", weights, *(w >= 0 for w in weights.values()), total > 0, moment > z_max_um * total
    )


def test_every_weighted_centroid_lies_below_the_axis() -> None:
    (z_max,) = constants("wire/sensor_gen.h", "BT_ELECTRODE_Z_MAX_UM")
    assert z_max < 0
    hull(z_max)


def test_a_stronger_hull_is_refuted_by_weights() -> None:
    (z_max,) = constants("wire/sensor_gen.h", "BT_ELECTRODE_Z_MAX_UM")
    with pytest.raises(Refuted) as refused:
        hull(z_max - 1)
    weights = [refused.value.witness[f"w{i}"] for i in range(COUNT)]
    moment = sum(w * z for w, z in zip(weights, table().column("um", 2), strict=True))
    assert min(weights) >= 0 and sum(weights) > 0 and moment > (z_max - 1) * sum(weights)


def test_a_question_that_z3_has_no_time_for_is_no_proof(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("prover.prove.LIMIT", 1)
    with pytest.raises(Undecided, match="within 1 units of work"):
        test_every_weighted_centroid_lies_below_the_axis()


# ---- incremental == batch ------------------------------------------------------------------------


def l1(values: list[int]) -> int:
    return sum(abs(v) for v in values)


def incremental(coefficient: int, others_l1: int, weight_bits: int, sum_bits: int) -> None:
    """One weight of a sum replaced: adding its change gives the new sum, and no step leaves sum_bits.

    ``rest`` stands for what the other electrodes add, anywhere within their L1 norm.
    """
    names = {name: z3.Int(name) for name in ("old", "new", "rest")}
    old, new, rest = names.values()
    limit = (1 << weight_bits) - 1
    reach = others_l1 * limit
    box = [old >= 0, old <= limit, new >= 0, new <= limit, rest >= -reach, rest <= reach]
    before, change = rest + old * coefficient, (new - old) * coefficient
    steps = [new - old, old * coefficient, before, change, before + change]
    ends = 1 << (sum_bits - 1)
    fits = [z3.And(-ends <= step, step < ends) for step in steps]
    wrong = z3.Not(z3.And(*fits, before + change == rest + new * coefficient))
    contradict(f"incremental sum with {coefficient}", names, *box, wrong)


WEIGHT_BITS = (E_MAX * E_MAX).bit_length()  # squares of signals in 1/16 count


@pytest.mark.parametrize("axis", range(4))
def test_replacing_one_weight_is_the_batch_sum_in_int64(axis: int) -> None:
    """x, y and z moments and the weight sum itself."""
    column = table().column("um", axis) if axis < 3 else [1] * COUNT
    for coefficient in column:
        incremental(coefficient, l1(column) - abs(coefficient), WEIGHT_BITS, 64)


def test_how_short_the_sum_may_be_is_what_the_l1_norm_says() -> None:
    """One bit less than the L1 norm needs is refuted, by weights that reach it."""
    column = table().column("um", 0)
    needed = (l1(column) * ((1 << WEIGHT_BITS) - 1)).bit_length() + 1
    incremental(min(column), l1(column) + min(column), WEIGHT_BITS, needed)
    with pytest.raises(Refuted) as refused:
        incremental(min(column), l1(column) + min(column), WEIGHT_BITS, needed - 1)
    at = refused.value.witness
    assert max(abs(at["rest"] + at[name] * min(column)) for name in ("old", "new")) >= 1 << (needed - 2)


def delta_of_squares(bits: int) -> None:
    """e'^2 - e^2 == (e' - e)(e' + e), without overflow: the change of a weight from one product."""
    names = {"old": z3.BitVec("old", bits), "new": z3.BitVec("new", bits)}
    old, new = names.values()
    box = [old >= -E_MAX, old <= E_MAX, new >= -E_MAX, new <= E_MAX]
    contradict("difference of squares", names, (new - old) * (new + old) != new * new - old * old)
    less, more = new - old, new + old
    fits = z3.And(z3.BVMulNoOverflow(less, more, True), z3.BVMulNoUnderflow(less, more))
    contradict("difference of squares overflows", names, *box, z3.Not(fits))


def test_the_change_of_a_square_fits_34_bits_but_not_32() -> None:
    """|e' - e| |e' + e| <= E_MAX^2 just below 2^32: int32 is too short by one bit, and z3 finds where."""
    assert (E_MAX * E_MAX).bit_length() == 32
    delta_of_squares(34)
    with pytest.raises(Refuted) as refused:
        delta_of_squares(32)
    old, new = refused.value.witness["old"], refused.value.witness["new"]
    assert max(abs(old), abs(new)) <= E_MAX and abs(new * new - old * old) >= 2**31
