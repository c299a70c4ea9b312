"""C constants of the wrench map: kinds, gates, formats, and the bounds that follow from the geometry."""

from __future__ import annotations

import math
from typing import Any

from .c_sensor import E_MAX_Q4, electrodes
from .schema import GENERATED, Contract

HEADER_BYTES = 24  # u8 version, axes, blocks, 0; serial; u32 made_s
EXPONENTS = 10  # room for those of all axes, so that what follows is aligned
BLOCK_BYTES = 2 + EXPONENTS  # u8 kind, gate, exponents


def columns(contract: Contract, kind: dict[str, Any]) -> int:
    n = len(electrodes(contract))
    return {"one": 1, "electrodes": n, "pairs": n * (n + 1) // 2}[str(kind["columns"])]


def gate_max(contract: Contract) -> int:
    """The largest gate in 2^-gate_q: the centroid stays inside the electrodes' hull. With room for rounding."""
    centroid, reach = contract.map["centroid"], [0.0, 0.0]
    for d, name in enumerate(("reach_x_um", "reach_y_um")):
        reach[d] = max(abs(r[d]) for _, r, _ in electrodes(contract)) / centroid[name]
    largest = max(1.0, *reach, reach[0] ** 2, reach[0] * reach[1], reach[1] ** 2)
    return math.ceil(largest * 2 ** contract.map["fixed"]["gate_q"]) + 8


def header(contract: Contract) -> str:
    its = contract.map
    blob, fixed, centroid, conductance = its["blob"], its["fixed"], its["centroid"], its["conductance"]
    pairs = len(electrodes(contract)) * (len(electrodes(contract)) + 1) // 2
    lines = [
        f"// {GENERATED}",
        "// The wrench map: its blocks' kinds and gates, and the formats of its numbers (SPEC.md, Wrench maps).",
        "#ifndef BIOTAC_MAP_GEN_H",
        "#define BIOTAC_MAP_GEN_H",
        "",
        f"#define BT_MAP_VERSION {blob['version']}",
        f"#define BT_MAP_MAX_BYTES {blob['max_bytes']}",
        f"#define BT_MAP_HEADER_BYTES {HEADER_BYTES}",
        f"#define BT_MAP_BLOCK_BYTES {BLOCK_BYTES}",
        f"#define BT_MAP_SERIAL_BYTES {blob['serial_bytes']}",
        "",
        "// How many axes a map has.",
        *(f"#define BT_MAP_AXES_{name} {count}" for name, count in its["axes"].items()),
        f"#define BT_MAP_AXES_MAX {max(its['axes'].values())}",
        f"#define BT_MAP_EXPONENTS {EXPONENTS}",
        f"#define BT_MAP_PAIRS {pairs}",
        "",
        "enum bt_map_kind {",
        *(f"    BT_MAP_KIND_{name} = {k['value']}, // {k['doc']}" for name, k in its["kind"].items()),
        "};",
        f"#define BT_MAP_KINDS {len(its['kind'])}",
        "// Columns of each kind, in this order.",
        f"#define BT_MAP_KIND_COLUMNS {{{', '.join(str(columns(contract, k)) for k in its['kind'].values())}}}",
        "",
        "enum bt_map_gate {",
        *(f"    BT_MAP_GATE_{name} = {g['value']}, // {g['doc']}" for name, g in its["gate"].items()),
        "};",
        f"#define BT_MAP_GATES {len(its['gate'])}",
        "",
        f"#define BT_MAP_FLOOR_Q4 {16 * centroid['floor_counts']}",
        f"#define BT_MAP_REACH_X_UM {centroid['reach_x_um']}",
        f"#define BT_MAP_REACH_Y_UM {centroid['reach_y_um']}",
        f"#define BT_MAP_COUNT_MIN {conductance['count_min']}",
        f"#define BT_MAP_COUNT_MAX {conductance['count_max']}",
        f"#define BT_MAP_RATIO_MAX {conductance['ratio_max']}",
        "",
        f"#define BT_MAP_ONE_Q {fixed['one_q']}",
        f"#define BT_MAP_CONDUCTANCE_Q {fixed['conductance_q']}",
        f"#define BT_MAP_FINE_BITS {fixed['conductance_fine_bits']}",
        f"#define BT_MAP_GATE_Q {fixed['gate_q']}",
        f"#define BT_MAP_RESULT_Q {fixed['result_q']}",
        f"#define BT_MAP_EXPONENT_MAX {fixed['exponent_max']}",
        f"#define BT_MAP_COEFFICIENT_SUM_MAX {fixed['coefficient_sum_max']}u",
        f"#define BT_MAP_RESULT_MAX {fixed['result_max']}",
        "",
        "// Largest magnitudes, for the bounds that map.c asserts.",
        f"#define BT_MAP_GATE_MAX {gate_max(contract)} // of every gate, in 2^-{fixed['gate_q']}",
        f"#define BT_MAP_FEATURE_MAX {E_MAX_Q4} // of every 16-bit factor of a column",
        "",
        "#endif",
        "",
    ]
    return "\n".join(lines)
