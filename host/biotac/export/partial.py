"""Files that are whole or not there."""

from __future__ import annotations

import contextlib
import os
import shutil
from collections.abc import Iterator
from pathlib import Path

from ..errors import InputError


@contextlib.contextmanager
def whole(path: Path, *, overwrite: bool) -> Iterator[Path]:
    """Give a place beside ``path`` to write to, file or folder; it becomes ``path`` when all went well.

    Otherwise it is removed, and what was at ``path`` before is untouched. A KeyboardInterrupt goes on with
    words that say so. Raises InputError when ``path`` exists and may not be overwritten.
    """
    if path.exists() and not overwrite:
        raise InputError(f"{path} exists and would be overwritten; choose another name or say --force")
    place = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        yield place
        if path.is_dir():
            shutil.rmtree(path)  # a bag that --force replaces; a file cannot take its name
        os.replace(place, path)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{path} was not written, what there was of it is removed") from None
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error}); choose another place") from error
    finally:
        _remove(place)


def _remove(place: Path) -> None:
    if place.is_dir():
        shutil.rmtree(place, ignore_errors=True)
    else:
        with contextlib.suppress(FileNotFoundError):
            place.unlink()
