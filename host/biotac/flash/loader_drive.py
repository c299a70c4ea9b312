"""The drive that an RP2040's loader presents: a file written to it goes into the flash, block by block."""

from __future__ import annotations

import glob
import os
import re
import string
import sys
from pathlib import Path

from ..errors import FlashError
from .image import Image
from .interfaces import Loader, Show

LABEL = "RPI-RP2"
OTHER = "RP2350"  # a Pico 2's
DISK = Path("/dev/disk/by-label") / LABEL  # on Linux, of an attached drive, mounted or not
INFO = "INFO_UF2.TXT"
FILE = "BIOTAC.UF2"


class DriveLoader(Loader):
    name = f"drive {LABEL}"

    def drives(self) -> list[Path]:
        return [folder for folder in mounted_folders() if is_loader(folder)]

    def ready(self) -> bool:
        drives = self.drives()
        if len(drives) > 1:
            raise FlashError(
                f"{len(drives)} boards are in their loader ({', '.join(map(str, drives))}); unplug all but one"
            )
        return len(drives) == 1

    def cure(self) -> str:
        if DISK.with_name(OTHER).exists() or any(is_loader(folder, OTHER) for folder in mounted_folders()):
            return (
                f"a Pico 2 (drive {OTHER}) is in its loader, and no image is for it: plug in a Pico with BOOTSEL held"
            )
        if not DISK.exists():
            return f"no drive {LABEL} found: plug the board in with BOOTSEL held, or check the cable"
        return f"the drive {LABEL} is there but not mounted: `udisksctl mount -b {DISK}`, or mount it by hand"

    def write(self, image: Image, show: Show) -> None:
        path = self.drives()[0] / FILE
        *most, last = image.boot_last()
        written = 0
        try:
            # Unbuffered, and synced before the last block: the operating system must not write that one earlier.
            with open(path, "wb", buffering=0) as file:
                for block in most:
                    file.write(block)
                    written += 1
                    show(written, len(image.blocks))
                os.fsync(file.fileno())
                written += 1
                file.write(last)
                os.fsync(file.fileno())
        except OSError as error:
            # The board restarts with the last block, so the drive may be gone before the file is closed.
            if written < len(image.blocks):
                raise FlashError(
                    f"{path} took {written} of {len(image.blocks)} blocks ({error.strerror}); the board stays in its "
                    "loader: plug it in again and flash again"
                ) from error
        show(len(image.blocks), len(image.blocks))


def is_loader(folder: Path, label: str = LABEL) -> bool:
    """True if a file on the drive says that it belongs to the loader of an RP2040, or of the chip of that label."""
    try:
        return f"Board-ID: {label}" in (folder / INFO).read_text(encoding="ascii", errors="replace").splitlines()
    except OSError:
        return False


def mounted_folders() -> list[Path]:
    """Folders where drives may be mounted on this system."""
    if os.name == "nt":
        return [Path(f"{letter}:\\") for letter in string.ascii_uppercase[2:]]
    if sys.platform == "darwin":
        return [Path(found) for found in sorted(glob.glob("/Volumes/*"))]
    return linux_folders(Path("/"))


def linux_folders(root: Path) -> list[Path]:
    """The usual mount points, and all others of devices in /proc/mounts."""
    folders = [found for pattern in ("media/*", "media/*/*", "run/media/*/*") for found in sorted(root.glob(pattern))]
    try:
        mounts = (root / "proc/mounts").read_text(encoding="utf-8", errors="replace").splitlines()
    except OSError:
        mounts = []
    for line in mounts:
        device, mounted_at, *_ = [*line.split(), "", ""]
        if device.startswith("/dev/"):  # a space in its folder is \040
            folders.append(Path(re.sub(r"\\([0-7]{3})", lambda code: chr(int(code[1], 8)), mounted_at)))
    return list(dict.fromkeys(folder.resolve() for folder in folders))
