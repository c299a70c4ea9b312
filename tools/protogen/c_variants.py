"""C for the benchmark's own kernels: sums over mirrored electrode pairs in float32 and int64, and tables.

Here a processor has a multiplier that is wide enough (SMLAL) or an FPU,
so that nothing is split in two.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .c_sensor import arm_nm
from .pairs import Mirror, join
from .schema import GENERATED, Contract

Q15_ONE = 1 << 15


@dataclass(frozen=True)
class Kind:
    """A number type to sum in. ``narrow`` holds a group of terms, ``wide`` a sum of products."""

    name: str
    narrow: str
    wide: str
    force: str
    literal: str  # format of a coefficient


F32 = Kind("f32", "float", "float", "float", "{}.0F")
I64 = Kind("i64", "int32_t", "int64_t", "int32_t", "{}")


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


def mirrored_moments(mirror: Mirror) -> list[str]:
    r = [line[1] for line in mirror.table]
    pairs = [f"(v[{a}] + v[{b}])" for a, b in mirror.pairs] + [f"v[{i}]" for i in mirror.singles]
    lines = [
        "// sum w r in um; returns sum w.",
        f"static inline float mirrored_f32_moments(const float v[{len(r)}], float sum[3])",
    ]
    lines.append("{")
    for d in range(3):
        groups = mirror.groups(lambda i, d=d: r[i][d], odd=d == 1)
        lines.append(f"    sum[{d}] = {products(F32, groups, 'float')};")
    return [*lines, f"    return {' + '.join(pairs)};", "}", ""]


def moment_lists(mirror: Mirror) -> list[str]:
    """Table 1's places pair by pair, for a kernel that keeps every sum in registers: taken axis by axis,
    all the weights would have to be kept instead. Coefficients are not negative: they then are immediates."""
    r = [line[1] for line in mirror.table]
    behind = -min(p[0] for p in r)
    pairs = [f"PAIR({a}, {b}, {r[b][0] + behind}, {r[b][1]}, {-r[b][2]})" for a, b in mirror.pairs]
    singles = [f"SINGLE({i}, {r[i][0] + behind}, {-r[i][2]})" for i in mirror.singles]
    wrap = " \\\n    "
    return [
        f"#define MIRRORED_BEHIND_UM {behind} // no electrode lies farther from the tip than x = -this",
        "",
        "// For each pair of electrodes: left, right, and in um x + MIRRORED_BEHIND_UM, y of the right one, -z;",
        "// for each on the midline, x + MIRRORED_BEHIND_UM and -z.",
        f"#define MIRRORED_PLACES(PAIR, SINGLE){wrap}{wrap.join(pairs + singles)}",
        "",
    ]


def mirrored(contract: Contract, kind: Kind) -> str:
    """A header with the sums of one number type, inline: these cores have the registers."""
    mirror = Mirror(contract)
    n = len(mirror.table)
    normal = [line[2] for line in mirror.table]
    arms = [arm_nm(a, b) for _, a, b in mirror.table]
    guard = f"BIOTAC_MIRRORED_{kind.name.upper()}_GEN_H"
    lines = [
        f"// {GENERATED}",
        f"// Sums over mirrored pairs of electrodes, in {kind.wide}.",
        f"#ifndef {guard}",
        f"#define {guard}",
        "",
        "#include <stdint.h>",
        "",
    ]
    lines += mirrored_moments(mirror) if kind is F32 else moment_lists(mirror)
    lines += [
        "// sum e n in e * 1/1000.",
        f"static inline void mirrored_{kind.name}_force(const {kind.narrow} v[{n}], {kind.force} sum[3])",
        "{",
    ]
    for d in range(3):
        groups = mirror.groups(lambda i, d=d: normal[i][d], odd=d == 1)
        lines.append(f"    sum[{d}] = {products(kind, groups, kind.force)};")
    lines += [
        "}",
        "",
        "// sum e (r x n) for y and z in e * nm.",
        f"static inline void mirrored_{kind.name}_torque(const {kind.narrow} v[{n}], {kind.wide} sum[2])",
        "{",
    ]
    for k, (d, odd) in enumerate(((1, False), (2, True))):
        groups = mirror.groups(lambda i, d=d: arms[i][d], odd=odd)
        lines.append(f"    sum[{k}] = {products(kind, groups, kind.wide)};")
    return "\n".join([*lines, "}", "", "#endif", ""])


def tables(contract: Contract) -> str:
    """Table 1 for the loops over single electrodes: in float32, and in Q15 of its largest numbers."""
    table = Mirror(contract).table
    arms = [arm_nm(r, n)[1:] for _, r, n in table]
    place = max(abs(v) for _, r, _ in table for v in r)
    arm = max(abs(v) for a in arms for v in a)
    lines = [
        f"// {GENERATED}",
        "// Table 1 for loops over single electrodes. arm: y and z of r x n.",
        "#ifndef BIOTAC_TABLES_GEN_H",
        "#define BIOTAC_TABLES_GEN_H",
        "",
        "#include <stdint.h>",
        "",
        f"#define Q15_PLACE_UM {place} // what 1.0 is",
        f"#define Q15_ARM_NM {arm}",
        "",
    ]
    for name, unit, axes, one, full, values in (
        ("place", "_mm", 3, 1000, place, [r for _, r, _ in table]),
        ("normal", "", 3, 1000, 1000, [n for _, _, n in table]),
        ("arm", "_mm", 2, 10**6, arm, arms),
    ):
        declared = f"[{len(table)}][{axes}] __attribute__((unused)) = {{"
        for kind, cell in (("int16_t q15_" + name, q15(full)), ("float f32_" + name + unit, f32(one))):
            lines.append(f"static const {kind}{declared}")
            for line, vector in zip(table, values, strict=True):
                lines.append("    {" + ", ".join(cell(v) for v in vector) + f"}}, // {line[0]}")
            lines += ["};", ""]
    return "\n".join([*lines, "#endif", ""])


def q15(full: int) -> Callable[[int], str]:
    """value / full in Q15, rounded half away from zero and saturated, as a textbook has it."""

    def cell(value: int) -> str:
        size = min((2 * abs(value) * Q15_ONE + full) // (2 * full), Q15_ONE - 1)
        return f"{size if value >= 0 else -size:6d}"

    return cell


def f32(one: int) -> Callable[[int], str]:
    """value / one as a literal; its decimals are exact, the compiler rounds them once."""
    return lambda value: f"{value / one:.{len(str(one)) - 1}f}F"
