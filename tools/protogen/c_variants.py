"""C for the benchmark's own kernels: sums over mirrored electrode pairs in float32 and int64, and tables.

The processors for these have an FPU, or a multiplier wide enough (SMLAL), so that nothing is split in two.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from .c_sensor import arm_nm, electrodes, mirror_image
from .schema import Contract, c_header

Q15_ONE = 1 << 15
# Axes, and whether a value of that axis flips with y.
VECTOR = {0: False, 1: True, 2: False}
TORQUE = {1: False, 2: True}


@dataclass(frozen=True)
class Kind:
    """A number type to sum in. ``narrow`` holds a group of terms, ``wide`` a sum of products."""

    name: str
    narrow: str
    wide: str
    force: str
    literal: str  # format string of a coefficient


F32 = Kind("f32", "float", "float", "float", "{}.0F")
I64 = Kind("i64", "int32_t", "int64_t", "int32_t", "{}")


class Mirror:
    """Pairs and singles of Table 1, and sums over them grouped by equal coefficient."""

    def __init__(self, contract: Contract) -> None:
        self.table = electrodes(contract)
        self.pairs: list[tuple[int, int]] = []  # (negative y, positive y)
        for i, (_, r, _) in enumerate(self.table):
            image = mirror_image(self.table, i)
            if image is not None and r[1] < 0:
                self.pairs.append((i, image))
        paired = {k for pair in self.pairs for k in pair}
        self.singles = [i for i in range(len(self.table)) if i not in paired]

    def groups(self, values: list[int], *, odd: bool) -> dict[int, list[str]]:
        """Coefficient -> the terms that it multiplies, as C. ``odd``: the coefficient flips with y."""
        out: dict[int, list[str]] = {}
        terms = [(values[b], f"(v[{b}] - v[{a}])" if odd else f"(v[{a}] + v[{b}])") for a, b in self.pairs]
        for coefficient, term in [*terms, *((values[i], f"v[{i}]") for i in self.singles)]:
            # Coefficients that differ only in sign share a product.
            if -coefficient in out:
                out[-coefficient].append(f"-{term}")
            elif coefficient:
                out.setdefault(coefficient, []).append(term)
        return out


def products(kind: Kind, groups: dict[int, list[str]], wide: str) -> str:
    """A sum of products, one per line. In int64 the coefficients carry the sign, because SMLAL only adds."""
    cast = "" if wide == kind.narrow else f"({wide})"
    out = ""
    for coefficient, parts in groups.items():
        inner = " + ".join(parts).replace("+ -", "- ")
        if len(parts) > 1 or inner.startswith("-"):
            inner = f"({inner})"
        subtract = coefficient < 0 and kind is F32
        text = f"{cast}{inner} * {kind.literal.format(abs(coefficient) if subtract else coefficient)}"
        first = ("-" if subtract else "") if not out else f"\n             {'-' if subtract else '+'} "
        out += first + text
    return out


def sums(mirror: Mirror, kind: Kind, wide: str, vectors: list[tuple[int, ...]], odd: dict[int, bool]) -> list[str]:
    """C that sets sum[k] to v times the vectors, along the k-th axis of ``odd`` (axis -> whether it flips with y)."""
    groups = [mirror.groups([vector[d] for vector in vectors], odd=flips) for d, flips in odd.items()]
    return [f"    sum[{k}] = {products(kind, its, wide)};" for k, its in enumerate(groups)]


def mirrored_moments(mirror: Mirror) -> list[str]:
    r = [line[1] for line in mirror.table]
    pairs = [f"(v[{a}] + v[{b}])" for a, b in mirror.pairs] + [f"v[{i}]" for i in mirror.singles]
    return [
        "// sum w r in um; returns sum w.",
        f"static inline float mirrored_f32_moments(const float v[{len(r)}], float sum[3])",
        "{",
        *sums(mirror, F32, "float", r, VECTOR),
        f"    return {' + '.join(pairs)};",
        "}",
        "",
    ]


def moment_lists(mirror: Mirror) -> list[str]:
    """Table 1's places pair by pair, for a kernel that keeps every sum in a register.

    Axis by axis it would have to keep all the weights instead. Coefficients are not negative, to be immediates.
    """
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
    """A header with the sums of one number type, inline because these cores have enough registers."""
    mirror = Mirror(contract)
    n = len(mirror.table)
    lines = [
        "#include <stdint.h>",
        "",
        *(mirrored_moments(mirror) if kind is F32 else moment_lists(mirror)),
        "// sum e n in e * 1/1000.",
        f"static inline void mirrored_{kind.name}_force(const {kind.narrow} v[{n}], {kind.force} sum[3])",
        "{",
        *sums(mirror, kind, kind.force, [line[2] for line in mirror.table], VECTOR),
        "}",
        "",
        "// sum e (r x n) for y and z in e * nm.",
        f"static inline void mirrored_{kind.name}_torque(const {kind.narrow} v[{n}], {kind.wide} sum[2])",
        "{",
        *sums(mirror, kind, kind.wide, [arm_nm(r, n) for _, r, n in mirror.table], TORQUE),
        "}",
    ]
    about = f"Sums over mirrored pairs of electrodes, in {kind.wide}."
    return c_header(f"MIRRORED_{kind.name.upper()}", [about], lines)


def tables(contract: Contract) -> str:
    """Table 1 for the loops over single electrodes: in float32, and in Q15 relative to its largest numbers."""
    table = Mirror(contract).table
    arms = [arm_nm(r, n)[1:] for _, r, n in table]
    place = max(abs(v) for _, r, _ in table for v in r)
    arm = max(abs(v) for a in arms for v in a)
    lines = [
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
    return c_header("TABLES", ["Table 1 for loops over single electrodes. arm: y and z of r x n."], lines[:-1])


def q15(full: int) -> Callable[[int], str]:
    """value / full in Q15, rounded half away from zero and saturated, as in textbooks."""

    def cell(value: int) -> str:
        size = min((2 * abs(value) * Q15_ONE + full) // (2 * full), Q15_ONE - 1)
        return f"{size if value >= 0 else -size:6d}"

    return cell


def f32(one: int) -> Callable[[int], str]:
    """value / one as a literal; its decimals are exact, so the compiler rounds once."""
    return lambda value: f"{value / one:.{len(str(one)) - 1}f}F"
