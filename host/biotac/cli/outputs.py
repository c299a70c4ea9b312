"""Checks where a verb's results go, before minutes of work and not after."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ..errors import InputError, taken


def check_file(place: Path | None, *, overwrite: bool) -> None:
    """Raises InputError if the file, where one is named, exists and may not be overwritten."""
    if place is not None and place.exists() and not overwrite:
        raise taken(place)


def check(folder: Path, places: Sequence[Path], *, overwrite: bool) -> None:
    """Raises InputError if a place in ``folder`` is named twice, or exists and may not be overwritten."""
    for place in places:
        if places.count(place) > 1:
            raise InputError(
                f"{place} would be written twice; name each finger once, and calibrate files of the same name with "
                "separate --out folders"
            )
        if place.exists() and not overwrite:
            raise taken(place)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder} is not a folder; choose another name")


def make_folder(folder: Path) -> None:
    """Make ``folder`` and its parents. Raises InputError."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder} cannot be created ({error.strerror}); choose another folder") from error
