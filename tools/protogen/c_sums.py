"""Straight-line C for the electrode sums, line by line along the finger.

Seven pairs of electrodes mirror each other in y: they share x, z, n_x and n_z, and differ in the sign of y and n_y.
Electrodes that also share |y|, z and the normal form a line along the finger. So each pair is added and subtracted
once, each line multiplied once, and only x is multiplied per electrode. Behind the seam x is a multiple of 100 um,
which leaves it eight bits. Pairs and lines are found from Table 1, not written down here.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import reduce
from math import gcd

from .c_sensor import electrodes, mirror_image
from .schema import GENERATED, Contract, c_header

UINT32_MAX = 2**32 - 1
WEIGHT_BITS = 22  # of one shifted weight: fewer are too coarse for the PoC
SPLIT_BITS = 6  # of a coordinate, for weights of WEIGHT_BITS: the parts' sums fit 32 bits
ARM_SHIFT = 5  # torque sums are in 1/16 count * (x_unit / 1000) * 2^ARM_SHIFT
ARM_SPLIT_BITS = 8  # fraction bits of an arm that is not in a line's product


@dataclass(frozen=True)
class Line:
    """Electrodes that differ only in x and in the sign of y; right is None on the midline."""

    y: int
    z: int
    normal: tuple[int, int, int]
    members: list[tuple[int, int | None, int]]  # left or single, right, x

    @property
    def mirrored(self) -> bool:
        return self.y != 0

    @property
    def width(self) -> int:
        return 2 if self.mirrored else 1


class MirroredLines:
    """Table 1 as lines."""

    def __init__(self, contract: Contract) -> None:
        table = electrodes(contract)
        groups: dict[tuple[int, int, tuple[int, int, int]], list[tuple[int, int | None, int]]] = {}
        for i, (name, r, n) in enumerate(table):
            if r[1] > 0:
                continue
            if r[1] == 0 and n[1]:
                raise ValueError(f"sensor.toml: {name} is on the midline but faces sideways")
            key = (-r[1], r[2], (n[0], -n[1], n[2]))
            groups.setdefault(key, []).append((i, mirror_image(table, i), r[0]))
        self.lines = [Line(y, z, n, members) for (y, z, n), members in groups.items()]
        self.count = len(table)
        behind = [-x for line in self.lines for _, _, x in line.members if x < 0]
        self.x_unit = reduce(gcd, behind)
        if any(line.z >= 0 for line in self.lines):
            raise ValueError("sensor.toml: an electrode is not below the axis (z < 0), which the sums of z need")

    def summed(self, bits: int) -> dict[str, int]:
        """For each sum, the sum over the electrodes of the lower ``bits`` of |coordinate|."""
        members = [(line, x) for line in self.lines for _, _, x in line.members]
        coordinates = {
            "ahead": [(line.width, x) for line, x in members if x > 0],
            "behind": [(line.width, -x // self.x_unit) for line, x in members if x < 0],
            "y": [(1, line.y) for line, _ in members],
            "z": [(line.width, -line.z) for line, _ in members],
        }
        mask = (1 << bits) - 1
        return {name: sum(width * (c & mask) for width, c in weighted) for name, weighted in coordinates.items()}


def add(name: str, factor: int, term: str) -> list[str]:
    """C that adds a product to a sum: nothing for factor 0, no factor for 1."""
    if factor == 0:
        return []
    sign = "-" if factor < 0 else "+"
    return [f"    {name} {sign}= {term if abs(factor) == 1 else f'{abs(factor)} * {term}'};"]


def title(line: Line) -> str:
    names = [f"E{a + 1}" + (f"/E{b + 1}" if b is not None else "") for a, b, _ in line.members]
    return f"    // {' '.join(names)}"


def load(line: Line, member: tuple[int, int | None, int], k: int, form: str) -> list[str]:
    """C that reads one pair or single into even (and odd), summing along the line."""
    a, b, _ = member
    out = [f"    a = {form.format(f'v[{a}]')};"]
    if b is None:
        return [*out, "    pair = a;", "    even = pair;" if k == 0 else "    even += pair;"]
    out += [f"    b = {form.format(f'v[{b}]')};", "    pair = a + b;"]
    out += ["    even = pair;", "    odd = b - a;"] if k == 0 else ["    even += pair;", "    odd += b - a;"]
    return out


def moments(finger: MirroredLines, *, split: bool) -> list[str]:
    """The moments' body; ``split``: coordinates in two parts, and x behind the seam in two sums."""
    out = ["    uint32_t a, b, pair, even, odd;"]
    names = ["ahead_hi", "ahead_lo", "y_hi", "y_lo", "z_hi", "z_lo"] if split else ["ahead", "y", "z"]
    names += ["behind", "total"]
    out += [f"    uint32_t {name} = 0;" for name in names]
    form = "{} << up >> down" if split else "compressed({})"

    def product(name: str, coefficient: int, term: str) -> list[str]:
        if not split:
            return add(name, -coefficient, term)
        mask = (1 << SPLIT_BITS) - 1
        return [
            *add(f"{name}_hi", coefficient >> SPLIT_BITS, term),
            *add(f"{name}_lo", coefficient & mask, term),
        ]

    used = 0
    moved = False
    # From ahead to behind, so that only one sum of x is live at a time.
    for line in sorted(finger.lines, key=lambda line: line.members[0][2] < 0):
        out.append(title(line))
        for k, member in enumerate(line.members):
            out += load(line, member, k, form)
            x = member[2]
            if x > 0:
                out += product("ahead", x, "pair")
            elif x < 0:
                unit = -x // finger.x_unit
                used += line.width * unit
                if split and not moved and used > UINT32_MAX >> WEIGHT_BITS:
                    out += ["    sums->behind[0] = behind;", "    behind = 0;"]
                    used, moved = line.width * unit, True
                out += add("behind", unit if split else -unit, "pair")
        out += product("z", -line.z, "even")
        if line.mirrored:
            out += product("y", line.y, "odd")
        out += add("total", 1 if split else -1, "even")
    if split:
        if not moved or used > UINT32_MAX >> WEIGHT_BITS:
            raise ValueError("sensor.toml: x behind the seam does not fit in two sums")
        out += ["    sums->behind[1] = behind;"]
        names.remove("behind")
    signed = ("y", "y_hi", "y_lo")
    return out + [f"    sums->{name} = {'(int32_t)' if name in signed else ''}{name};" for name in names]


