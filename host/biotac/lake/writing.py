"""Writing a recording into a lake: first its topics' files, then the one in ``recordings``."""

from __future__ import annotations

import hashlib
import io
import os
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

from ..errors import InputError, printable
from ..export.columns import EXPORTED, HEARTBEATS, Table, tables
from ..export.messages import message_tables
from ..export.parquet import Label, frame_ids, write_labelled
from ..recording.labels import beside
from ..recording.layout import CHECKSUM
from ..recording.reader import Recording
from . import ids
from .folder import PARTIAL, RECORDINGS

SIZE = b"biotac.size_bytes"  # of the source and its labels: a recording that has grown is exported again

_TEXT, _BY_FINGER = pa.string(), pa.map_(pa.uint8(), pa.string())
_RECORDINGS = pa.schema(
    [
        pa.field("recording", _TEXT, metadata={"what": "id, the name of its files"}),
        pa.field("source", _TEXT, metadata={"what": "name of the file it was exported from"}),
        pa.field("begin_ns", pa.int64(), metadata={"unit": "ns", "what": "when it began, Unix time"}),
        pa.field("duration_s", pa.float64(), metadata={"unit": "s", "what": "by the board's clock"}),
        pa.field("size_bytes", pa.int64(), metadata={"unit": "B", "what": "of the source and the labels beside it"}),
        pa.field("frames_lost", pa.int64(), metadata={"unit": "1", "what": "by the sequence numbers"}),
        pa.field("pac_lost", pa.int64(), metadata={"unit": "1", "what": "by the sequence numbers"}),
        pa.field("problems", pa.list_(_TEXT), metadata={"what": "what is missing from the source or damaged in it"}),
        pa.field("sensors", _BY_FINGER, metadata={"what": "serial numbers by finger"}),
        pa.field("calibrations", _BY_FINGER, metadata={"what": "ids by finger"}),
        pa.field("metadata", pa.map_(_TEXT, _TEXT), metadata={"what": "as in host/docs/guides/recording.md"}),
    ]
)


@dataclass(frozen=True)
class Written:
    """Result of ``put``. ``new`` is False, and the rest empty, if it was in the lake before this export."""

    recording: str
    path: str  #: of its file in ``recordings``
    new: bool
    rows: int = 0
    sums: dict[str, str] = field(default_factory=dict)  #: SHA-256 of its files by path


def put(lake: str, force: bool, source: str) -> Written:
    """Write the recording ``source`` into ``lake``, unless it is there already from a file of at least the same size.

    The same recording and version give the same bytes on any machine. Raises RecordingError or InputError if
    ``source`` cannot be read or ``lake`` not written.
    """
    folder, path = Path(lake), Path(source)
    name, partition = ids.recording_id(path)
    file = f"{partition}/{name}.parquet"
    size = path.stat().st_size + (beside(path).stat().st_size if beside(path).exists() else 0)
    if not force and _source_bytes(folder / RECORDINGS / file) >= size:
        return Written(name, f"{RECORDINGS}/{file}", False)
    recording = Recording(path)
    if not force and _source_bytes(folder / RECORDINGS / file) >= size:  # written meanwhile from a copy of it
        return Written(name, f"{RECORDINGS}/{file}", False)
    topics: dict[str, list[Table]] = {}
    for table in [*tables(recording, {**EXPORTED, **HEARTBEATS}), *message_tables(recording)]:
        topics.setdefault(table.kind, []).append(table)
    if not topics:
        raise InputError(f"{path} holds no frames, PAC or other messages; there is nothing to export")
    try:
        partial = folder / PARTIAL
        partial.mkdir(exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f"{name}.", dir=partial) as stage:
            for topic, made in topics.items():
                _write(Path(stage) / topic, made, recording, name)
            _write_facts(Path(stage) / RECORDINGS, recording, name, size)
            # The old one goes first and the new one comes last: what has one is complete, and of one export.
            (folder / RECORDINGS / file).unlink(missing_ok=True)
            for old in folder.glob(f"*/{partition}/{name}.parquet"):
                old.unlink(missing_ok=True)
            sums = {}
            for topic in [*sorted(topics), RECORDINGS]:
                target = folder / topic / file
                target.parent.mkdir(parents=True, exist_ok=True)
                sums[f"{topic}/{file}"] = hashlib.sha256((Path(stage) / topic).read_bytes()).hexdigest()
                os.replace(Path(stage) / topic, target)
    except OSError as error:
        raise InputError(
            f"{folder} cannot be written ({error.strerror or error}); fix that and run the export again"
        ) from error
    rows = sum(len(table) for made in topics.values() for table in made)
    return Written(name, f"{RECORDINGS}/{file}", True, rows, sums)


def _source_bytes(file: Path) -> int:
    """Size in bytes of the source of a recording in the lake; -1 if it is not there."""
    if not file.is_file():
        return -1
    try:
        return int((pq.read_metadata(io.BytesIO(file.read_bytes())).metadata or {}).get(SIZE, 0))
    except (OSError, ValueError, pa.ArrowException):
        return -1


def _write(path: Path, made: list[Table], recording: Recording, name: str) -> None:
    sensors, calibrations = ids.sensors(recording), ids.calibrations(recording)
    fingers = [table.finger for table in made if table.finger is not None]
    labels = [Label("recording", "id of the recording", (name,) * len(made))]
    if len(fingers) == len(made):
        of_fingers = tuple(map(calibrations.get, fingers))
        labels += [
            frame_ids(made),
            Label("sensor", "serial number, null where unknown", tuple(map(sensors.get, fingers))),
            Label("calibration", "id of the calibration and map in force, null if none", of_fingers),
        ]
    write_labelled(path, made, labels, {"biotac.recording": name})


def _write_facts(path: Path, recording: Recording, name: str, size: int) -> None:
    source = printable(recording.path.name)
    row = {
        "recording": name,
        "source": source,
        "begin_ns": recording.begin_ns,
        "duration_s": (recording.end_us - recording.begin_us) / 1e6,
        "size_bytes": size,
        "frames_lost": recording.frames_lost,
        "pac_lost": recording.pac_lost,
        "problems": [printable(text.replace(str(recording.path), source)) for text in recording.problems],
        "sensors": list(ids.sensors(recording).items()),
        "calibrations": list(ids.calibrations(recording).items()),
        "metadata": sorted((key, value) for key, value in recording.metadata.items() if key != CHECKSUM),
    }
    schema = _RECORDINGS.with_metadata({SIZE: str(size).encode()})
    with path.open("wb") as file:  # pyarrow takes no path that is not UTF-8
        pq.write_table(pa.Table.from_pylist([row], schema=schema), file, compression="zstd", write_page_checksum=True)
