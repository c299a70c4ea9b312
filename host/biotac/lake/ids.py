"""Ids of recordings, boards, sensors and calibrations, the same whenever and wherever a recording is exported."""

from __future__ import annotations

import hashlib
import json
from datetime import datetime, timezone
from pathlib import Path
from urllib.parse import quote

from ..errors import RecordingError
from ..keep.calibration_file import to_dict
from ..recording.blocks import Blocks
from ..recording.facts import Facts
from ..recording.layout import maps_text
from ..recording.reader import Recording
from ..wire.identity import ascii_text, serial_text

NO_BOARD = "none"  # for imported files
_LETTERS = 16


def recording_id(path: Path) -> tuple[str, str]:
    """A recording's id and its partition: a folder by board and by the day (UTC) on which it began.

    The id is a hash of its metadata and first second, so that a recording that has grown keeps it. Reads only that part
    of the file. Raises RecordingError if it is not a recording, or holds no data.
    """
    blocks = Blocks(path, check=False)
    first = next(iter(blocks), None)
    if first is None or blocks.metadata is None:
        Recording(path)  # raises an error that says what is wrong
        raise RecordingError(f"{path} holds no data; there is nothing to export")
    begin = json.dumps([blocks.metadata, first.arrived_ns], sort_keys=True).encode()
    data = b"".join(bytes([message_id]) + payload for message_id, payload in first.messages())
    try:
        info = Facts.read(blocks.metadata).info
    except ValueError as error:
        raise RecordingError(f"{path} has damaged metadata ({error}) and cannot be used; try another copy") from error
    board = serial_text(info) if any(info.board_serial) else NO_BOARD
    day = datetime.fromtimestamp(first.arrived_ns // 10**9, timezone.utc)
    return hashlib.sha256(begin + data).hexdigest()[:_LETTERS], f"board={quote(board, safe='')}/date={day:%Y-%m-%d}"


def sensors(recording: Recording) -> dict[int, str]:
    """Serial numbers by finger, of sensors that report one."""
    serials = {s.finger: ascii_text(s.serial) for s in recording.sensors if s.present}
    return {finger: serial for finger, serial in serials.items() if serial}


def calibrations(facts: Facts | Recording) -> dict[int, str]:
    """Ids of calibrations, by finger, for fingers with a calibration or map in force: a hash of the two."""
    made = {}
    for finger in sorted({*facts.calibrations, *facts.maps}):
        own = facts.calibrations.get(finger)
        in_force = [own and to_dict(own), maps_text({0: facts.maps[finger]} if finger in facts.maps else {})]
        made[finger] = hashlib.sha256(json.dumps(in_force, sort_keys=True).encode()).hexdigest()[:_LETTERS]
    return made
