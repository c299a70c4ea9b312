"""Starting boards that are processes, by their names."""

from __future__ import annotations

from typing import Any

from biotac.sim.source import Source

from .emulated import EmulatedBoard
from .process import CommandBoard, ProcessBoard

COMMAND = "command"  # what BIOTAC_SIM says


def start_board(board: str, source: Source, *, image: Any = None, verbs: Any = (), **how: Any) -> ProcessBoard:
    """Start an emulated ``pico`` or ``pico2``, or COMMAND. Raises PortError naming what is missing."""
    if board == COMMAND:
        return CommandBoard(source, **how)
    return EmulatedBoard(board, source, image=image, verbs=verbs, **how)
