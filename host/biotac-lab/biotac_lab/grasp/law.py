"""The law under test: the example grip.py, or a file like it."""

from __future__ import annotations

import runpy
from functools import cache
from pathlib import Path
from typing import Any

from biotac import InputError

_BESIDE = Path(__file__).with_name("grip.py")  # in a wheel (pyproject.toml)
EXAMPLE = _BESIDE if _BESIDE.exists() else Path(__file__).resolve().parents[3] / "docs/guides/examples/grip.py"


@cache
def load(path: Path) -> dict[str, Any]:
    """What the file defines: a class ``Grip``, and constants. Raises InputError."""
    made = runpy.run_path(str(path)) if path.is_file() else {}
    if "Grip" not in made:
        raise InputError(f"{path} is no file with a class Grip; give one like host/docs/guides/examples/grip.py")
    return made
