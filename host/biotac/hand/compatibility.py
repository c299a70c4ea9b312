"""Whether a board's firmware and this library fit together, and the command that makes them fit."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import WireVersionError
from ..wire import messages_gen as wire

# The wire minor since which boards have each feature.
CALIBRATION_SINCE_MINOR = 0
MAP_SINCE_MINOR = 0
PRESSURE_SINCE_MINOR = 0
HOLD_SINCE_MINOR = 0
FAULTS_SINCE_MINOR = 0
EVENTS_SINCE_MINOR = 0
BANDS_SINCE_MINOR = 0


@dataclass(frozen=True)
class HandWarning:
    """Something about a board that keeps it from working as well as it could."""

    code: str
    text: str  # one line with the cure


def warnings(hello: wire.Hello, port: str) -> list[HandWarning]:
    """Where this board's firmware and this library do not fit together; empty when they fit."""
    if hello.schema_hash == wire.SCHEMA_HASH:
        return []
    text = f"the firmware on {port} has schema {hello.schema_hash:08x}, this library {wire.SCHEMA_HASH:08x}"
    return [HandWarning("schema_differs", f"{text}; what only one side knows is ignored; {cure(hello)}")]


def describe_mismatch(hello: wire.Hello) -> str:
    """Both wire versions, and the command that makes them the same."""
    mine = f"{wire.WIRE_MAJOR}.{wire.WIRE_MINOR}"
    return f"wire {hello.wire_major}.{hello.wire_minor}, this library {mine}; {cure(hello)}"


def need(hello: wire.Hello, since_minor: int, what: str) -> None:
    """Raise WireVersionError for a board whose wire minor is older than the one that introduced ``what``."""
    if hello.wire_minor < since_minor:
        seen = f"the board speaks wire {hello.wire_major}.{hello.wire_minor}"
        raise WireVersionError(f"{seen}, expected at least 1.{since_minor}, which has {what}; {cure(hello)}")


def cure(hello: wire.Hello) -> str:
    """The command that updates the older side; the firmware if both have the same wire version."""
    if (hello.wire_major, hello.wire_minor) > (wire.WIRE_MAJOR, wire.WIRE_MINOR):
        return "update this library: pip install -U biotac-gateway"
    return "update the firmware: biotac flash"
