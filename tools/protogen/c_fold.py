"""Straight-line C for the electrode sums, with the finger's left/right symmetry folded.

Seven pairs of electrodes mirror each other in y: they share x, z, n_x and n_z, and differ in the sign
of y and n_y. Adding (or subtracting) a pair first leaves 22 products of 57 for the PoC, 9 for the
force and 19 for the torque. Which electrodes pair is found in Table 1, not written down here.
"""

from __future__ import annotations

from .c_sensor import E_MAX_Q4, arm_nm
from .pairs import Folding, join
from .schema import GENERATED, Contract

SPLIT_BITS = 14  # of a weight sum: its low part times a coordinate then sums within 31 bits
WEIGHT_BITS = 24  # of one normalised weight
SPLIT_ARM_BITS = 8  # of an arm: its parts times a pair of signals then sum within 31 bits
ARM_PER_UM = 16  # arms in 1/16 um: their rounding then is below 1 N*um RMS at full scale


def axis_function(name: str, kind: str, products: list[tuple[int, int, str]], mask_bits: int | None) -> list[str]:
    """One axis of a split sum, as a function of its own.

    Not inlined: three axes in one body make a core with eight registers spill more than the calls
    cost. ``products`` are (coefficient of hi, coefficient of lo, terms); with ``mask_bits`` the terms
    are split at run time, without, the coefficients already are.
    """
    out = [f"static BT_NOINLINE void {name}(const {kind} *v, int32_t *hi_out, int32_t *lo_out)", "{"]
    out += ["    int32_t hi = 0;", "    int32_t lo = 0;"]
    for of_hi, of_lo, terms in products:
        out.append("    {")
        out.append(f"        int32_t g = (int32_t)({terms});")
        if mask_bits is None:
            out.append(f"        hi += {of_hi} * g;")
            out.append(f"        lo += {of_lo} * g;")
        else:
            out.append(f"        hi += {of_hi} * bt_shift_down(g, {mask_bits});")
            out.append(f"        lo += {of_lo} * (g & {(1 << mask_bits) - 1});")
        out.append("    }")
    return [*out, "    *hi_out = hi;", "    *lo_out = lo;", "}", ""]


def by_value(groups: dict[int, list[str]]) -> list[tuple[int, int, str]]:
    return [(c, c, join(terms)) for c, terms in groups.items()]


def by_coefficient(groups: dict[int, list[str]]) -> list[tuple[int, int, str]]:
    """Split each coefficient instead of what it multiplies: hi towards minus infinity, lo 0..255."""
    return [(c >> SPLIT_ARM_BITS, c & ((1 << SPLIT_ARM_BITS) - 1), join(terms)) for c, terms in groups.items()]


def coefficient_sum(groups: dict[int, list[str]]) -> int:
    return sum(abs(c) for c in groups)


