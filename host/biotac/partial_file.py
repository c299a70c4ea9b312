"""Files that are whole or not there."""

from __future__ import annotations

import contextlib
import os
import shutil
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path

from .errors import InputError, exists_error

ROS2_METADATA = "metadata.yaml"


@contextlib.contextmanager
def whole(path: Path, *, overwrite: bool, sources: Iterable[Path] = ()) -> Iterator[Path]:
    """Give a place beside ``path`` to write to, file or folder; it becomes ``path`` when all went well.

    Otherwise it is removed, and ``path`` is untouched. A KeyboardInterrupt goes on with a text that says so. Raises
    InputError when ``path`` exists and may not be overwritten, is neither file nor folder, or is one of ``sources``,
    the files that it is made from.
    """
    refuse_source(path, sources)
    if path.exists() and not path.is_file() and not path.is_dir():
        raise InputError(f"{path} is a pipe or a device, which a file would replace; choose another name")
    if path.exists() and not overwrite:
        raise exists_error(path)
    if path.is_dir() and not (path / ROS2_METADATA).is_file():
        raise InputError(f"{path} is a folder, but not a ROS 2 bag that could be replaced; choose another name")
    try:
        # In a separate folder it has the right name already: a bag's files are called after it.
        folder = Path(tempfile.mkdtemp(prefix=f".{path.name[:50]}.", suffix=".part", dir=path.parent))
        try:
            part = folder / path.name
            yield part
            _replace(part, path)
        finally:
            shutil.rmtree(folder, ignore_errors=True)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(f"{path} was not written; the partial file was removed") from None
    except OSError as error:
        raise InputError(f"{path} cannot be written ({error.strerror or error}); choose another place") from error


def refuse_source(out: Path, sources: Iterable[Path | str]) -> None:
    """Raises InputError if ``out`` is one of those files, by any name: measurements cannot be made again."""
    for path in sources:
        with contextlib.suppress(OSError, ValueError):  # one that is not there
            if os.path.samefile(out, path):
                raise InputError(f"{out} is {path} itself, which would be lost; choose another name")


def _replace(part: Path, path: Path) -> None:
    """os.replace, also where a folder is to go or to come."""
    if path.is_dir():
        shutil.rmtree(path)
    elif part.is_dir():
        path.unlink(missing_ok=True)
    os.replace(part, path)
