"""The host's generated modules: sensor_gen.py (tables), messages_gen.py and map_gen.py (wrench maps)."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from .c_map import BLOCK_BYTES, EXPONENTS, HEADER_BYTES, columns, gate_max, halves
from .schema import GENERATED, Contract, Field, Message, entries, flag_masks

STRUCT_CODE = {"u8": "B", "u16": "H", "u32": "I", "i16": "h", "i32": "i"}
NUMPY_CODE = {"u8": "u1", "u16": "<u2", "u32": "<u4", "i16": "<i2", "i32": "<i4"}

# A class that would share its name with another one of host/biotac, such as Frame, has a name of its own.
CLASS_NAMES = {
    "SETTING": "SettingValue", "FRAME": "FrameMessage", "CALIBRATION": "CalibrationMessage", "board": "BoardKind",
}  # fmt: skip
OLD_NAMES = '{"Board": "BoardKind", "Calibration": "CalibrationMessage", "Frame": "FrameMessage"}'


def sensor(contract: Contract) -> str:
    s = contract.sensor
    geometry = s["geometry"]
    out = [
        f'"""{GENERATED}',
        "",
        "The sensor's side: channels, slot order, geometry (um, 1/1000) and conversions.",
        '"""',
        "",
    ]
    for key, value in s["bus"].items():
        out.append(f"{key.upper()} = {value}")
    out.append(f"FOREIGN_ELECTRODES = {s['foreign']['electrodes']}")
    out += table("FOREIGN_SERIALS: tuple[bytes, ...]", "(", ")", (f'b"{start}",' for start in s["foreign"]["serials"]))
    out.append("")
    commands = (f'"{c["name"]}": 0x{c["command"]:02X},' for c in s["channel"])
    out += table("CHANNEL_COMMAND: dict[str, int]", "{", "}", commands)
    out += table("SLOTS: tuple[str, ...]", "(", ")", (f'"{n}",' for n in s["frame"]["slots"]))
    errors = (f'0x{e["word"]:04X}: "{e["doc"]}",' for e in s["error_word"])
    out += table("ERROR_WORD: dict[int, str]", "{", "}", errors)
    out.append(f"CORE_RADIUS_UM = {geometry['core_radius_um']}")
    for kind in ("electrodes", "excitation"):
        name = kind.upper().removesuffix("S")
        rows = geometry[kind]
        out.append(f"{name}_NAMES = ({', '.join(repr(r[0]) for r in rows)})".replace("'", '"'))
        out += table(f"{name}_UM: tuple[tuple[int, int, int], ...]", "(", ")", (triple(r[1:4]) for r in rows))
        normals = (triple(r[4:7]) for r in rows)
        out += table(f"{name}_NORMAL_MILLI: tuple[tuple[int, int, int], ...]", "(", ")", normals)
    for key, value in s["conversion"].items():
        out.append(f"{key.upper()} = {value}")
    return "\n".join(out) + "\n"


def wrench_map(contract: Contract) -> str:
    wrench = contract.map
    out = [
        f'"""{GENERATED}',
        "",
        "The wrench map on the board: kinds and gates of its blocks, formats of its numbers (SPEC.md, Wrench maps).",
        '"""',
        "",
        "from enum import IntEnum",
        "from typing import Literal, NamedTuple",
        "",
        *(f"AXES_{name} = {count}" for name, count in wrench["axes"].items()),
        f"EXPONENTS = {EXPONENTS}",
        f"HEADER_BYTES = {HEADER_BYTES}",
        f"BLOCK_BYTES = {BLOCK_BYTES}",
        f"GATE_MAX = {gate_max(contract)}",
    ]
    for name in ("blob", "centroid", "conductance", "fixed"):
        out += [f"{key.upper()} = {value}" for key, value in wrench[name].items()]
    for table_name, title in (("kind", "A block's columns."), ("gate", "What a block's columns are multiplied by.")):
        out += ["", "", f"class {table_name.capitalize()}(IntEnum):", f'    """{title}"""', ""]
        out += [f"    {name} = {entry['value']}  # {entry['doc']}" for name, entry in wrench[table_name].items()]
    out += ["", "", "class KindSpec(NamedTuple):", '    """How many columns, in what shape, of what."""', ""]
    out += [
        "    columns: int",
        "    halves: int  # an axis's coefficients in the blob",
        '    shape: Literal["one", "electrodes", "pairs"]',
    ]
    out += ['    of: Literal["one", "signal", "conductance", "pressure"]', "", "", "KINDS: dict[Kind, KindSpec] = {"]
    for name, kind in wrench["kind"].items():
        spec = f'{columns(contract, kind)}, {halves(contract, kind)}, "{kind["columns"]}", "{kind["of"]}"'
        out.append(f"    Kind.{name}: KindSpec({spec}),")
    return "\n".join([*out, "}"]) + "\n"


