"""Writing a recording into a lake: first its topics' files, then the file that seals them."""

from __future__ import annotations

import hashlib
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.parquet as pq

from ..errors import InputError
from ..export.columns import EXPORTED, HEARTBEATS, Table, tables
from ..export.messages import message_tables
from ..export.parquet import Label, frame_ids, write_labelled
from ..recording import Recording
from ..recording.layout import CHECKSUM
from . import ids
from .folder import PARTIAL, RECORDINGS, place

SIZE = b"biotac.size_bytes"  # of the source: a recording that has grown is exported again
DIGEST = b"biotac.sha256"  # of the seal itself; those of the other files are in the seal
NO_DIGEST = b"0" * 64

_SEAL = pa.schema(
    [
        pa.field("recording", pa.string(), metadata={"what": "id, the name of its files"}),
        pa.field("source", pa.string(), metadata={"what": "name of the file it was exported from"}),
        pa.field("begin_ns", pa.int64(), metadata={"unit": "ns", "what": "when it began, Unix time"}),
        pa.field("duration_s", pa.float64(), metadata={"unit": "s", "what": "by the board's clock"}),
        pa.field("size_bytes", pa.int64(), metadata={"unit": "B", "what": "of the source"}),
        pa.field("frames_lost", pa.int64(), metadata={"unit": "1", "what": "by the sequence numbers"}),
        pa.field("pac_lost", pa.int64(), metadata={"unit": "1", "what": "by the sequence numbers"}),
        pa.field(
            "problems", pa.list_(pa.string()), metadata={"what": "what is missing from the source or damaged in it"}
        ),
        pa.field("sensors", pa.map_(pa.uint8(), pa.string()), metadata={"what": "serial numbers by finger"}),
        pa.field("calibrations", pa.map_(pa.uint8(), pa.string()), metadata={"what": "ids by finger"}),
        pa.field(
            "metadata", pa.map_(pa.string(), pa.string()), metadata={"what": "as described in host/docs/recording.md"}
        ),
        pa.field(
            "files",
            pa.list_(
                pa.struct(
                    [("topic", pa.string()), ("rows", pa.int64()), ("bytes", pa.int64()), ("sha256", pa.string())]
                )
            ),
            metadata={"what": "the recording's other files"},
        ),
    ]
)


@dataclass(frozen=True)
class Written:
    """Result of ``put``. ``rows`` by topic; ``new`` is False if it was in the lake before this export."""

    recording: str
    new: bool
    rows: dict[str, int]


def put(lake: str, known: dict[str, str], force: bool, source: str) -> Written:
    """Write the recording ``source`` into ``lake``, unless it is there already from a file of at least the same size.

    ``known`` are partitions by recording. The same recording and version give the same bytes on any machine. Raises
    RecordingError or InputError if ``source`` cannot be read or ``lake`` not written; the recording is then not sealed.
    """
    folder, path = Path(lake), Path(source)
    name = ids.recording_id(path)
    size = path.stat().st_size
    if name in known and not force and _sealed(folder, known[name], name) >= size:
        return Written(name, False, {})
    recording = Recording(path)
    partition = ids.partition(recording)
    if name not in known and _sealed(folder, partition, name) >= size:  # written meanwhile from a copy of it
        return Written(name, True, {})
    topics: dict[str, list[Table]] = {}
    for table in [*tables(recording, {**EXPORTED, **HEARTBEATS}), *message_tables(recording)]:
        topics.setdefault(table.kind, []).append(table)
    if not topics:
        raise InputError(f"{path} holds no frames, PAC or other messages; there is nothing to export")
    try:
        partial = folder / PARTIAL
        partial.mkdir(exist_ok=True)
        with tempfile.TemporaryDirectory(prefix=f"{name}.", dir=partial) as stage:
            files = [_write(Path(stage), topic, made, recording, name) for topic, made in sorted(topics.items())]
            _seal(Path(stage) / RECORDINGS, recording, name, size, files)
            # An old seal goes first and the new one comes last: what is sealed is complete, and of one export.
            place(folder, RECORDINGS, partition, name).unlink(missing_ok=True)
            for topic in [*sorted(topics), RECORDINGS]:
                target = place(folder, topic, partition, name)
                target.parent.mkdir(parents=True, exist_ok=True)
                os.replace(Path(stage) / topic, target)
    except OSError as error:
        raise InputError(
            f"{folder} cannot be written ({error.strerror or error}); fix that and run the export again"
        ) from error
    return Written(name, True, {its["topic"]: its["rows"] for its in files})


def _sealed(folder: Path, partition: str, name: str) -> int:
    """Size in bytes of the source of the recording in the lake; -1 if it is not there."""
    try:
        facts = pq.read_metadata(place(folder, RECORDINGS, partition, name)).metadata or {}
        return int(facts.get(SIZE, 0))
    except (OSError, ValueError, pa.ArrowException):
        return -1


def _write(stage: Path, topic: str, made: list[Table], recording: Recording, name: str) -> dict[str, Any]:
    sensors, calibrations = ids.sensors(recording), ids.calibrations(recording)
    fingers = [table.finger for table in made if table.finger is not None]
    labels = [Label("recording", "id of the recording", (name,) * len(made))]
    if len(fingers) == len(made):
        labels += [
            frame_ids(made),
            Label("sensor", "serial number, null where unknown", tuple(map(sensors.get, fingers))),
            Label(
                "calibration",
                "id of the calibration and map in force, null if none",
                tuple(map(calibrations.get, fingers)),
            ),
        ]
    write_labelled(stage / topic, made, labels, {"biotac.recording": name})
    data = (stage / topic).read_bytes()
    rows = sum(len(table) for table in made)
    return {"topic": topic, "rows": rows, "bytes": len(data), "sha256": hashlib.sha256(data).hexdigest()}


def _seal(place: Path, recording: Recording, name: str, size: int, files: list[dict[str, Any]]) -> None:
    row = {
        "recording": name,
        "source": recording.path.name,
        "begin_ns": recording.begin_ns,
        "duration_s": (recording.end_us - recording.begin_us) / 1e6,
        "size_bytes": size,
        "frames_lost": recording.frames_lost,
        "pac_lost": recording.pac_lost,
        "problems": [text.replace(str(recording.path), recording.path.name) for text in recording.problems],
        "sensors": list(ids.sensors(recording).items()),
        "calibrations": list(ids.calibrations(recording).items()),
        "metadata": sorted((key, its) for key, its in recording.metadata.items() if key != CHECKSUM),
        "files": files,
    }
    schema = _SEAL.with_metadata({SIZE: str(size).encode()})
    with pq.ParquetWriter(place, schema, compression="zstd") as writer:
        writer.write_table(pa.Table.from_pylist([row], schema=schema))
        writer.add_key_value_metadata({DIGEST: NO_DIGEST})
    data = place.read_bytes()
    place.write_bytes(data.replace(NO_DIGEST, digest_of(data, NO_DIGEST)))


def digest_of(data: bytes, its: bytes) -> bytes:
    """SHA-256 of a seal's bytes with its digest ``its`` replaced by NO_DIGEST: Parquet's footer has no checksum."""
    return hashlib.sha256(data.replace(its, NO_DIGEST)).hexdigest().encode()
