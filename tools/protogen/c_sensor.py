"""C tables of the sensor: channels, slot order, geometry, and the bounds that follow from them."""

from __future__ import annotations

import math
from typing import Any

from .schema import GENERATED, Contract, c_header

E_MAX_Q4 = 4095 * 16  # |count - tare| in 1/16 count


def electrodes(contract: Contract) -> list[tuple[str, tuple[int, ...], tuple[int, ...]]]:
    rows = contract.sensor["geometry"]["electrodes"]
    return [(row[0], tuple(row[1:4]), tuple(row[4:7])) for row in rows]


def mirror_image(table: list[Any], i: int) -> int | None:
    """The electrode on the other side from i; None on the midline. Raises ValueError if there is none."""
    name, r, n = table[i]
    if r[1] == 0:
        return None
    image = ((r[0], -r[1], r[2]), (n[0], -n[1], n[2]))
    twins = [j for j, (_, q, m) in enumerate(table) if (q, m) == image]
    if len(twins) != 1:
        raise ValueError(f"sensor.toml: {name} must have exactly one mirror image, as sums go over pairs")
    return twins[0]


def arm_nm(r_um: tuple[int, ...], n_milli: tuple[int, ...]) -> tuple[int, int, int]:
    """r x n; um times 1/1000 is nm, so the product is exact."""
    (x, y, z), (a, b, c) = r_um, n_milli
    return (y * c - z * b, z * a - x * c, x * b - y * a)


def row(values: tuple[int, ...], width: int = 6) -> str:
    return "{" + ", ".join(f"{v:{width}d}" for v in values) + "}"


