"""C constants of the wrench map: kinds, gates, formats, and the bounds that follow from the geometry."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import Any

from .c_sensor import electrodes
from .schema import Contract, c_header

HEADER_BYTES = 32  # u8 version, axes, blocks, 0; serial; u32 made_s; u16 margin[4]
EXPONENTS = 10  # room for all axes, which also aligns the next part
BLOCK_BYTES = 2 + EXPONENTS  # u8 kind, gate, exponents


def columns(contract: Contract, kind: dict[str, Any]) -> int:
    n = len(electrodes(contract))
    return {"one": 1, "electrodes": n, "pairs": n * (n + 1) // 2}[str(kind["columns"])]


def gate_max(contract: Contract) -> int:
    """The largest gate in 2^-gate_q, with room for rounding: the centroid stays inside the electrodes' hull."""
    centroid, reach = contract.map["centroid"], [0.0, 0.0]
    for d, name in enumerate(("reach_x_um", "reach_y_um")):
        reach[d] = max(abs(r[d]) for _, r, _ in electrodes(contract)) / centroid[name]
    largest = max(1.0, *reach, reach[0] ** 2, reach[0] * reach[1], reach[1] ** 2)
    return math.ceil(largest * 2 ** contract.map["fixed"]["gate_q"]) + 8


def halves(contract: Contract, kind: dict[str, Any]) -> int:
    """Coefficients of one kind and axis as stored in the blob: two per word, so that each sum has an even length."""
    n = len(electrodes(contract))
    return {"one": 2, "electrodes": n + n % 2, "pairs": n * ((n + 1) // 2)}[str(kind["columns"])]


def places(contract: Contract) -> list[list[int]]:
    """Each electrode's x and y divided by their reaches, in 2^-place_q."""
    centroid, q = contract.map["centroid"], contract.map["fixed"]["place_q"]
    reach = centroid["reach_x_um"], centroid["reach_y_um"]
    return [[round(r[d] * 2**q / reach[d]) for d in range(2)] for _, r, _ in electrodes(contract)]


#: The reciprocal's first guess depends on this many bits of the divisor.
GUESS_BITS = 6


def reciprocal(contract: Contract) -> tuple[list[int], int]:
    """Guesses t and a constant c such that t ((c - d t) >> 16) is 2^46 full/(full + 1) / d, for d in 2^15..2^16.

    The relative error is below 2^-14. This is Newton's step t (2 K - d t) / K for K / d, with a factor K / 2^31 moved
    into both numbers. The factor holds the full scale's share, and centres the one-sided errors of guess and cut.
    """
    full = contract.sensor["bus"]["full_scale_count"]
    centred = 3.6e-5
    guess = 2.0**31 * math.sqrt(full / (full + 1) * (1.0 + centred))
    edges = [2**15 + k * 2 ** (15 - GUESS_BITS) for k in range(2**GUESS_BITS + 1)]
    return [round(2.0 * guess / (low + high)) for low, high in pairwise(edges)], round(2.0 * guess)


def header(contract: Contract) -> str:
    layout = contract.map
    blob, fixed, centroid, conductance = (layout[name] for name in ("blob", "fixed", "centroid", "conductance"))
    guesses, twice = reciprocal(contract)
    lines = [
        f"#define BT_MAP_VERSION {blob['version']}",
        f"#define BT_MAP_MAX_BYTES {blob['max_bytes']}",
        f"#define BT_MAP_HEADER_BYTES {HEADER_BYTES}",
        f"#define BT_MAP_BLOCK_BYTES {BLOCK_BYTES}",
        "",
        "// How many axes a map has.",
        *(f"#define BT_MAP_AXES_{name} {count}" for name, count in layout["axes"].items()),
        f"#define BT_MAP_AXES_MAX {max(layout['axes'].values())}",
        f"#define BT_MAP_EXPONENTS {EXPONENTS}",
        "",
        "enum bt_map_kind {",
        *(f"    BT_MAP_KIND_{name} = {k['value']}, // {k['doc']}" for name, k in layout["kind"].items()),
        "};",
        f"#define BT_MAP_KINDS {len(layout['kind'])}",
        "// Columns of each kind, in this order.",
        f"#define BT_MAP_KIND_COLUMNS {{{', '.join(str(columns(contract, k)) for k in layout['kind'].values())}}}",
        "// Coefficients of each as they lie in the blob, of an axis.",
        f"#define BT_MAP_KIND_COEFFICIENTS {{{', '.join(str(halves(contract, k)) for k in layout['kind'].values())}}}",
        "",
        "enum bt_map_gate {",
        *(f"    BT_MAP_GATE_{name} = {g['value']}, // {g['doc']}" for name, g in layout["gate"].items()),
        "};",
        f"#define BT_MAP_GATES {len(layout['gate'])}",
        "",
        f"#define BT_MAP_FLOOR_Q4 {16 * centroid['floor_counts']}",
        f"#define BT_MAP_REACH_X_UM {centroid['reach_x_um']}",
        f"#define BT_MAP_REACH_Y_UM {centroid['reach_y_um']}",
        f"#define BT_MAP_COUNT_MIN {conductance['count_min']}",
        f"#define BT_MAP_COUNT_MAX {conductance['count_max']}",
        f"#define BT_MAP_RATIO_MAX {conductance['ratio_max']}",
        "",
        *(f"#define BT_MAP_{name.upper()} {value}" for name, value in fixed.items()),
        "",
        "// Places of the electrodes along and across, over their reaches in 2^-PLACE_Q.",
        f"#define BT_MAP_PLACES {{{', '.join(f'{{{x}, {y}}}' for x, y in places(contract))}}}",
        f"#define BT_MAP_PLACE_SUM {max(sum(abs(place[d]) for place in places(contract)) for d in range(2))}",
        f"#define BT_MAP_SQUARE_SUM {sum(x * x >> fixed['place_q'] for x, _ in places(contract))}",
        f"#define BT_MAP_GATE_MAX {gate_max(contract)} // of every gate, in 2^-GATE_Q",
        "",
        f"// A reciprocal's guesses by {GUESS_BITS} bits behind the divisor's first, and its step's constant.",
        f"#define BT_MAP_GUESS_BITS {GUESS_BITS}",
        f"#define BT_MAP_GUESSES {{{', '.join(map(str, guesses))}}}",
        f"#define BT_MAP_GUESS_TWICE {twice}u",
    ]
    about = "The wrench map: its blocks' kinds and gates, and the formats of its numbers (SPEC.md, Wrench maps)."
    return c_header("MAP", [about], lines)
