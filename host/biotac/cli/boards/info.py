"""biotac info PORT|REC"""

from __future__ import annotations

import argparse
import dataclasses
from pathlib import Path
from typing import Any

import biotac

from ...documents import made_text
from ...errors import printable
from ...keep.calibration_file import to_dict
from ...map import file as map_file
from ...map.board_map import made_s_of
from ...recording.summary import lines, summary
from ...wire import messages_gen as wire
from ...wire.identity import ascii_text, board_name, maps_text, serial_text, setting_text, version_text
from .. import values
from ..outputs import report
from ..recordings.loading import code, is_recording, load

NO_BUS = "no bus, rounds come as messages"
EXAMPLE = "biotac info /dev/ttyACM0"


def add_arguments(parser: argparse.ArgumentParser) -> None:
    values.add_port(parser, " (default: the only board on USB); or a recording, .mcap")


def run(args: argparse.Namespace) -> int:
    if is_recording(args.port or ""):
        return of_recording(args)
    with biotac.open(args.port) as hand:
        hello = hand.info
        sensors = [hand.sensor_info(f) for f in hand.fingers]
        settings = hand.board.settings()
        calibrations = hand.board.calibrations()
        maps = hand.board.maps()
        status = hand.status()
        warnings = hand.warnings
    facts: dict[str, Any] = {
        "port": hand.port,
        "board": board_name(hello),
        "fingers": hello.fingers,
        "map_bytes": hello.map_bytes,
        "firmware": version_text(hello),
        "wire": f"{hello.wire_major}.{hello.wire_minor}",
        "schema_hash": f"{hello.schema_hash:08x}",
        "schema_matches": hello.schema_hash == wire.SCHEMA_HASH,
        "serial_number": serial_text(hello),
        "boot_id": hello.boot_id,
        "sensors": [
            {"finger": s.finger, "serial": ascii_text(s.serial), "software": ascii_text(s.software_version)}
            for s in sensors
        ],
        "calibrations": {finger: to_dict(calibration) for finger, calibration in calibrations.items()},
        "maps": {finger: map_file.to_dict(blob) for finger, blob in maps.items()},
        "settings": {s.name.lower(): value for s, value in settings.items()},
        "status": dataclasses.asdict(status),
    }
    lines = [
        f"{facts['board']}, firmware {facts['firmware']}, wire {facts['wire']}",
        f"{NO_BUS if hello.board == wire.BoardKind.MESSAGES else f'{hello.fingers} chip selects'}, {maps_text(hello)}",
        f"serial {facts['serial_number']}, boot {hello.boot_id:08x}, up {status.uptime_s} s",
        *(f"warning: {warning.text}" for warning in warnings),
    ]
    for s in facts["sensors"]:
        finger = s["finger"]
        own = f", calibration {made_text(calibrations[finger].made_s)}" if finger in calibrations else ""
        own += f", wrench map {made_text(made_s_of(maps[finger]))}" if finger in maps else ""
        named = f"{s['serial'] or 'of unknown serial number'}, software {s['software'] or 'unknown'}"
        lines.append(f"finger {finger}: BioTac {named}{own}")
    report(args, facts, "\n".join([*lines, *(setting_text(setting, value) for setting, value in settings.items())]))
    return 0


def of_recording(args: argparse.Namespace) -> int:
    """Describe a recording; stderr lists damage and gaps. Return 1 if it is damaged."""
    recording = load(Path(args.port))
    facts = summary(recording, recording.frames[["finger", "flags"]])
    report(args, facts, "\n".join(map(printable, lines(facts))))
    return code(recording)
