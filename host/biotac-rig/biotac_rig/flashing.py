"""An emulated board and its loader, this project's model of the real one (tools/emulator/loader.mjs).

The process outlives a restart, and the port has the same name.
"""

from __future__ import annotations

import tempfile
from pathlib import Path

from biotac.errors import InputError
from biotac.flash.image import Image
from biotac.flash.interfaces import Loader, Show, Target
from biotac.hand.hand import Hand
from biotac.link.serial_port import SerialLink
from biotac.sim.loading import load_source
from biotac.sim.ports import SIM, parse_sim

from .emulated import EmulatedBoard

BACK_S = 10.0  # of emulated time
WRITE_S = 5.0  # likewise; an image of 48 KiB takes 0.7 s
WORLD_S = 600.0  # the tape must outlast every flashing: time stands still at the end


class EmulatedTarget(Target):
    """The board named by an ``emu:`` PORT, started here."""

    def __init__(self, port: str) -> None:
        self.port = port
        sim = parse_sim(port, 0.0)
        if sim.board == SIM:
            raise InputError(f"{port} has no image to flash; expected a device path or emu:pico?source=SOURCE")
        source = load_source(sim.source, fingers=sim.fingers, seconds=sim.seconds or WORLD_S)
        self.board = EmulatedBoard(sim.board, source, pace=sim.pace, hold=True, image=sim.image)
        self.board.release()

    def port_exists(self) -> bool:
        return bool(self.board.counters()["usb"]["state"] == "configured")

    def open(self) -> Hand:
        return Hand(SerialLink(self.board.path))

    def touch(self) -> None:
        self.board.send_line("touch at 1200 baud")

    def reopen(self) -> Hand:
        self.board.until(BACK_S, loader=None, usb={"state": "configured"})
        return self.open()

    def close(self) -> None:
        self.board.close()


class EmulatedLoader(Loader):
    """Passes files to the emulator instead of writing them to a drive."""

    name = "emulated loader"

    def __init__(self, board: EmulatedBoard) -> None:
        self._board = board

    def ready(self) -> bool:
        return self._board.counters()["loader"] is not None

    def cure(self) -> str:
        return "the emulated board did not enter its loader: check that its image is this gateway's"

    def write(self, image: Image, show: Show) -> None:
        show(0, len(image.blocks))
        before = self._board.counters()["images"]
        with tempfile.TemporaryDirectory(prefix="biotac-flash-") as folder:
            path = Path(folder) / "image.uf2"
            path.write_bytes(b"".join(image.boot_last()))
            self._board.send_line(f"write uf2 {path}")
            self._board.until(WRITE_S, images=before + 1)
        show(len(image.blocks), len(image.blocks))
