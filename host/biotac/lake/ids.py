"""Ids of recordings, boards, sensors and calibrations, the same whenever and wherever a recording is exported."""

from __future__ import annotations

import hashlib
import json
from datetime import datetime, timezone
from pathlib import Path
from urllib.parse import quote

from ..errors import RecordingError
from ..keep.calibration_file import to_dict
from ..recording import Recording
from ..recording.blocks import Blocks
from ..recording.facts import Facts
from ..recording.layout import maps_text
from ..wire.identity import ascii_text, serial_text

NO_BOARD = "none"  # for imported files
_LETTERS = 16


def recording_id(path: Path) -> str:
    """A recording's id: a hash of its metadata and first second, so that a recording that has grown keeps its id.

    Reads only that part of the file. Raises RecordingError if it is not a recording, or holds no data.
    """
    blocks = Blocks(path, check=False)
    first = next(iter(blocks), None)
    if first is None or blocks.metadata is None:
        Recording(path)  # raises an error that says what is wrong
        raise RecordingError(f"{path} holds no data; there is nothing to export")
    begin = json.dumps([blocks.metadata, first.arrived_ns], sort_keys=True).encode()
    return hashlib.sha256(begin + b"".join(packet.data for packet in first.packets())).hexdigest()[:_LETTERS]


def partition(recording: Recording) -> str:
    """Folder by board and by the day (UTC) on which the recording began."""
    day = datetime.fromtimestamp(recording.begin_ns // 10**9, timezone.utc)
    return f"board={quote(board(recording), safe='')}/date={day:%Y-%m-%d}"


def board(recording: Recording) -> str:
    """The board's serial number, as on USB; NO_BOARD if it has none."""
    return serial_text(recording.info) if any(recording.info.board_serial) else NO_BOARD


def sensors(recording: Recording) -> dict[int, str]:
    """Serial numbers by finger, of sensors that report one."""
    told = {s.finger: ascii_text(s.serial) for s in recording.sensors if s.present}
    return {finger: serial for finger, serial in told.items() if serial}


def calibrations(facts: Facts | Recording) -> dict[int, str]:
    """Ids of calibrations, by finger, for fingers with a calibration or map in force: a hash of the two."""
    made = {}
    for finger in sorted({*facts.calibrations, *facts.maps}):
        own = facts.calibrations.get(finger)
        told = [own and to_dict(own), maps_text({0: facts.maps[finger]} if finger in facts.maps else {})]
        made[finger] = hashlib.sha256(json.dumps(told, sort_keys=True).encode()).hexdigest()[:_LETTERS]
    return made
