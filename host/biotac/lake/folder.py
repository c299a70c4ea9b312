"""A lake's files, and the list of their checksums: what is not listed is not in the lake."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

from ..errors import InputError
from ..partial_file import whole

#: The topic with one row per recording; its file is written last, so a recording without it is not complete.
RECORDINGS = "recordings"
#: Lines of ``HASH  PATH`` that ``sha256sum -c`` reads; paths are relative to the lake.
SUMS = "SHA256SUMS"
#: Folder of incomplete files. Readers skip names that begin with a dot.
PARTIAL = ".partial"
_LOCK = ".lock"
_DEPTH = 4  # of TOPIC/board=.../date=.../RECORDING.parquet
_FILE = re.compile(r"([a-z][a-z0-9_]*)/board=[^/\n]+/date=\d{4}-\d\d-\d\d/([0-9a-f]{16})\.parquet")
_LINE = re.compile(rf"([0-9a-f]{{64}})  ({_FILE.pattern})")


@dataclass
class Lake:
    """The contents of ``folder``: SHA-256 by path of all files that exports have completed, and files beside those."""

    folder: Path
    sums: dict[str, str]
    unlisted: list[str]

    @property
    def recordings(self) -> dict[str, dict[str, str]]:
        """By recording: its files, as in ``sums``."""
        files: dict[str, dict[str, str]] = {}
        for path, sha256 in sorted(self.sums.items()):
            files.setdefault(Path(path).stem, {})[path] = sha256
        return files

    def topics(self) -> dict[str, list[Path]]:
        """By topic: files of the recordings that are complete. Raises InputError for what is no file, as a FIFO is."""
        found: dict[str, list[Path]] = {}
        for files in self.recordings.values():
            own = {path.partition("/")[0]: self.folder / path for path in files}
            if RECORDINGS in own and own[RECORDINGS].exists():
                for topic, path in own.items():
                    if not path.is_file():
                        raise InputError(
                            f"{path} is missing, or no file; see `biotac lake check`, and export it again with --force"
                        )
                    found.setdefault(topic, []).append(path)
        return found

    def add(self, recording: str, sums: dict[str, str]) -> None:
        """List the files of a recording, in place of those of an earlier export; only within ``writing``."""
        for path in [path for path in self.sums if Path(path).stem == recording]:
            del self.sums[path]
        self.sums |= sums
        with (self.folder / SUMS).open("a", encoding="utf-8") as out:
            out.write(_text(sums))


def opened(folder: Path) -> Lake:
    """The lake in ``folder``. Raises InputError if it is not a lake, or its list of checksums is damaged."""
    if not (folder / SUMS).is_file():
        if (folder / RECORDINGS).is_dir():
            raise InputError(f"{folder} has lost its {SUMS}: nothing in it can be checked; export the recordings again")
        raise InputError(f"{folder} is not a lake; create one with `biotac export RECS... --lake {folder}`")
    sums = {}
    try:
        text = (folder / SUMS).read_text(encoding="utf-8")
    except (OSError, ValueError) as error:
        raise InputError(f"{folder / SUMS} cannot be read ({error}); export the recordings again") from error
    for number, line in enumerate(text.split("\n")[:-1], 1):  # a killed export may leave part of a line
        match = _LINE.fullmatch(line)
        if match is None:
            raise InputError(f"{folder / SUMS} is damaged in line {number}; remove it and export the recordings again")
        sums[match[2]] = match[1]
    unlisted = sorted(path for path in _files(folder) if path not in sums and path != SUMS)
    return Lake(folder, sums, unlisted)


def _files(folder: Path) -> Iterator[str]:
    """All files below ``folder``, as relative POSIX paths; skips names that begin with a dot."""
    for at, folders, files in os.walk(folder, followlinks=True):
        where = Path(at).relative_to(folder)
        folders[:] = [name for name in folders if not name.startswith(".") and len(where.parts) < _DEPTH]
        yield from ((where / name).as_posix() for name in files if not name.startswith("."))


@contextlib.contextmanager
def writing(folder: Path) -> Iterator[Lake]:
    """The lake in ``folder``, made if it is not there; nobody else can write to it meanwhile.

    Removes what a killed export left half-written. Raises InputError when another export is writing, or ``folder``
    holds something else. Nothing is locked on systems without flock.
    """
    try:
        import fcntl
    except ImportError:
        fcntl = None  # type: ignore[assignment]
    with contextlib.suppress(FileExistsError):
        folder.mkdir(parents=True)
    if folder.is_dir() and not (folder / SUMS).exists() and not any(_files(folder)):
        (folder / SUMS).touch()
    lake = opened(folder)
    for path in lake.unlisted:
        if not _FILE.fullmatch(path):
            raise InputError(f"no part of the lake: {folder / path}; move it elsewhere")
    with (folder / _LOCK).open("w") as lock:
        try:
            if fcntl is not None:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(f"another export is writing to {folder}; wait until it ends") from error
        shutil.rmtree(folder / PARTIAL, ignore_errors=True)
        try:
            yield lake
        finally:
            shutil.rmtree(folder / PARTIAL, ignore_errors=True)
            with whole(folder / SUMS, overwrite=True) as partial:
                partial.write_text(_text(lake.sums), encoding="utf-8")


def _text(sums: dict[str, str]) -> str:
    """Lines of ``sums``; those of recordings come last, so that what they stand for is listed before."""
    paths = sorted(sums, key=lambda path: (path.startswith(f"{RECORDINGS}/"), path))
    return "".join(f"{sums[path]}  {path}\n" for path in paths)
