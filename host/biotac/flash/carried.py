"""The image that is flashed by default: the package's own, included in released wheels."""

from __future__ import annotations

from pathlib import Path

from ..errors import InputError

CARRIED = Path(__file__).with_name("biotac-pico.uf2")  # host/CMakeLists.txt puts it there
BUILT = Path("build/pico/biotac-pico.uf2")  # of a clone


def find_image() -> Path:
    """The image included in this package or, if there is none, the one built in the clone around the working directory.

    Raises InputError when there is neither.
    """
    if CARRIED.is_file():
        return CARRIED
    for folder in (Path.cwd(), *Path.cwd().parents):
        if (folder / BUILT).is_file():
            return folder / BUILT
    raise InputError(
        f"this biotac-gateway was built without a board image, and no {BUILT} is in this folder or above; install a "
        "released wheel, or name an IMAGE, a .uf2 file (to build one, see firmware/boards/pico)"
    )
