"""The drive that an RP2040's or RP2350's loader presents: a file written to it goes into the flash, block by block."""

from __future__ import annotations

import glob
import os
import re
import string
import sys
from pathlib import Path

from ..errors import FlashError
from .families import FAMILIES, Family
from .image import Image
from .interfaces import Loader, Show

DISKS = Path("/dev/disk/by-label")  # on Linux, of an attached drive, mounted or not
INFO = "INFO_UF2.TXT"
FILE = "BIOTAC.UF2"


class DriveLoader(Loader):
    name = "drive"

    def drives(self) -> list[tuple[Path, Family]]:
        return [(folder, family) for folder in mounted_folders() for family in FAMILIES if is_loader(folder, family)]

    def ready(self) -> bool:
        drives = self.drives()
        if len(drives) > 1:
            raise FlashError(
                f"{len(drives)} boards are in their loader ({', '.join(str(folder) for folder, _ in drives)}); unplug "
                "all but one"
            )
        if drives:
            self.name = f"drive {drives[0][1].drive}"
        return len(drives) == 1

    def family(self) -> Family | None:
        return self.drives()[0][1] if self.ready() else None

    def cure(self) -> str:
        there = next((DISKS / family.drive for family in FAMILIES if (DISKS / family.drive).exists()), None)
        if there is None:
            names = " or ".join(family.drive for family in FAMILIES)
            return f"no drive {names} found: plug the board in with BOOTSEL held, or check the cable"
        return f"the drive {there.name} is there but not mounted: `udisksctl mount -b {there}`, or mount it by hand"

    def write(self, image: Image, show: Show) -> None:
        folder, family = self.drives()[0]
        refuse_another_chips(image, family)
        path = folder / FILE
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


def refuse_another_chips(image: Image, family: Family) -> None:
    """Raise FlashError for an image with a family that makes the boot ROM skip every block silently."""
    if image.family is not family:
        raise FlashError(
            f"{image.path} is for a {image.family.board} ({image.family.chip}), and a {family.board} (drive "
            f"{family.drive}) is in its loader: use that board's image"
        )


def is_loader(folder: Path, family: Family) -> bool:
    """True if a file on the drive says that it belongs to the loader of such a chip."""
    said = f"Board-ID: {family.drive}"
    try:
        return said in (folder / INFO).read_text(encoding="ascii", errors="replace").splitlines()
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
        if device.startswith("/dev/"):  # a space in the folder is \040
            folders.append(Path(re.sub(r"\\([0-7]{3})", lambda code: chr(int(code[1], 8)), mounted_at)))
    return list(dict.fromkeys(folder.resolve() for folder in folders))