def triple(values: list[int]) -> str:
    return f"({', '.join(map(str, values))}),"


def table(name: str, opening: str, closing: str, rows: Any) -> list[str]:
    return [f"{name} = {opening}", *(f"    {row}" for row in rows), closing, ""]


def wire(contract: Contract) -> str:
    link = contract.link
    out = [
        f'"""{GENERATED}',
        "",
        "Messages of the USB link: enums, flags, and one dataclass per message; the array types are in dtypes_gen.py.",
        "Units and Q formats are in protocol/MESSAGES.md.",
        '"""',
        "",
        "from __future__ import annotations",
        "",
        "import struct",
        "from dataclasses import dataclass",
        "from enum import IntEnum",
        "from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple",
        "",
        "from ..renamed import old_names",
        "from .named import NamedFlag",
        "",
        f"WIRE_MAJOR = {link['wire']['major']}",
        f"WIRE_MINOR = {link['wire']['minor']}",
        f"SCHEMA_HASH = 0x{contract.hash:08X}",
        f"MAX_FRAME_BYTES = {link['wire']['max_frame_bytes']}",
        f"INVALID_COUNT = 0x{link['wire']['invalid_count']:04X}",
        f"BOOTLOADER_MAGIC = 0x{link['wire']['bootloader_magic']:08X}",
        f"RESTART_MAGIC = 0x{link['wire']['restart_magic']:08X}",
        *(f"USB_{name.upper()} = 0x{value:04X}" for name, value in link["usb"].items()),
        "INVALID_I16 = -(2**15)",
        "INVALID_I32 = -(2**31)",
        "",
    ]
    for name, enum in link["enum"].items():
        out += enum_class(class_name(name), "IntEnum", enum, "value", "{}")
    for name, flags in link["flags"].items():
        out += enum_class(camel(name) + "Flags", "NamedFlag", flags, "bit", "1 << {}")
    # The meaning of each value, in the contract's words, for showing it to people.
    for name, enum in link["enum"].items():
        out += doc_table(f"{name.upper()}_DOC", ((e["value"], e) for e in entries(enum).values()))
    for name, flags in link["flags"].items():
        out += doc_table(f"{name.upper()}_FLAG_DOC", ((1 << e["bit"], e) for e in entries(flags).values()))
    masks = flag_masks(link)
    out += ["", "# Flags that STATUS keeps until CLEAR_FAULTS, and those that hold trust down to a level."]
    out += [f"LATCHED_FLAGS = FrameFlags(0x{masks.pop('LATCHED'):08X})"]
    levels = (f"Trust.{name}: FrameFlags(0x{mask:08X})," for name, mask in masks.items())
    out += table("TRUST_FLAGS: dict[Trust, FrameFlags]", "{", "}", levels)
    out += ["", "class Setting(IntEnum):", '    """Ids of the settings; see SETTINGS for units and ranges."""', ""]
    out += [f"    {name.upper()} = {s['id']}" for name, s in link["setting"].items()]
    out += ["", "", "class SettingSpec(NamedTuple):", '    """Unit, range and default of one setting."""', ""]
    out += ["    unit: str", "    low: int", "    high: int", "    default: int", "    doc: str", "", ""]
    out += ["SETTINGS: dict[Setting, SettingSpec] = {"]
    for name, s in link["setting"].items():
        low, high = s["range"]
        out += [
            f"    Setting.{name.upper()}: SettingSpec(",
            f'        "{s["unit"]}", {low}, {high}, {s["default"]},',
        ]
        out += [f'        "{s["doc"]}",', "    ),"]
    out += ["}", "", "# What each value of a calibration stands for."]
    out += ["CALIBRATION_SETTINGS: tuple[Setting, ...] = ("]
    out += [f"    Setting.{name.upper()}," for name in contract.per_finger] + [")", ""]
    for message in contract.messages:
        out += message_class(message)
    names = [class_name(m.name) for m in contract.messages]
    out += ["", f"Message = {' | '.join(names)}", "", "MESSAGES: dict[int, type[Any]] = {"]
    out += [f"    {name}.ID: {name}," for name in names] + ["}", ""]
    class_of = {message.name: class_name(message.name) for message in contract.messages}
    out += ["# What each command is answered by.", "ANSWERS: dict[type[Any], type[Any]] = {"]
    out += [f"    {class_name(m.name)}: {class_of[m.reply]}," for m in contract.messages if m.reply] + ["}", ""]
    out += ["# The streams that carry a message; not of answers.", "STREAMS_OF: dict[type[Any], StreamFlags] = {"]
    for m in contract.messages:
        if m.streams:
            out.append(f"    {class_name(m.name)}: {' | '.join(f'StreamFlags.{stream}' for stream in m.streams)},")
    out += ["}", "", "# What each round of a touched finger consists of, as far as it is streamed."]
    out += [f"EVERY_ROUND = ({', '.join(class_name(m.name) for m in contract.messages if m.every_round)})", ""]
    out += ["if not TYPE_CHECKING:", f"    __getattr__ = old_names(__name__, {OLD_NAMES})"]
    return "\n".join(out).rstrip() + "\n"


