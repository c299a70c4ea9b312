"""C for the benchmark's own kernels: the symmetry-folded sums in float32 and int64, and Q15 tables.

The folding itself is c_fold's. Here a processor has a multiplier that is wide enough (SMLAL) or an FPU,
so that nothing is split in two.
"""

from __future__ import annotations

from dataclasses import dataclass

from .c_fold import Folding, join
from .c_sensor import arm_nm, row
from .schema import GENERATED, Contract

Q15_ONE = 1 << 15
WEIGHT_BITS = 27  # six of them, as many as one product takes, then sum within int32


@dataclass(frozen=True)
class Kind:
    """A number type to fold in. ``narrow`` holds a group of terms, ``wide`` a sum of products."""

    name: str
    narrow: str
    wide: str
    force: str
    weight: str
    total: str
    literal: str  # format of a coefficient


F32 = Kind("f32", "float", "float", "float", "float", "float", "{}.0F")
I64 = Kind("i64", "int32_t", "int64_t", "int32_t", "int32_t", "uint32_t", "{}")


def products(kind: Kind, groups: dict[int, list[str]], wide: str) -> str:
    """A sum of products, one a line. In int64 the coefficients carry the sign: SMLAL only adds."""
    cast = "" if wide == kind.narrow else f"({wide})"
    out = ""
    for coefficient, parts in groups.items():
        inner = parts[0] if len(parts) == 1 and parts[0].startswith(("(", "v")) else f"({join(parts)})"
        subtract = coefficient < 0 and kind is F32
        text = f"{cast}{inner} * {kind.literal.format(abs(coefficient) if subtract else coefficient)}"
        first = ("-" if subtract else "") if not out else f"\n             {'-' if subtract else '+'} "
        out += first + text
    return out


def folded(contract: Contract, kind: Kind) -> str:
    """A header with the sums of one number type, inline: these cores have the registers."""
    folding = Folding(contract)
    n = len(folding.table)
    r = [line[1] for line in folding.table]
    normal = [line[2] for line in folding.table]
    arms = [arm_nm(a, b) for _, a, b in folding.table]
    guard = f"BIOTAC_FOLD_{kind.name.upper()}_GEN_H"
    pairs = [f"(v[{a}] + v[{b}])" for a, b in folding.pairs] + [f"v[{i}]" for i in folding.singles]
    total = " + ".join(pairs) if kind is F32 else " + ".join(f"(uint32_t){p}" for p in pairs)
    lines = [
        f"// {GENERATED}",
        f"// Sums over the electrodes with the left/right symmetry folded, in {kind.wide}.",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        "#include <stdint.h>",
        "",
    ]
    if kind is I64:
        moment_max = max(sum(abs(p[d]) for p in r) for d in range(3)) << WEIGHT_BITS
        lines += [
            f"#define FOLD_I64_WEIGHT_BITS {WEIGHT_BITS} // a weight is below 2^this",
            f"#define FOLD_I64_MOMENT_MAX {moment_max}LL",
            "",
        ]
    lines += [
        "// sum w r in um; returns sum w.",
        f"static inline {kind.total} fold_{kind.name}_moments(const {kind.weight} v[{n}], {kind.wide} sum[3])",
        "{",
    ]
    for d in range(3):
        groups = folding.groups(lambda i, d=d: r[i][d], odd=d == 1)
        lines.append(f"    sum[{d}] = {products(kind, groups, kind.wide)};")
    lines += [
        f"    return {total};",
        "}",
        "",
        "// sum e n in e * 1/1000.",
        f"static inline void fold_{kind.name}_force(const {kind.narrow} v[{n}], {kind.force} sum[3])",
        "{",
    ]
    for d in range(3):
        groups = folding.groups(lambda i, d=d: normal[i][d], odd=d == 1)
        lines.append(f"    sum[{d}] = {products(kind, groups, kind.force)};")
    lines += [
        "}",
        "",
        "// sum e (r x n) for y and z in e * nm.",
        f"static inline void fold_{kind.name}_torque(const {kind.narrow} v[{n}], {kind.wide} sum[2])",
        "{",
    ]
    for k, (d, odd) in enumerate(((1, False), (2, True))):
        groups = folding.groups(lambda i, d=d: arms[i][d], odd=odd)
        lines.append(f"    sum[{k}] = {products(kind, groups, kind.wide)};")
    return "\n".join([*lines, "}", "", "#endif", ""])


def q15(value: int, full: int) -> int:
    """value / full in Q15, rounded half away from zero and saturated, as a textbook has it."""
    size = min((2 * abs(value) * Q15_ONE + full) // (2 * full), Q15_ONE - 1)
    return size if value >= 0 else -size


def q15_header(contract: Contract) -> str:
    """Table 1 in Q15 of the largest coordinate, of 1, and of the largest arm."""
    table = Folding(contract).table
    arms = [arm_nm(r, n)[1:] for _, r, n in table]
    place = max(abs(v) for _, r, _ in table for v in r)
    arm = max(abs(v) for a in arms for v in a)
    lines = [
        f"// {GENERATED}",
        "// Table 1 in Q15.",
        "#ifndef BIOTAC_Q15_GEN_H",
        "#define BIOTAC_Q15_GEN_H",
        "",
        "#include <stdint.h>",
        "",
        f"#define Q15_PLACE_UM {place} // what 1.0 is",
        f"#define Q15_ARM_NM {arm}",
        "",
    ]
    for name, axes, full, values in (
        ("place", 3, place, [r for _, r, _ in table]),
        ("normal", 3, 1000, [n for _, _, n in table]),
        ("arm", 2, arm, arms),
    ):
        lines.append(f"static const int16_t q15_{name}[{len(table)}][{axes}] = {{")
        for line, vector in zip(table, values, strict=True):
            lines.append(f"    {row(tuple(q15(v, full) for v in vector))}, // {line[0]}")
        lines += ["};", ""]
    return "\n".join([*lines, "#endif", ""])
