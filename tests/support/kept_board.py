"""A simulated board that outlives the process: settings, calibrations and maps are in a file."""

from dataclasses import replace
from pathlib import Path

import biotac
from biotac.sim.board import SimBoard
from biotac.sim.loading import load_source
from biotac.sim.source import Source


def kept_board(source: Source, flash: Path) -> SimBoard:
    """A simulated board with a file as flash; the file outlives the board."""
    return SimBoard(source, pace=0.0, flash=flash)


def boot(flash: Path, serials: list[str] | None = None) -> biotac.Hand:
    """Two fingers, of these serial numbers, on a board with this flash."""
    source = load_source("press.toml", fingers=2, seconds=1)
    board = kept_board(replace(source, serials=serials) if serials else source, flash)
    return biotac.Hand(board.link("sim:flash"))


def serial_of(hand: biotac.Hand, finger: int) -> str:
    """The serial that the board's sensor reports."""
    return bytes(hand.sensor_info(finger).serial).rstrip(b"\0").decode()