def force(finger: MirroredLines) -> list[str]:
    out = ["    int32_t a, b, pair, even, odd;"]
    out += [f"    int32_t {axis} = 0;" for axis in "xyz"]
    for line in finger.lines:
        out.append(title(line))
        for k, member in enumerate(line.members):
            out += load(line, member, k, "{}")
        for d, (axis, term) in enumerate((("x", "even"), ("y", "odd"), ("z", "even"))):
            out += add(axis, line.normal[d] if d != 1 or line.mirrored else 0, term)
    return [*out, *(f"    sum[{d}] = {axis};" for d, axis in enumerate("xyz"))]


def fraction(finger: MirroredLines, arm_nm: int) -> tuple[int, int]:
    """An arm in units of a torque sum: whole part and fraction in 2^-ARM_SPLIT_BITS, rounded half up."""
    unit_nm = finger.x_unit << ARM_SHIFT
    scaled = (2 * (arm_nm << ARM_SPLIT_BITS) + unit_nm) // (2 * unit_nm)
    hi = (scaled + (1 << ARM_SPLIT_BITS - 1)) >> ARM_SPLIT_BITS
    return hi, scaled - (hi << ARM_SPLIT_BITS)


def arms(line: Line) -> tuple[int, int]:
    """Arms in nm of a line of one electrode: about y for the even sum, about z for the odd one."""
    (_, _, x), (nx, ny, nz) = line.members[0], line.normal
    return line.z * nx - x * nz, x * ny - line.y * nx


def by_line(line: Line) -> bool:
    """Whether a line is behind the seam and faces straight away from the axis: arms are x times the normal."""
    return line.normal[0] == 0 and all(x < 0 for _, _, x in line.members)


def torque(finger: MirroredLines) -> list[str]:
    """Per axis three sums: whole units, the lines' exact 2^-ARM_SHIFT, and the rounded arms' 2^-ARM_SPLIT_BITS."""
    out = ["    int32_t a, b, pair, even, odd, x_even, x_odd;"]
    out += [f"    int32_t {axis}_{part} = 0;" for axis in "yz" for part in ("hi", "line", "lo")]
    for line in finger.lines:
        out.append(title(line))
        if not by_line(line):
            if len(line.members) != 1:
                raise ValueError("sensor.toml: a line that faces along the finger has several electrodes")
            out += load(line, line.members[0], 0, "{}")
            for axis, term, arm in zip("yz", ("even", "odd"), arms(line), strict=True):
                if term == "even" or line.mirrored:
                    hi, lo = fraction(finger, arm)
                    out += add(f"{axis}_hi", hi, term) + add(f"{axis}_lo", lo, term)
            continue
        for k, (a, b, x) in enumerate(line.members):
            unit, sign = -x // finger.x_unit, "" if k == 0 else "+"
            out.append(f"    a = v[{a}];")
            if b is None:
                out.append(f"    x_even {sign}= {unit} * a;")
            else:
                out.append(f"    b = v[{b}];")
                out += [f"    x_odd {sign}= {unit} * (b - a);", f"    x_even {sign}= {unit} * (a + b);"]
        for axis, term, n in line_factors(line):
            whole, part = divmod(abs(n), 1 << ARM_SHIFT)
            flip = -1 if n < 0 else 1
            out += add(f"{axis}_hi", flip * whole, term) + add(f"{axis}_line", flip * part, term)
    fine, line_parts = 1 << ARM_SPLIT_BITS - ARM_SHIFT, 1 << ARM_SHIFT
    return out + [f"    sum[{d}] = {a}_hi + ({a}_line + {a}_lo / {fine}) / {line_parts};" for d, a in enumerate("yz")]


