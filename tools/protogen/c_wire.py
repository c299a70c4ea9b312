"""C structs, sizes and byte-by-byte pack/unpack of every message."""

from __future__ import annotations

from collections.abc import Iterable

from .schema import FINGER_AT, GENERATED, REQ_ID_AT, TYPE_BYTES, Contract, Field, Message, c_header, entries, flag_masks

PACKED_AS_HALFWORDS = ("FRAME",)  # most of a board's messages and bytes
C_TYPE = {"u8": "uint8_t", "u16": "uint16_t", "u32": "uint32_t", "i16": "int16_t", "i32": "int32_t"}


# Little-endian bytes of a field, and back.
HELPERS = [
    "static uint8_t *put(uint8_t *at, uint32_t value, int bytes)",
    "{",
    "    for (int k = 0; k < bytes; k++) {",
    "        *at++ = (uint8_t)(value >> (8 * k));",
    "    }",
    "    return at;",
    "}",
    "",
    "static const uint8_t *get(const uint8_t *at, uint32_t *value, int bytes)",
    "{",
    "    *value = 0;",
    "    for (int k = 0; k < bytes; k++) {",
    "        *value |= (uint32_t)*at++ << (8 * k);",
    "    }",
    "    return at;",
    "}",
    "",
]


def struct_name(message: Message) -> str:
    return f"bt_msg_{message.name.lower()}"


def declare(field: Field) -> str:
    array = f"[{field.count}]" if field.count > 1 else ""
    note = field.unit + (f" q{field.frac_bits}" if field.frac_bits else "")
    return f"    {C_TYPE[field.type]} {field.name}{array}; // [{note}] {field.doc}"


def define(message: Message) -> list[str]:
    """A message's number, length on the wire, and struct."""
    out = [f"// {message.doc}", f"#define BT_{message.name}_ID 0x{message.id:02X}"]
    out += [f"#define BT_{message.name}_BYTES {message.payload_bytes}", "typedef struct {"]
    out += [declare(field) for field in message.fields]
    return [*out, f"}} {struct_name(message)};"]


def field_lists(contract: Contract) -> list[str]:
    """X(name, type, count) for every field, so that tests can compare by name."""
    out = []
    for message in contract.messages:
        fields = " ".join(f"X({f.name}, {f.type}, {f.count})" for f in message.fields)
        out += [f"#define BT_{message.name}_FIELDS(X) {fields}"]
    names = " ".join(f"X({m.name}, {struct_name(m)})" for m in contract.messages)
    return [*out, f"#define BT_WIRE_MESSAGES(X) {names}"]


def vocabulary(contract: Contract) -> list[str]:
    """Enums, flags and settings."""
    link = contract.link
    out = []
    for name, enum in link["enum"].items():
        out += [f"// {enum['doc']}", f"enum bt_{name} {{"]
        out += [f"    BT_{name.upper()}_{key} = {e['value']}, // {e['doc']}" for key, e in entries(enum).items()]
        out += ["};", ""]
    for name, flags in link["flags"].items():
        out += [f"// {flags['doc']}"]
        out += [
            f"#define BT_{name.upper()}_FLAG_{key} (1u << {entry['bit']}) // {entry['doc']}"
            for key, entry in entries(flags).items()
        ]
        known = sum(1 << entry["bit"] for entry in entries(flags).values())
        out += [f"#define BT_{name.upper()}_FLAGS 0x{known:X}u // all there are", ""]
    out += ["// Flags of a FRAME or IDLE that hold trust down to this level; LATCHED: that STATUS keeps."]
    out += [f"#define BT_TRUST_FLAGS_{name} 0x{mask:08X}u" for name, mask in flag_masks(link).items()]
    out += ["enum bt_setting {"]
    out += [f"    BT_SETTING_{n.upper()} = {s['id']}, // [{s['unit']}]" for n, s in link["setting"].items()]
    out += ["};", f"#define BT_SETTINGS {len(link['setting'])}", ""]
    return out


