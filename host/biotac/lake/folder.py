"""A lake's folder layout: where files are, and which ones do not belong there."""

from __future__ import annotations

import contextlib
import os
import re
import shutil
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from ..errors import InputError

#: The topic with one row per recording; its file seals the recording's other files.
RECORDINGS = "recordings"
#: Folder of incomplete files. Readers skip names that begin with a dot.
PARTIAL = ".partial"
LOCK = ".lock"
#: Inventory of boards and sensors, in the lake's top folder; rewritten by each `biotac inventory`.
INVENTORY = "inventory.json"
_PLACE = re.compile(r"([a-z][a-z0-9_]*)/(board=[^/]+/date=\d{4}-\d\d-\d\d)/([0-9a-f]{16})\.parquet")


@dataclass
class Lake:
    """The contents of ``folder`` now: partitions by recording, and recordings by topic."""

    folder: Path
    partition: dict[str, str] = field(default_factory=dict)
    topics: dict[str, set[str]] = field(default_factory=dict)  # recordings by topic
    unfinished: int = 0  # files of recordings whose export did not finish

    def path(self, topic: str, recording: str) -> Path:
        """The file of a topic for a recording that is in the lake."""
        return place(self.folder, topic, self.partition[recording], recording)

    def paths(self, topic: str) -> list[Path]:
        """All files of a topic, sorted by recording id."""
        return [self.path(topic, recording) for recording in sorted(self.topics.get(topic, ()))]


def place(folder: Path, topic: str, partition: str, recording: str) -> Path:
    """Path of one file."""
    return folder / topic / partition / f"{recording}.parquet"


def opened(folder: Path, *, create: bool = False) -> Lake:
    """The lake in ``folder``. Raises InputError if it is not a lake, or holds files that no export wrote."""
    if create:
        with contextlib.suppress(FileExistsError):
            folder.mkdir(parents=True)
    if not folder.is_dir() or not (create or (folder / RECORDINGS).is_dir()):
        raise InputError(f"{folder} is not a lake; create one with `biotac export RECS... --lake {folder}`")
    lake = Lake(folder)
    found: list[tuple[str, str, str]] = []
    foreign: list[str] = []
    for file in _files(folder):
        match = _PLACE.fullmatch(file)
        if match:
            found.append((match[1], match[2], match[3]))
        elif file != INVENTORY:
            foreign.append(file)
    if foreign:
        more = f" and {len(foreign) - 1} more" if foreign[1:] else ""
        raise InputError(
            f"no part of the lake: {folder / min(foreign)}{more}; expected only TOPIC/board=.../date=.../ID.parquet: "
            "move the rest elsewhere"
        )
    for topic, partition, recording in found:
        if topic == RECORDINGS:
            if recording in lake.partition:
                raise InputError(
                    f"{folder} holds recording {recording} in {lake.partition[recording]} and in {partition}; "
                    "expected one: remove the copy"
                )
            lake.partition[recording] = partition
    for topic, partition, recording in found:
        if lake.partition.get(recording) == partition:
            lake.topics.setdefault(topic, set()).add(recording)
        else:
            lake.unfinished += 1
    return lake


def _files(folder: Path) -> Iterator[str]:
    """All files below ``folder``, as relative POSIX paths; skips names that begin with a dot."""
    for at, folders, files in os.walk(folder):
        folders[:] = [name for name in folders if not name.startswith(".")]
        where = Path(at).relative_to(folder).as_posix()
        for name in files:
            if not name.startswith("."):
                yield name if where == "." else f"{where}/{name}"


@contextlib.contextmanager
def sole_writer(folder: Path) -> Iterator[None]:
    """Lock the lake while an export writes, and remove what a killed one left half-written.

    Raises InputError when another export is writing. Nothing is locked on systems without flock.
    """
    try:
        import fcntl
    except ImportError:
        fcntl = None  # type: ignore[assignment]
    with (folder / LOCK).open("w") as lock:
        try:
            if fcntl is not None:
                fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise InputError(f"another export is writing to {folder}; wait until it ends") from error
        shutil.rmtree(folder / PARTIAL, ignore_errors=True)
        try:
            yield
        finally:
            shutil.rmtree(folder / PARTIAL, ignore_errors=True)