def dtypes(contract: Contract) -> str:
    """The array types, apart from the messages, because only these need NumPy."""
    out = [
        f'"""{GENERATED}',
        "",
        "One array type per message id, for decoding many payloads at once.",
        '"""',
        "",
        "from __future__ import annotations",
        "",
        "from typing import Any",
        "",
        "import numpy as np",
        "",
        "from . import messages_gen as wire",
        "",
        "DTYPES: dict[int, np.dtype[Any]] = {",
    ]
    for message in contract.messages:
        out += [f"    wire.{class_name(message.name)}.ID: np.dtype(", "        ["]
        out += [f"            {dtype_entry(f)}," for f in message.fields] + ["        ]", "    ),"]
    return "\n".join([*out, "}"]) + "\n"


def camel(name: str) -> str:
    return "".join(part.capitalize() for part in name.lower().split("_"))


def class_name(name: str) -> str:
    """The class of a message or an enum."""
    return CLASS_NAMES.get(name, camel(name))


def enum_class(name: str, base: str, enum: dict[str, Any], key: str, form: str) -> list[str]:
    members = [f"    {member} = {form.format(e[key])}  # {e['doc']}" for member, e in entries(enum).items()]
    return ["", f"class {name}({base}):", f'    """{enum["doc"]}"""', "", *members, ""]


def doc_table(name: str, rows: Iterable[tuple[int, dict[str, Any]]]) -> list[str]:
    return ["", f"{name}: dict[int, str] = {{", *(f'    {value}: "{e["doc"]}",' for value, e in rows), "}", ""]


def dtype_entry(field: Field) -> str:
    shape = f", ({field.count},)" if field.count > 1 else ""
    return f'("{field.name}", "{NUMPY_CODE[field.type]}"{shape})'


def message_class(message: Message) -> list[str]:
    codes = "".join(f"{f.count if f.count > 1 else ''}{STRUCT_CODE[f.type]}" for f in message.fields)
    name = class_name(message.name)
    out = ["", "@dataclass(frozen=True, slots=True)", f"class {name}:", f'    """{message.doc}"""', ""]
    for field in message.fields:
        out.append(f"    {field.name}: {'tuple[int, ...]' if field.count > 1 else 'int'}")
    out += ["", f"    ID: ClassVar[int] = 0x{message.id:02X}"]
    out += [f'    STRUCT: ClassVar[struct.Struct] = struct.Struct("<{codes}")', ""]
    args = [f"*self.{f.name}" if f.count > 1 else f"self.{f.name}" for f in message.fields]
    out += ["    def pack(self) -> bytes:", f'        """Payload without id and CRC, {message.payload_bytes} bytes."""']
    out += ["        return self.STRUCT.pack(", *(f"            {arg}," for arg in args), "        )", ""]
    out += ["    @classmethod", f"    def unpack(cls, payload: bytes) -> {name}:"]
    out += ['        """Inverse of pack; struct.error when the length differs."""']
    out += ["        v = cls.STRUCT.unpack(payload)", "        return cls("]
    at = 0
    for field in message.fields:
        value = f"v[{at} : {at + field.count}]" if field.count > 1 else f"v[{at}]"
        out.append(f"            {value},")
        at += field.count
    return [*out, "        )", ""]