def constants(contract: Contract) -> list[str]:
    """The wire's version and sizes, and the values that mean "invalid"."""
    wire = contract.link["wire"]
    return [
        f"#define BT_WIRE_MAJOR {wire['major']}",
        f"#define BT_WIRE_MINOR {wire['minor']}",
        f"#define BT_SCHEMA_HASH 0x{contract.hash:08X}u",
        f"#define BT_FRAME_MAX_BYTES {wire['max_frame_bytes']} // id + payload + CRC",
        f"#define BT_INVALID_COUNT 0x{wire['invalid_count']:04X}",
        "#define BT_INVALID_I16 INT16_MIN",
        "#define BT_INVALID_I32 INT32_MIN",
    ]


def header(contract: Contract) -> str:
    wire, link = contract.link["wire"], contract.link
    out = [
        "#include <stdint.h>",
        "",
        "#ifdef BIOTAC_CLIENT_GEN_H",
        '#error "include this before biotac_client.h, which then takes what both have from here"',
        "#endif",
        "",
        *constants(contract),
        f"#define BT_BOOTLOADER_MAGIC 0x{wire['bootloader_magic']:08X}u // of REBOOT_BOOTLOADER",
        f"#define BT_RESTART_MAGIC 0x{wire['restart_magic']:08X}u // likewise",
        f"#define BT_COMMAND_REQ_ID_AT {REQ_ID_AT} // in every command's payload",
        f"#define BT_COMMAND_FINGER_AT {FINGER_AT} // in that of every command to one finger",
        f"#define BT_SERIAL_BYTES {contract.map['blob']['serial_bytes']} // in every message and map",
        f"#define BT_USB_VENDOR 0x{contract.link['usb']['vendor']:04X}",
        f"#define BT_USB_PRODUCT 0x{contract.link['usb']['product']:04X}",
        "",
    ]
    out += vocabulary(contract)
    out += ["// Ranges, for the bounds that the core asserts."]
    for name, setting in link["setting"].items():
        low, high = setting["range"]
        out += [f"#define BT_SETTING_{name.upper()}_MIN ({low})", f"#define BT_SETTING_{name.upper()}_MAX {high}"]
    out += [""]
    out += [
        "typedef struct {",
        "    uint8_t id;",
        "    int32_t min;",
        "    int32_t max;",
        "    int32_t initial;",
        "} bt_setting_spec;",
        "extern const bt_setting_spec bt_setting_specs[BT_SETTINGS];",
        "",
        f"#define BT_CALIBRATION_VALUES {len(contract.per_finger)}",
        "extern const uint8_t bt_calibration_setting[BT_CALIBRATION_VALUES]; // enum bt_setting of each value",
        "",
    ]
    for message in contract.messages:
        upper, struct = message.name, struct_name(message)
        out += define(message)
        out += [f"void {struct}_pack(const {struct} *msg, uint8_t out[BT_{upper}_BYTES]);"]
        if message.name in PACKED_AS_HALFWORDS:
            out += ["// The same into aligned halfwords, in a third of the time; little-endian cores only."]
            out += [f"void {struct}_pack_even(const {struct} *msg, uint16_t out[(BT_{upper}_BYTES + 1) / 2]);"]
        out += [f"void {struct}_unpack({struct} *msg, const uint8_t in[BT_{upper}_BYTES]);", ""]
    out += [
        "// Payload length of a message id, without id and CRC; -1 when the id is unknown.",
        "int bt_wire_payload_bytes(uint8_t id);",
        "",
        "#ifndef BT_CDEF // the rest is macros for C alone",
        "// X(name, type, count) for every field, so that tests can compare by name.",
    ]
    about = [
        "Messages of the USB link: structs, sizes, pack and unpack. Little-endian, packed.",
        "Units and Q formats stand beside each field; see protocol/MESSAGES.md.",
    ]
    return c_header("MESSAGES", about, [*out, *field_lists(contract), "#endif"])


