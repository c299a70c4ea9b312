"""Faults of a board. The board latches them, so that one in a single frame is seen even once a minute."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ..wire import messages_gen as wire


@dataclass(frozen=True)
class Faults:
    """Faults since ``clear_faults``, or the board's start. False when there are none; as text, a line for each."""

    board: wire.FaultFlags
    fingers: Mapping[str, wire.FrameFlags]  #: by name, only fingers that have faults

    by_index: tuple[int, ...]  #: all five fingers, as in STATUS

    def __bool__(self) -> bool:
        return bool(self.board or self.fingers)

    def __str__(self) -> str:
        lines = [f"board: {name}, {text}" for name, text in _named(self.board, wire.FAULT_FLAG_DOC)]
        for finger, flags in self.fingers.items():
            lines += [f"{finger}: {name}, {text}" for name, text in _named(flags, wire.FRAME_FLAG_DOC)]
        return "\n".join(lines)


def faults_of(status: wire.Status, names: Mapping[str, int]) -> Faults:
    """The faults in a STATUS, for fingers with these names; a finger without a name goes by the chip select."""
    name_of = {finger: name for name, finger in names.items()}
    fingers = {name_of.get(f, str(f)): wire.FrameFlags(flags) for f, flags in enumerate(status.finger_faults) if flags}
    return Faults(wire.FaultFlags(status.faults), fingers, status.finger_faults)


def _named(flags: wire.FaultFlags | wire.FrameFlags, doc: Mapping[int, str]) -> list[tuple[str, str]]:
    kind = type(flags)
    return [(str(kind(bit).name), text) for bit, text in doc.items() if flags & bit]
