"""The client's header: the wire's constants and structs, and where each struct's fields are on the wire."""

from __future__ import annotations

from itertools import groupby

from .c_wire import constants, define, field_lists, struct_name, vocabulary
from .schema import TYPE_BYTES, Contract, Message, c_header

_MOST = 0x3F  # numbers in a run; a run is one byte, with the logarithm of the size above the count


def runs(message: Message) -> list[tuple[int, int]]:
    """Runs of numbers of equal size, as (size in bytes, how many): inside a run a struct has no padding."""
    sizes = [TYPE_BYTES[field.type] for field in message.fields for _ in range(field.count)]
    out = []
    for size, group in groupby(sizes):
        count = len(list(group))
        while count:
            out.append((size, min(count, _MOST)))
            count -= out[-1][1]
    return out


def struct_bytes(message: Message) -> int:
    """The struct's size in every common ABI: numbers lie at multiples of their size."""
    at, most = 0, 1
    for size, count in runs(message):
        at = -(-at // size) * size + size * count
        most = max(most, size)
    return -(-at // most) * most


def header(contract: Contract) -> str:
    out = [
        "#include <stdint.h>",
        "",
        "#ifndef BIOTAC_MESSAGES_GEN_H // the core's header has the same, if a program needs both",
    ]
    out += [*constants(contract), "", *vocabulary(contract)]
    for message in contract.messages:
        out += [*define(message), ""]
    out += [
        "#endif",
        "#ifdef BT_CLIENT_LAYOUT",
        "// Of each message: id, how many runs, and the runs; a run is the size's logarithm (2 bits) and a count (6).",
        "static const uint8_t bt_client_layout[] = {",
    ]
    for message in contract.messages:
        found = runs(message)
        numbers = [f"0x{size.bit_length() - 1 << 6 | count:02X}" for size, count in found]
        out += [f"    BT_{message.name}_ID, {len(found)}, {', '.join(numbers)},"]
    out += ["    0, 0,", "};"]
    # C99 and C++ alike.
    out += ["// Numbers lie at multiples of their size."]
    out += [
        f"typedef char {struct_name(m)}_lies_so[sizeof({struct_name(m)}) == {struct_bytes(m)} ? 1 : -1];"
        for m in contract.messages
    ]
    out += ["#endif", "", "#ifdef BT_CLIENT_FIELDS // for tests: X(name, type, count) for every field"]
    about = "The words and structs of the wire for biotac_client.c; units and Q formats stand beside each field."
    return c_header("CLIENT", [about], [*out, *field_lists(contract), "#endif"])
