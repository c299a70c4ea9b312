"""Backing up and restoring a board's settings, and the calibrations and wrench maps in force.

Anything saved on the board survives flashing anyway; values in force but not saved need this backup.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Any

from ..documents import read_document, sealed, write_new
from ..errors import CommandRefusedError, InputError
from ..hand.hand import Hand
from ..keep import Calibration
from ..keep.calibration_file import from_dict, to_dict
from ..map import file as map_file
from ..wire import messages_gen as wire
from ..wire.identity import board_name, serial_text, version_text

FORMAT = "biotac-settings/1"
LAST_ID = 255


@dataclass(frozen=True)
class Backup:
    """A backup. ``values`` by setting id, as a board may have settings unknown here; calibrations, maps by finger."""

    path: Path
    values: dict[int, int]
    calibrations: dict[int, Calibration] = field(default_factory=dict)
    maps: dict[int, bytes] = field(default_factory=dict)


@dataclass(frozen=True)
class Restored:
    """Names of the settings that were changed or omitted; the others already had the right values."""

    changed: tuple[str, ...]
    unknown: tuple[str, ...]  # to the new firmware


def setting_name(setting: int) -> str:
    """A setting's name, or the number when it is newer than this library."""
    return wire.Setting(setting).name.lower() if setting in list(wire.Setting) else f"setting {setting}"


def read_settings(hand: Hand) -> dict[int, int]:
    """All settings of the board, by id, including those newer than this library."""
    values: dict[int, int] = {}
    for setting in range(1, LAST_ID + 1):
        try:
            values[setting] = hand.board.setting(setting)
        except CommandRefusedError as refused:
            if refused.error != wire.Error.UNKNOWN_SETTING:
                raise
            if setting > max(wire.Setting):
                break  # ids have no gaps, so nothing newer follows
    return values


def save(hand: Hand, path: Path | None) -> Backup:
    """Save all of the board's settings, and the calibrations and maps in force, to a new file.

    Without ``path`` it is in the working directory, named after the board's serial number and the time. Raises
    InputError when the file exists or cannot be written.
    """
    hello = hand.info
    path = path or Path(f"biotac-settings-{serial_text(hello)}-{datetime.now():%Y%m%d-%H%M%S}.json")
    backup = Backup(path.resolve(), read_settings(hand), hand.board.calibrations(), hand.board.maps())
    facts = {
        "format": FORMAT,
        "board": board_name(hello),
        "serial_number": serial_text(hello),
        "firmware": version_text(hello),
        "boot_id": hello.boot_id,
        "settings": [{"id": key, "name": setting_name(key), "value": value} for key, value in backup.values.items()],
        "calibrations": {finger: to_dict(calibration) for finger, calibration in backup.calibrations.items()},
        "maps": {finger: map_file.to_dict(blob) for finger, blob in backup.maps.items()},
    }
    try:
        write_new(backup.path, json.dumps(sealed(facts), indent=1) + "\n")
    except InputError as error:
        raise InputError(f"{error}; choose another --backup") from error
    return backup


def read_backup(path: Path) -> Backup:
    """Read a file that save() wrote. Raises InputError when it cannot be read or is not such a file."""

    def parse(content: dict[str, Any]) -> Backup:
        values = {int(entry["id"]): int(entry["value"]) for entry in content["settings"]}
        calibrations = {int(finger): from_dict(tree) for finger, tree in content.get("calibrations", {}).items()}
        maps = {int(finger): map_file.from_dict(tree) for finger, tree in content.get("maps", {}).items()}
        return Backup(path.resolve(), values, calibrations, maps)

    return read_document(path, FORMAT, parse, "expected a file written by biotac flash")


def restore(hand: Hand, wanted: Backup) -> Restored:
    """Set and save the values that differ, then read them all back.

    Settings that the board's firmware does not know are omitted. Raises CommandRefusedError for a value that the board
    refuses, and InputError when one does not read back.
    """
    found = read_settings(hand)
    values, calibrations, maps = wanted.values, wanted.calibrations, wanted.maps
    changed = [key for key, value in values.items() if key in found and found[key] != value]
    for key in changed:
        hand.board.set_setting(key, values[key])
    given = [finger for finger, wish in calibrations.items() if hand.board.calibration(finger) != wish]
    for finger in given:
        hand.board.set_calibration(finger, calibrations[finger])
        if hand.board.calibration(finger) != calibrations[finger]:
            raise InputError(
                f"calibration of finger {finger} reads back differently after it was restored; set it by hand"
            )
    uploaded = [finger for finger, blob in maps.items() if hand.board.get_map(finger) != blob]
    for finger in uploaded:
        hand.board.set_map(finger, maps[finger])  # which reads it back
    if changed or given or uploaded:
        hand.board.save_settings()
        found = read_settings(hand)
    for key, value in values.items():
        if found.get(key, value) != value:
            raise InputError(f"{setting_name(key)} reads {found[key]} after {value} was restored; set it by hand")
    restored = [setting_name(key) for key in changed] + [f"calibration of finger {finger}" for finger in given]
    restored += [f"wrench map of finger {finger}" for finger in uploaded]
    return Restored(tuple(restored), tuple(setting_name(key) for key in values if key not in found))
