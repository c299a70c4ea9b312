"""Descriptions of boards and sensors, and their settings, as text."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from . import messages_gen as wire
from . import sensor_gen as sensor

SENSOR_SERIAL_BYTES = 16

# A Pico's serial number has 8 bytes; HELLO has room for 12, padded with zeros.
SERIAL_BYTES = 8


def board_text(board: int) -> str:
    """The name of a board's id, or the number if this library does not know it."""
    return wire.BoardKind(board).name if board in list(wire.BoardKind) else f"board {board}"


def board_name(hello: wire.Hello) -> str:
    """The board's name for people: its own, also where this library does not know it."""
    return ascii_text(hello.board_name) or board_text(hello.board)


def maps_text(hello: wire.Hello) -> str:
    """Whether the board stores wrench maps."""
    return f"wrench maps of up to {hello.map_bytes} bytes" if hello.map_bytes else "no wrench maps"


def command_name(message_id: int) -> str:
    """A command's name, or the number if this library does not know it."""
    known = wire.MESSAGES.get(message_id)
    return known.__name__ if known is not None else f"command 0x{message_id:02X}"


def setting_text(setting: wire.Setting, value: int) -> str:
    """A setting as "name = value unit", or "name = NAME (number)" if its values have names."""
    unit = wire.SETTINGS[setting].unit
    kind, _, name = unit.partition(" ")
    shown = f"{value} {unit}"
    if kind == "enum":
        names: Any = getattr(wire, name.title().replace("_", ""))
        shown = f"{names(value).name} ({value})" if value in list(names) else str(value)
    return f"{setting.name.lower()} = {shown}"


def version_text(hello: wire.Hello) -> str:
    """The firmware's release."""
    return f"{hello.firmware_major}.{hello.firmware_minor}.{hello.firmware_patch}"


def serial_text(hello: wire.Hello) -> str:
    """The board's serial number as USB reports it: as text if it is text, else in hex."""
    raw = bytes(hello.board_serial)
    text = raw.rstrip(b"\0")
    if text and all(0x20 <= b < 0x7F for b in text):
        return text.decode()
    return raw[: max(len(text), SERIAL_BYTES)].hex().upper()


def ascii_text(values: Iterable[int]) -> str:
    """A sensor's zero-padded ASCII, such as the serial number; U+FFFD for anything but printable ASCII."""
    text = bytes(values).rstrip(b"\0").decode("ascii", errors="replace")
    return "".join(c if c.isprintable() else "\ufffd" for c in text)


def is_foreign(serial: Iterable[int]) -> bool:
    """Whether a sensor's serial number is of one with other electrodes (BioTac SP): no point or force follows."""
    return bytes(serial).startswith(sensor.FOREIGN_SERIALS)


def columns_text(columns: int) -> str:
    """A hint for the refusal of an array with so many columns for electrodes; empty unless a BioTac SP's."""
    if columns != sensor.FOREIGN_ELECTRODES:
        return ""
    return (
        f"; {columns} columns are a BioTac SP's, whose electrodes lie elsewhere: cutting them to 19 does not make it a "
        "BioTac"
    )
