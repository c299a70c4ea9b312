"""The loader of an emulated board: this project's model of the real one (tools/emulator/loader.mjs)."""

from __future__ import annotations

import tempfile
from pathlib import Path

from ..sim.emulated import EmulatedBoard
from .image import Image
from .interfaces import Loader, Show

WRITE_S = 5.0  # of emulated time; an image of 48 KiB takes 0.7 s


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
            self._board.say(f"write uf2 {path}")
            self._board.until(WRITE_S, images=before + 1)
        show(len(image.blocks), len(image.blocks))