def line_factors(line: Line) -> list[tuple[str, str, int]]:
    """The factors with which a line's sum of -x e enters the torques: (axis, C variable, factor)."""
    pairs = [("y", "x_even", line.normal[2])]
    return [*pairs, ("z", "x_odd", -line.normal[1])] if line.mirrored else pairs


def line_parts_max(finger: MirroredLines) -> int:
    """The largest sum of the lines' fractions per unit of |e|."""
    sums = {"y": 0, "z": 0}
    for line in finger.lines:
        if by_line(line):
            length = sum(-x for _, _, x in line.members) // finger.x_unit * line.width
            for axis, _, n in line_factors(line):
                sums[axis] += length * (abs(n) % (1 << ARM_SHIFT))
    return max(sums.values())


def header(contract: Contract) -> str:
    finger = MirroredLines(contract)
    whole, low = finger.summed(32), finger.summed(SPLIT_BITS)
    lines = [
        "#include <stdint.h>",
        "",
        f"#define BT_SUMS_X_UNIT_UM {finger.x_unit}",
        f"#define BT_SUMS_WEIGHT_BITS {WEIGHT_BITS} // a shifted weight is below 2^this",
        f"#define BT_SUMS_SPLIT_BITS {SPLIT_BITS}",
        "",
        "// The coordinates' sums of magnitudes, and those of their split-off low bits: what the largest",
        "// weight is multiplied by. The core asserts that everything fits.",
        f"#define BT_SUMS_AHEAD_UM {whole['ahead']}",
        f"#define BT_SUMS_BEHIND_UNITS {whole['behind']}",
        f"#define BT_SUMS_Y_UM {whole['y']}",
        f"#define BT_SUMS_Z_UM {whole['z']}",
        f"#define BT_SUMS_LOW_MAX {max(low['ahead'], low['z'])}",
        f"#define BT_SUMS_Y_LOW_MAX {low['y']}",
        "",
        "// With weights max(-e, 0), as they are.",
        "typedef struct {",
        "    uint32_t ahead, behind, z, total;",
        "    int32_t y;",
        "} bt_linear_sums;",
        f"void bt_sums_linear(const int32_t v[{finger.count}], bt_linear_sums *sums);",
        "",
        "// With weights v << up >> down, each below 2^BT_SUMS_WEIGHT_BITS; a sum is hi << BT_SUMS_SPLIT_BITS + lo,",
        "// and behind the seam that of both.",
        "typedef struct {",
        "    uint32_t ahead_hi, ahead_lo, behind[2], z_hi, z_lo, total;",
        "    int32_t y_hi, y_lo;",
        "} bt_split_sums;",
        f"void bt_sums_split(const uint32_t v[{finger.count}], int up, int down, bt_split_sums *sums);",
        "",
        "// sum e n in e * 1/1000; fits int32 for every |e| <= 4095 counts in 1/16 count.",
        f"void bt_sums_force(const int32_t v[{finger.count}], int32_t sum[3]);",
        "",
        "// sum e (r x n), y and z, in BT_SUMS_TORQUE_UNIT_NM * e: less than 2 are cut, and arms ahead of the seam",
        "// are rounded to 1/2^BT_SUMS_ARM_BITS of the unit.",
        f"#define BT_SUMS_TORQUE_UNIT_NM {finger.x_unit << ARM_SHIFT}",
        f"#define BT_SUMS_ARM_BITS {ARM_SPLIT_BITS}",
        f"#define BT_SUMS_LINE_PARTS_MAX {line_parts_max(finger)} // what the largest e is multiplied by",
        f"void bt_sums_torque(const int32_t v[{finger.count}], int32_t sum[2]);",
    ]
    about = [
        "Sums over mirrored pairs of electrodes, each within 32 bits. ahead: over the",
        "electrodes with x > 0, in um; behind: over the others, -x in BT_SUMS_X_UNIT_UM; y and z (downwards)",
        "in um.",
    ]
    return c_header("SUMS", about, lines)


def source(contract: Contract) -> str:
    finger = MirroredLines(contract)
    n = finger.count
    functions = [
        (f"void bt_sums_linear(const int32_t v[{n}], bt_linear_sums *sums)", moments(finger, split=False)),
        (
            f"void bt_sums_split(const uint32_t v[{n}], int up, int down, bt_split_sums *sums)",
            moments(finger, split=True),
        ),
        (f"void bt_sums_force(const int32_t v[{n}], int32_t sum[3])", force(finger)),
        (f"void bt_sums_torque(const int32_t v[{n}], int32_t sum[2])", torque(finger)),
    ]
    out = [f"// {GENERATED}", '#include "signal/sums_gen.h"', "", '#include "fixed_point.h"', ""]
    out += ["// min(e, 0), without a branch.", "static inline uint32_t compressed(int32_t e)", "{"]
    out += ["    return (uint32_t)(e & bt_shift_down(e, 31));", "}"]
    for signature, body in functions:
        out += ["", signature, "{", *body, "}"]
    return "\n".join([*out, ""])
