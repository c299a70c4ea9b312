"""Raspberry Pi's picotool, if installed: it needs no mounted drive, but permission for the USB device."""

from __future__ import annotations

import shutil
import subprocess

from ..errors import FlashError
from .image import Image
from .interfaces import Loader, Show

TOOL = "picotool"
ASK_S = 10
LOAD_S = 120


class PicotoolLoader(Loader):
    """Never ready without picotool on PATH."""

    name = TOOL

    def __init__(self) -> None:
        self._output = ""

    def ready(self) -> bool:
        return shutil.which(TOOL) is not None and self._run("info", seconds=ASK_S)

    def cure(self) -> str:
        if shutil.which(TOOL) is None:
            return "or install picotool, which needs no mounted drive"
        return f"picotool says: {self._output}"

    def write(self, image: Image, show: Show) -> None:
        """Write the image with picotool, which verifies it and starts the board."""
        show(0, len(image.blocks))
        if not self._run("load", "-v", "-x", str(image.path), seconds=LOAD_S):
            raise FlashError(f"picotool did not load {image.path}: {self._output}; plug the board in with BOOTSEL held")
        show(len(image.blocks), len(image.blocks))

    def _run(self, *arguments: str, seconds: float) -> bool:
        try:
            done = subprocess.run(
                [TOOL, *arguments], capture_output=True, text=True, errors="replace", timeout=seconds, check=False
            )
        except (OSError, subprocess.TimeoutExpired) as error:
            self._output = str(error)
            return False
        self._output = " ".join((done.stderr or done.stdout).split()) or f"no output, exit code {done.returncode}"
        return done.returncode == 0
