"""The rig's functions for the gateway's own commands, by the entry point ``biotac.rig``."""

from __future__ import annotations

from biotac.flash.interfaces import Loader, Target
from biotac.sim.ports import open_sim

from .boards import start_board
from .emulated import EmulatedBoard
from .flashing import EmulatedLoader, EmulatedTarget
from .leads import examine_pair
from .live import EmulatedWorld
from .playing import run as play

__all__ = ["EmulatedBoard", "EmulatedWorld", "examine_pair", "flash_target", "open_sim", "play", "start_board"]


def flash_target(port: str) -> tuple[Target, Loader]:
    """An emulated board and the loader, of a PORT ``emu:BOARD?source=SOURCE``."""
    target = EmulatedTarget(port)
    return target, EmulatedLoader(target.board)
