"""A board's wrench map as a file: JSON with its provenance and the map itself in base64."""

from __future__ import annotations

import base64
import binascii
import json
import zlib
from pathlib import Path
from typing import Any

from ..core.board_map import from_blob
from ..core.map_versions import opened
from ..documents import read_json
from ..errors import InputError
from . import map_blob as of
from .calibration_file import Provenance, when, write

FORMAT = "biotac-board-map"
VERSION = 1


def to_dict(blob: bytes, provenance: Provenance | None = None) -> dict[str, Any]:
    """The contents of a file, its keys in order. ``serial`` to ``crc32`` are for people: they follow from the map."""
    return {
        "format": FORMAT,
        "version": VERSION,
        "serial": of.serial(blob),
        "made_s": of.made_s(blob),
        "bytes": len(blob),
        "crc32": f"{zlib.crc32(blob):08x}",
        "map": base64.b64encode(blob).decode("ascii"),
        "provenance": provenance or {},
    }


def from_dict(tree: Any) -> bytes:
    """Inverse of to_dict, without the provenance; a map of version 1 is converted to the current version.

    Raises ValueError that says what is wrong with the file, InputError for a map that a board would refuse.
    """
    if not isinstance(tree, dict) or tree.get("format") != FORMAT:
        raise ValueError(
            f'it has no "format": "{FORMAT}"; to upload a .wrench.json, use `biotac calibrate wrench REC --upload PORT`'
        )
    if tree.get("version") != VERSION:
        raise ValueError(
            f"its version is {tree.get('version')!r}, expected {VERSION}; a newer biotac-gateway may read it"
        )
    try:
        blob = base64.b64decode(tree.get("map", ""), validate=True)
    except (TypeError, binascii.Error) as error:
        raise ValueError(f"its map is not base64 ({error})") from error
    for key, value in to_dict(blob).items():
        if key != "provenance" and tree.get(key) != value:
            raise ValueError(f"{key} is {tree.get(key)!r}, but the map says {value!r}: the file was edited or cut off")
    return opened(blob).blob


def load(path: Path) -> bytes:
    """The map in a file. Raises InputError when it cannot be read or used."""
    try:
        return from_dict(read_json(path))
    except OSError as error:
        raise InputError(f"{path} cannot be read ({error.strerror}); check the path") from error
    except (ValueError, InputError) as error:
        raise InputError(f"{path} is not a board's wrench map, as `biotac map get` writes it: {error}") from error


def save(path: Path, blob: bytes, provenance: Provenance | None = None, *, overwrite: bool = False) -> None:
    """Write a file. Raises InputError when it exists and may not be overwritten, or cannot be written."""
    write(path, json.dumps(to_dict(blob, provenance), indent=2) + "\n", overwrite=overwrite)


def title(blob: bytes) -> str:
    """What the map gives, its size, its sensor and when it was made, as text for people."""
    whose = f"sensor {of.serial(blob)}" if of.serial(blob) else "any sensor"
    its = from_blob(blob)
    what = {3: "force", 6: "force and torque", 7: "force, torque and torsion"}[its.axes]
    return f"{what}, {len(its.blocks)} block(s), {len(blob)} bytes, for {whose}, {when(of.made_s(blob))}"
