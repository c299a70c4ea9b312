"""Names that writers and readers of recordings share."""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping
from pathlib import Path

from ..errors import RecordingError

# Additions that an older reader may ignore (topics, metadata keys, columns) do not change it.
FORMAT_VERSION = "3"
PACKETS = "/biotac/packets"  # of one block, as the board sent them (block.py)
APPLIED = "/biotac/applied"  # the forces on simulated fingers, in the order of the block's FRAMEs
HEAD = "/biotac/head"  # describes the block; comes after the other parts, with the same sequence number
ENCODINGS = {PACKETS: "biotac-packets", APPLIED: "biotac-applied", HEAD: "json"}
NAMES = "names"  # metadata key: JSON, fingers by name
CHECKSUM = "crc32"  # metadata key: of all others
WIRE_SCHEMA = "biotac.link"
WIRE_SCHEMA_ENCODING = "biotac-schema"
METADATA_NAME = "biotac"
METADATA_AGAIN = "biotac copy"  # at the end, in case the first one gets damaged; other programs show names once
CUT_FROM = "cut_from"  # metadata key: the file that it is a part of
CONTINUES = "continues"  # metadata key: the file that ended when the board restarted


def check_version(path: Path, metadata: Mapping[str, str]) -> None:
    """Raise RecordingError for a recording that this version cannot read."""
    given = metadata.get("format")
    if given == "2":
        raise RecordingError(
            f"{path} has recording format 2, written by biotac-gateway 0.1.0 at 5d7a8338; check out that commit, "
            "`biotac export` it to CSV or Parquet there, and read that"
        )
    if given != FORMAT_VERSION:
        raise RecordingError(
            f"{path} has recording format {given}, this version reads {FORMAT_VERSION}; read it with the "
            "biotac-gateway that wrote it, or a newer one"
        )


def frame_id(finger: int) -> str:
    """The coordinate frame of a finger's results, in recordings and exports (SPEC.md, Frames of reference)."""
    return f"biotac_finger{finger}"


def maps_text(maps: Mapping[int, bytes]) -> str:
    """Maps by finger as text for the metadata; RecordedBoard.read reads it."""
    return json.dumps({finger: base64.b64encode(blob).decode() for finger, blob in maps.items()})


def names_of(metadata: Mapping[str, str]) -> dict[str, int]:
    """Fingers by name. Raises TypeError or ValueError if the entry is damaged."""
    return {str(name): int(finger) for name, finger in json.loads(metadata.get(NAMES, "{}")).items()}


def finger_of(finger: int | str, names: Mapping[str, int]) -> int:
    """The finger's number, given the number or the name. Raises KeyError for a name that was not recorded."""
    if isinstance(finger, str) and finger not in names:
        raise KeyError(f"no finger {finger!r}: expected one of {', '.join(names) or 'the numbers 0 to 4'}")
    return names[finger] if isinstance(finger, str) else int(finger)


def with_checksum(facts: Mapping[str, str]) -> dict[str, str]:
    return {**facts, CHECKSUM: _checksum(facts)}


def verified(facts: Mapping[str, str]) -> dict[str, str]:
    """Inverse of ``with_checksum``. Raises ValueError when the checksum is wrong or missing."""
    rest = {key: value for key, value in facts.items() if key != CHECKSUM}
    if facts.get(CHECKSUM) != _checksum(rest):
        raise ValueError("wrong checksum")
    return rest


def _checksum(facts: Mapping[str, str]) -> str:
    return f"{zlib.crc32(json.dumps(facts, sort_keys=True).encode()):08x}"
