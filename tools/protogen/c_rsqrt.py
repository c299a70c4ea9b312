"""The table of 1 / sqrt for the direction's length, which saves a square root and three divisions.

A component times the table's value is the component at the core's radius, in fractions of 2^32. The fractions are
chosen so that both final units, um and that of the lever, are one product and one shift away. SHARE is the share of
2^32 that the radius itself becomes; it is a little below 1 so that nothing wraps.
"""

from __future__ import annotations

from math import isqrt

from .schema import GENERATED, Contract, c_header

STEP_BITS = 23  # 384 steps from 2^30 to 2^32: linear interpolation is within 2^-17.4
FIRST = 1 << 30 - STEP_BITS
LAST = 1 << 32 - STEP_BITS
UM_BITS = 19  # a component of 20 bits times UM_FACTOR, shifted by this, is in um
LEVER_BITS = 15  # one of 17 bits times LEVER_FACTOR, shifted by this, in 10 mm / 2^17
UM_FACTORS_TRIED = 32


def factors(radius_um: int) -> tuple[int, int]:
    """Factors of um and of the lever, which are in proportion: of the first few pairs the one that rounds least."""
    first = radius_um * (1 << UM_BITS) // (1 << 20) + 1

    def lever(um: int) -> tuple[int, int]:
        exact = um * (1 << 20) * (1 << LEVER_BITS)
        unit = 10000 * (1 << UM_BITS)
        return (exact + unit // 2) // unit, abs((exact + unit // 2) % unit - unit // 2)

    um = min(range(first, first + UM_FACTORS_TRIED), key=lambda um: (lever(um)[1], um))
    return um, lever(um)[0]


def entry(k: int, radius_um: int, um_factor: int) -> int:
    """SHARE * 2^32 / sqrt(k * 2^STEP_BITS), rounded to nearest; SHARE = radius / (2 um_factor)."""
    top = (radius_um << 32 + 32) // (2 * um_factor)
    root = isqrt((k << STEP_BITS) << 64)
    return (2 * top + root) // (2 * root)


def header(contract: Contract) -> str:
    um, lever = factors(contract.sensor["geometry"]["core_radius_um"])
    lines = [
        "#include <stdint.h>",
        "",
        f"#define BT_ROOT_STEP_BITS {STEP_BITS}",
        f"#define BT_ROOT_BASE {base(contract)}",
        f"#define BT_ROOT_UM_FACTOR {um} // component at the radius * 2^20 * this / 2^{UM_BITS} is um",
        f"#define BT_ROOT_UM_BITS {UM_BITS}",
        f"#define BT_ROOT_LEVER_FACTOR {lever} // component * 2^17 * this / 2^{LEVER_BITS} is 10 mm / 2^17",
        f"#define BT_ROOT_LEVER_BITS {LEVER_BITS}",
        "",
        f"extern const uint16_t bt_root_table[{LAST - FIRST + 1}];",
    ]
    about = [
        "BT_ROOT_SHARE * 2^32 / sqrt(q) for q from 2^30 on, at steps of 2^BT_ROOT_STEP_BITS, less",
        "BT_ROOT_BASE. The share is the radius / (2 * BT_ROOT_UM_FACTOR).",
    ]
    return c_header("RSQRT", about, lines)


def base(contract: Contract) -> int:
    radius = contract.sensor["geometry"]["core_radius_um"]
    return entry(LAST, radius, factors(radius)[0])


def source(contract: Contract) -> str:
    radius = contract.sensor["geometry"]["core_radius_um"]
    um, _ = factors(radius)
    values = [entry(k, radius, um) - base(contract) for k in range(FIRST, LAST + 1)]
    if max(values) >= 1 << 16:
        raise ValueError("sensor.toml: the table of roots does not fit in 16 bits")
    rows = [", ".join(map(str, values[k : k + 12])) for k in range(0, len(values), 12)]
    head = [f"// {GENERATED}", '#include "solve/rsqrt_gen.h"', "", f"const uint16_t bt_root_table[{len(values)}] = {{"]
    return "\n".join([*head, *(f"    {row}," for row in rows), "};", ""])
