"""The law under test: biotac.grip, or a file with one like it."""

from __future__ import annotations

import runpy
from functools import cache
from pathlib import Path
from typing import Any

from biotac import InputError
from biotac.grip import Grip


@cache
def load(path: Path | None) -> dict[str, Any]:
    """The names that the file defines, a class ``Grip`` at least; without a file, biotac.grip's. Raises InputError."""
    if path is None:
        return {"Grip": Grip}
    made = runpy.run_path(str(path)) if path.is_file() else {}
    if "Grip" not in made:
        raise InputError(f"{path} is no file with a class Grip; give one like host/docs/guides/examples/grip_in_c.py")
    return made