def frame_ms(contract: Contract) -> int:
    """Length of a round in ms. Raises ValueError if it is no whole number: times are given as frame counts."""
    slots, hz = len(contract.sensor["frame"]["slots"]), contract.sensor["bus"]["slot_hz"]
    if slots * 1000 % hz:
        raise ValueError(f"sensor.toml: {slots} slots at {hz} Hz are not a whole number of ms")
    return int(slots * 1000 // hz)


def header(contract: Contract) -> str:
    sensor, bus = contract.sensor, contract.sensor["bus"]
    table = electrodes(contract)
    channels, slots = sensor["channel"], sensor["frame"]["slots"]
    l1 = lambda vectors: max(sum(abs(v[d]) for v in vectors) for d in range(3))  # noqa: E731
    arms = [arm_nm(r, n) for _, r, n in table]
    lines = [
        "#include <stdbool.h>",
        "#include <stdint.h>",
        "",
        f"#define BT_FOREIGN_ELECTRODES {sensor['foreign']['electrodes']}",
        f"#define BT_CHANNELS {len(channels)}",
        f"#define BT_SLOTS {len(slots)}",
        f"#define BT_ELECTRODES {len(table)}",
        f"#define BT_PAC_PER_FRAME {slots.count('PAC')}",
        f"#define BT_FIRST_PAC_SLOT {slots.index('PAC')}",
        f"#define BT_MAX_FINGERS {bus['max_sensors']}",
        f"#define BT_FULL_SCALE_COUNT {bus['full_scale_count']}",
        f"#define BT_CORE_RADIUS_UM {sensor['geometry']['core_radius_um']}",
        "",
        f"#define BT_SPI_HZ {bus['spi_hz']}",
        f"#define BT_SETTLE_US {bus['settle_us']}",
        f"#define BT_GAP_US {bus['gap_us']}",
        f"#define BT_PROPERTY_GAP_US {bus['property_gap_us']}",
        f"#define BT_SLOT_HZ {bus['slot_hz']}",
        f"#define BT_FRAME_MS {frame_ms(contract)} // one round of slots",
        f"#define BT_POWER_ON_MS {bus['power_on_ms']}",
        f"#define BT_LISTEN_WORD 0x{bus['listen_word']:04X}",
        *(
            f"#define BT_RESEND_COMMAND_{k + 1} 0x{command:02X}"
            for k, command in enumerate(sensor["resend"]["commands"])
        ),
        f"#define BT_PROPERTY_WRITE_COMMAND 0x{sensor['property_write']['command']:02X}",
        f"#define BT_PROPERTY_READ_COMMAND 0x{sensor['property_read']['command']:02X}",
        "",
        "enum bt_channel {",
        *(f"    BT_CHANNEL_{c['name']} = {k}," for k, c in enumerate(channels)),
        "};",
        "",
        "enum bt_error_word {",
        *(f"    BT_ERROR_WORD_{e['name']} = 0x{e['word']:04X}, // {e['doc']}" for e in sensor["error_word"]),
        "};",
        "",
        "enum bt_property {",
        *(f"    BT_PROPERTY_{p['name']} = 0x{p['selector']:02X}, // {p['bytes']} bytes" for p in sensor["property"]),
        "};",
        "",
        "// Largest possible sums over all electrodes with |e| <= 4095 counts in 1/16 count (q4).",
        "// The core asserts at compile time that its accumulators hold them.",
        f"#define BT_E_MAX_Q4 {E_MAX_Q4}",
        f"#define BT_SUM_SQUARES_MAX_Q8 {E_MAX_Q4**2 * len(table)}LL",
        f"#define BT_SUM_SQUARES_R_MAX_Q8_UM {E_MAX_Q4**2 * l1([r for _, r, _ in table])}LL",
        f"#define BT_SUM_NORMAL_MAX_Q4_MILLI {E_MAX_Q4 * l1([n for _, _, n in table])}LL",
        f"#define BT_SUM_ARM_MAX_Q4_NM {E_MAX_Q4 * l1(arms)}LL",
        f"#define BT_ELECTRODE_Z_MAX_UM ({max(r[2] for _, r, _ in table)})",
        f"#define BT_ELECTRODE_MAX_UM {max(abs(v) for _, r, _ in table for v in r)}",
        "",
        "extern const uint8_t bt_channel_command[BT_CHANNELS]; // first byte of the sample command",
        "extern const uint8_t bt_slot_channel[BT_SLOTS];       // enum bt_channel of each slot",
        "extern const uint8_t bt_slot_pac[BT_SLOTS];           // PAC slots before each slot",
        "extern const int16_t bt_electrode_um[BT_ELECTRODES][3];",
        "extern const int16_t bt_normal_milli[BT_ELECTRODES][3];",
        "extern const int32_t bt_arm_nm[BT_ELECTRODES][3]; // r x n, exact",
        "extern const uint16_t bt_normal_length_milli[3];  // of all normals' x, y and z, as three vectors",
        "",
        "bool bt_serial_is_foreign(const uint8_t *serial); // of a sensor with other electrodes, such as a BioTac SP",
    ]
    about = [
        "The sensor's side: channels and their command bytes, slot order, electrode geometry.",
        "Units stand in the names: um, milli (1/1000), nm, us, Hz.",
    ]
    return c_header("SENSOR", about, lines)


def source(contract: Contract) -> str:
    channels, slots = contract.sensor["channel"], contract.sensor["frame"]["slots"]
    table = electrodes(contract)
    lines = [f"// {GENERATED}", '#include "wire/sensor_gen.h"', "", "#include <string.h>", ""]
    lines += ["const uint8_t bt_channel_command[BT_CHANNELS] = {"]
    lines += [f"    [BT_CHANNEL_{c['name']}] = 0x{c['command']:02X}," for c in channels] + ["};", ""]
    lines += ["const uint8_t bt_slot_channel[BT_SLOTS] = {"]
    lines += [f"    BT_CHANNEL_{slot}," for slot in slots] + ["};", ""]
    before = ", ".join(str(slots[:k].count("PAC")) for k in range(len(slots)))
    lines += ["const uint8_t bt_slot_pac[BT_SLOTS] = {", f"    {before},", "};", ""]
    for name, kind, values in (
        ("bt_electrode_um", "int16_t", [r for _, r, _ in table]),
        ("bt_normal_milli", "int16_t", [n for _, _, n in table]),
        ("bt_arm_nm", "int32_t", [arm_nm(r, n) for _, r, n in table]),
    ):
        lines += [f"const {kind} {name}[BT_ELECTRODES][3] = {{"]
        width = 9 if kind == "int32_t" else 6
        lines += [f"    {row(v, width)}, // {t[0]}" for v, t in zip(values, table, strict=True)]
        lines += ["};", ""]
    lengths = [round(math.hypot(*(n[d] for _, _, n in table))) for d in range(3)]
    lines += [f"const uint16_t bt_normal_length_milli[3] = {row(lengths, 6)};", ""]
    same = " || ".join(f'memcmp(serial, "{s}", {len(s)}) == 0' for s in contract.sensor["foreign"]["serials"])
    lines += ["bool bt_serial_is_foreign(const uint8_t *serial)", "{", f"    return {same};", "}", ""]
    return "\n".join(lines)
