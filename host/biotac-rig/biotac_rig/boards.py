"""Starting boards that are processes, by name."""

from __future__ import annotations

from typing import Any

from biotac.sim.source import Source

from .emulated import EmulatedBoard
from .process import CommandBoard, ProcessBoard

COMMAND = "command"  # the command in BIOTAC_SIM


def start_board(board: str, source: Source, *, image: Any = None, verbs: Any = (), **how: Any) -> ProcessBoard:
    """Start an emulated ``pico`` or ``pico2``, or COMMAND. Raises PortError that names the missing part."""
    if board == COMMAND:
        return CommandBoard(source, **how)
    return EmulatedBoard(board, source, image=image, verbs=verbs, **how)