def source(contract: Contract) -> str:
    out = [
        f"// {GENERATED}",
        '#include "wire/messages_gen.h"',
        "",
        *HELPERS,
    ]
    for message in contract.messages:
        out += pack(message) + (pack_even(message) if message.name in PACKED_AS_HALFWORDS else []) + unpack(message)
    out += lengths("bt_wire_payload_bytes", contract.messages)
    out += ["const bt_setting_spec bt_setting_specs[BT_SETTINGS] = {"]
    for name, setting in contract.link["setting"].items():
        low, high = setting["range"]
        out += [f"    {{BT_SETTING_{name.upper()}, {low}, {high}, {setting['default']}}},"]
    out += ["};", "", "const uint8_t bt_calibration_setting[BT_CALIBRATION_VALUES] = {"]
    out += [f"    BT_SETTING_{name.upper()}," for name in contract.per_finger] + ["};", ""]
    return "\n".join(out)


def lengths(name: str, messages: Iterable[Message]) -> list[str]:
    """A function from a message's id to the payload length."""
    out = [f"int {name}(uint8_t id)", "{", "    switch (id) {"]
    for message in messages:
        out += [f"    case BT_{message.name}_ID:", f"        return BT_{message.name}_BYTES;"]
    return [*out, "    default:", "        return -1;", "    }", "}", ""]


def each(field: Field, *statements: str) -> list[str]:
    """The statements for a field, or for each element; {ref} stands for it."""
    if field.count == 1:
        return [f"    {statement.format(ref=field.name)}" for statement in statements]
    lines = [f"        {statement.format(ref=field.name + '[k]')}" for statement in statements]
    return [f"    for (int k = 0; k < {field.count}; k++) {{", *lines, "    }"]


def pack(message: Message) -> list[str]:
    struct = struct_name(message)
    out = [f"void {struct}_pack(const {struct} *msg, uint8_t out[BT_{message.name}_BYTES])", "{"]
    out += ["    uint8_t *at = out;"]
    for field in message.fields:
        out += each(field, f"at = put(at, (uint32_t)msg->{{ref}}, {TYPE_BYTES[field.type]});")
    return [*out, "    (void)at;", "}", ""]


def pack_even(message: Message) -> list[str]:
    """A pack function that stores halfwords. Raises ValueError if a wider field is at an odd offset."""
    struct = struct_name(message)
    out = ['_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "halfwords are stored as they are");', ""]
    out += [f"void {struct}_pack_even(const {struct} *msg, uint16_t out[(BT_{message.name}_BYTES + 1) / 2])", "{"]
    at, low = 0, ""
    for field in message.fields:
        size, ref = TYPE_BYTES[field.type], f"msg->{field.name}"
        if size == 1 and field.count == 1:
            if at % 2:
                out += [f"    out[{at // 2}] = (uint16_t)({low} | {ref} << 8);"]
            low, at = ref, at + 1
            continue
        if at % 2:
            raise ValueError(f"{message.name}.{field.name} is at an odd offset: it cannot be packed as halfwords")
        for k in range(field.count):
            value = ref if field.count == 1 else f"{ref}[{k}]"
            out += [f"    out[{at // 2}] = (uint16_t){value};"]
            if size == 4:
                out += [f"    out[{at // 2 + 1}] = (uint16_t)((uint32_t){value} >> 16);"]
            at += size
    out += [f"    out[{at // 2}] = {low};"] if at % 2 else []
    return [*out, "}", ""]


def unpack(message: Message) -> list[str]:
    struct = struct_name(message)
    out = [f"void {struct}_unpack({struct} *msg, const uint8_t in[BT_{message.name}_BYTES])", "{"]
    out += ["    const uint8_t *at = in;", "    uint32_t value;"]
    for field in message.fields:
        read = f"at = get(at, &value, {TYPE_BYTES[field.type]});"
        out += each(field, read, f"msg->{{ref}} = ({C_TYPE[field.type]})value;")
    return [*out, "    (void)at;", "}", ""]