def header(contract: Contract) -> str:
    folding = Folding(contract)
    coordinate = max(abs(v) for _, r, _ in folding.table for v in r)
    terms = len(folding.pairs) + len(folding.singles)
    arms = [arm_16um(r, n) for _, r, n in folding.table]
    arm_l1 = max(sum(abs(a[d]) for a in arms) for d in (1, 2))
    hi_max = ((len(folding.table) << WEIGHT_BITS >> SPLIT_BITS) + 2 * terms) * coordinate
    axes = [folding.groups(lambda i, d=d: folding.table[i][1][d], odd=d == 1) for d in range(3)]
    lo_max = max(map(coefficient_sum, axes)) * ((1 << SPLIT_BITS) - 1)
    arm_hi_max = ((arm_l1 >> SPLIT_ARM_BITS) + len(arms)) * E_MAX_Q4
    arm_lo_max = ((1 << SPLIT_ARM_BITS) - 1) * len(arms) * E_MAX_Q4
    lines = [
        f"// {GENERATED}",
        "// Sums over the electrodes with the left/right symmetry folded. Each large sum comes in two",
        "// 32-bit parts, value = hi << bits + lo, so that no product needs more than 32 bits.",
        "#ifndef BIOTAC_FOLD_GEN_H",
        "#define BIOTAC_FOLD_GEN_H",
        "",
        "#include <stdint.h>",
        "",
        f"#define BT_FOLD_WEIGHT_BITS {WEIGHT_BITS} // a normalised weight is below 2^this",
        f"#define BT_FOLD_SPLIT_BITS {SPLIT_BITS}",
        f"#define BT_FOLD_ARM_SPLIT_BITS {SPLIT_ARM_BITS}",
        f"#define BT_FOLD_ARM_PER_UM {ARM_PER_UM}",
        "",
        "// Bounds over every input; the core asserts that they fit.",
        f"#define BT_FOLD_HI_MAX {hi_max}LL",
        f"#define BT_FOLD_LO_MAX {lo_max}LL",
        f"#define BT_FOLD_ARM_HI_MAX {arm_hi_max}LL",
        f"#define BT_FOLD_ARM_LO_MAX {arm_lo_max}LL",
        "",
        "typedef struct {",
        "    int32_t hi[3];",
        "    int32_t lo[3];",
        "} bt_split_sums;",
        "",
        "// sum w r in um. Every weight is below 2^BT_FOLD_WEIGHT_BITS.",
        f"void bt_fold_moments(const uint32_t v[{len(folding.table)}], bt_split_sums *sums);",
        "",
        "// sum e n in e * 1/1000; fits int32 for every |e| <= 4095 counts in 1/16 count.",
        f"void bt_fold_force(const int32_t v[{len(folding.table)}], int32_t sum[3]);",
        "",
        "// sum e (r x n) for y and z in e * 1/16 um; hi and lo at [1] and [2], [0] is 0.",
        f"void bt_fold_torque(const int32_t v[{len(folding.table)}], bt_split_sums *sums);",
        "",
        "#endif",
        "",
    ]
    return "\n".join(lines)


def arm_16um(r: tuple[int, ...], n: tuple[int, ...]) -> tuple[int, ...]:
    """Arms in 1/16 um, rounded half away from zero."""
    return tuple((1 if v >= 0 else -1) * ((abs(v) * ARM_PER_UM + 500) // 1000) for v in arm_nm(r, n))


def source(contract: Contract) -> str:
    folding = Folding(contract)
    n = len(folding.table)
    r = [row[1] for row in folding.table]
    normal = [row[2] for row in folding.table]
    arms = [arm_16um(row[1], row[2]) for row in folding.table]
    out = [f"// {GENERATED}", '#include "fold_gen.h"', "", '#include "fix.h"', ""]
    for d, name in enumerate("xyz"):
        groups = folding.groups(lambda i, d=d: r[i][d], odd=d == 1)
        out += axis_function(f"moment_{name}", "uint32_t", by_value(groups), SPLIT_BITS)
    out += [
        f"void bt_fold_moments(const uint32_t v[{n}], bt_split_sums *sums)",
        "{",
        "    moment_x(v, &sums->hi[0], &sums->lo[0]);",
        "    moment_y(v, &sums->hi[1], &sums->lo[1]);",
        "    moment_z(v, &sums->hi[2], &sums->lo[2]);",
        "}",
        "",
        f"void bt_fold_force(const int32_t v[{n}], int32_t sum[3])",
        "{",
    ]
    for d, odd in ((0, False), (1, True), (2, False)):
        groups = folding.groups(lambda i, d=d: normal[i][d], odd=odd)
        products = [f"{c} * ({join(t)})" for c, t in groups.items()]
        out.append(f"    sum[{d}] = {join(products)};")
    out += ["}", ""]
    for d, name, odd in ((1, "y", False), (2, "z", True)):
        groups = folding.groups(lambda i, d=d: arms[i][d], odd=odd)
        out += axis_function(f"torque_{name}", "int32_t", by_coefficient(groups), None)
    out += [
        f"void bt_fold_torque(const int32_t v[{n}], bt_split_sums *sums)",
        "{",
        "    sums->hi[0] = 0;",
        "    sums->lo[0] = 0;",
        "    torque_y(v, &sums->hi[1], &sums->lo[1]);",
        "    torque_z(v, &sums->hi[2], &sums->lo[2]);",
        "}",
        "",
    ]
    return "\n".join(out)
