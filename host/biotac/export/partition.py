"""Many recordings as Parquet by day and finger, ``DIR/TABLE/date=YYYY-MM-DD/finger=F/RECORDING.parquet``.

Each recording is written for itself, without a list or a lock, so that one process, several, or workers of Dask or
Spark that call ``partition`` make the same bytes.
"""

from __future__ import annotations

import hashlib
import json
import os
from dataclasses import dataclass, replace
from datetime import datetime, timezone
from pathlib import Path
from tempfile import TemporaryDirectory

import pyarrow as pa
import pyarrow.parquet as pq

from ..errors import InputError, RecordingError, printable
from ..keep.calibration_file import to_dict
from ..recording.blocks import BlockReader
from ..recording.labels import beside
from ..recording.layout import CHECKSUM, maps_text
from ..recording.reader import Recording
from ..recording.recorded_board import RecordedBoard
from ..wire.identity import ascii_text, serial_text
from .columns import Table, tables
from .parquet import TextColumn, frame_ids, write_labelled

# In each file's metadata: the size of the source with the labels beside it, and the number of files of the recording.
_SIZE, _FILES = "biotac.source_bytes", "biotac.files"
_LETTERS = 16


@dataclass(frozen=True)
class Written:
    """``rows`` is 0 when the recording was there already, from a file of at least the same size."""

    recording: str
    rows: int = 0


def partition(source: Path | str, folder: Path | str, *, overwrite: bool = False) -> Written:
    """Write the frames and PAC of the recording ``source`` into ``folder``.

    Present files stay, unless ``overwrite`` is set or the source has grown since. A recording is known by the metadata
    and the first second, under any file name. Raises RecordingError or InputError.
    """
    source, folder = Path(source), Path(folder)
    name, day = recording_id(source)
    old = set(folder.glob(f"*/date={day}/finger=*/{name}.parquet"))
    size = source.stat().st_size + (beside(source).stat().st_size if beside(source).exists() else 0)
    if not overwrite and old and all(_is_of(path, size, len(old)) for path in old):
        return Written(name)
    recording = Recording(source)
    made = tables(recording, applied=False)  # known of simulated fingers only: files with other columns than the rest
    if not made:
        raise InputError(f"{source} holds no frames and no PAC; there is nothing to export")
    facts = {f"biotac.{key}": value for key, value in recording.metadata.items() if key != CHECKSUM}
    facts |= {_SIZE: str(size), _FILES: str(len(made))}
    written = {}
    try:
        # Beside the tables' folders, where no reader of one looks.
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(prefix=f".{name}.", suffix=".part", dir=folder) as stage:
            for table in made:
                # The finger is the folder's: a reader would have the column twice.
                bare = replace(table, finger=None, frame=table.frame_id)
                part = Path(stage) / f"{table.kind}.{table.finger}"
                write_labelled(part, [bare], _labels(bare, table.finger or 0, recording, name), facts)
                written[folder / table.kind / f"date={day}" / f"finger={table.finger}" / f"{name}.parquet"] = part
            for path, part in written.items():
                path.parent.mkdir(parents=True, exist_ok=True)
                os.replace(part, path)
    except OSError as error:
        raise InputError(f"{folder} cannot be written ({error.strerror or error}); choose another folder") from error
    for path in old - set(written):  # of an export by another version
        path.unlink(missing_ok=True)
    return Written(name, sum(map(len, made)))


def recording_id(path: Path) -> tuple[str, str]:
    """A recording's id and the day (UTC) on which it began; reads no more of the file than the first second.

    Raises RecordingError if it is not a recording, or holds no data.
    """
    blocks = BlockReader(path, check=False)
    first = next(iter(blocks), None)
    if first is None or blocks.metadata is None:
        Recording(path)  # raises an error that names the fault
        raise RecordingError(f"{path} holds no data; there is nothing to export")
    begin = json.dumps([blocks.metadata, first.arrived_ns], sort_keys=True).encode()
    data = b"".join(bytes([message_id]) + payload for message_id, payload in first.messages())
    try:
        RecordedBoard.read(blocks.metadata)
    except ValueError as error:
        raise RecordingError(f"{path} has damaged metadata ({error}) and cannot be used; try another copy") from error
    day = datetime.fromtimestamp(first.arrived_ns // 10**9, timezone.utc)
    return hashlib.sha256(begin + data).hexdigest()[:_LETTERS], f"{day:%Y-%m-%d}"


def _is_of(path: Path, size: int, files: int) -> bool:
    """Whether the file is one of ``files``, all from a source of at least this size."""
    try:
        with path.open("rb") as file:  # pyarrow takes no path that is not UTF-8
            facts = pq.read_metadata(file).metadata or {}
        return int(facts[_SIZE.encode()]) >= size and int(facts[_FILES.encode()]) == files
    except (OSError, ValueError, KeyError, pa.ArrowException):
        return False


def _labels(table: Table, finger: int, recording: Recording, name: str) -> list[TextColumn]:
    recorded = RecordedBoard.read(recording.metadata)
    board = serial_text(recorded.info) if any(recorded.info.board_serial) else None
    sensor = next((ascii_text(s.serial) for s in recording.sensors if s.present and s.finger == finger), None)
    return [
        TextColumn("recording", "id of the recording, the name of its files", (name,)),
        TextColumn("source", "name of the file that was exported", (printable(recording.path.name),)),
        TextColumn("board", "serial number, null for imported files", (board,)),
        TextColumn("sensor", "serial number, null where unknown", (sensor or None,)),
        TextColumn(
            "calibration", "id of the calibration and map in force, null if none", (_calibration(recorded, finger),)
        ),
        frame_ids([table]),
    ]


def _calibration(recorded: RecordedBoard, finger: int) -> str | None:
    own, fitted = recorded.calibrations.get(finger), recorded.maps.get(finger)
    if own is None and fitted is None:
        return None
    in_force = [own and to_dict(own), maps_text({0: fitted} if fitted is not None else {})]
    return hashlib.sha256(json.dumps(in_force, sort_keys=True).encode()).hexdigest()[:_LETTERS]
