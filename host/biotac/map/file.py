"""A wrench map as a file: JSON with the board's map in base64, the fitted map if there is one, and provenance."""

from __future__ import annotations

import base64
import binascii
import json
import zlib
from pathlib import Path
from typing import Any

from ..documents import Provenance, made_text, parse_document, read_document, sealed
from ..errors import InputError
from .board_map import from_blob, made_s_of, serial_of
from .fitted import WrenchMap

FORMAT = "biotac-wrench-map/1"
_CURE = "expected a wrench map, as `biotac calibrate wrench --out` or `biotac calibrate get` writes it"
_CONTENTS = {3: "force", 6: "force and torque", 7: "force, torque and torsion"}


def to_dict(blob: bytes, provenance: Provenance | None = None) -> dict[str, Any]:
    """The content of a file with a board's map. ``serial`` to ``map_crc32`` follow from the map."""
    return {
        "format": FORMAT,
        "serial": serial_of(blob),
        "made_s": made_s_of(blob),
        "bytes": len(blob),
        "map_crc32": f"{zlib.crc32(blob):08x}",
        "map": base64.b64encode(blob).decode("ascii"),
        "provenance": provenance or {},
    }


def from_dict(tree: Any) -> bytes:
    """The board's map in a file's content. Raises ValueError, InputError for a map that a board would refuse."""
    if not isinstance(tree, dict) or tree.get("format") != FORMAT:
        raise ValueError(f'it has no "format": "{FORMAT}"')
    if tree.get("map") is None and "fit" in tree:
        raise ValueError("it has a fitted map that no board can hold; fit with more rows or a smaller model")
    try:
        blob = base64.b64decode(tree.get("map", ""), validate=True)
    except (TypeError, binascii.Error) as error:
        raise ValueError(f"its map is not base64 ({error})") from error
    for key, value in to_dict(blob).items():
        if key != "provenance" and tree.get(key) != value:
            raise ValueError(f"{key} is {tree.get(key)!r}, but the map says {value!r}: the file was edited or cut off")
    return from_blob(blob).blob


def loads(text: str, where: str) -> bytes:
    """The board's map in a file's text. Raises InputError that begins with ``where`` and says what is wrong."""
    return parse_document(text, where, FORMAT, from_dict, _CURE)


def load(path: Path) -> bytes:
    """The board's map in a file. Raises InputError when it cannot be read or used."""
    return read_document(path, FORMAT, from_dict, _CURE)


def load_fitted(path: Path) -> WrenchMap:
    """The fitted map in a file. Raises InputError when it cannot be read or has none, as a map from a board."""
    return read_document(path, FORMAT, lambda content: WrenchMap.from_dict(content["fit"]), _CURE)


def dumps(blob: bytes, provenance: Provenance | None = None) -> str:
    """The text of a file with a board's map."""
    return json.dumps(sealed(to_dict(blob, provenance)), indent=2) + "\n"


def dumps_fitted(fitted: WrenchMap, *, serial: str = "", made_s: int = 0, provenance: Provenance | None = None) -> str:
    """The text of a file with a fitted map and, if a board can hold it, the board's; load_fitted() is exact."""
    try:
        document = to_dict(fitted.on_board(serial=serial, made_s=made_s).blob, provenance)
    except InputError:
        document = {"format": FORMAT, "map": None, "provenance": provenance or {}}
    return json.dumps(sealed({**document, "fit": fitted.to_dict()})) + "\n"


def title(blob: bytes) -> str:
    """The map's axes, size, sensor and date, as text for people."""
    board_map = from_blob(blob)
    sensor = f"sensor {board_map.serial}" if board_map.serial else "any sensor"
    return (
        f"{_CONTENTS[board_map.axes]}, {len(board_map.blocks)} block(s), {len(blob)} bytes, for {sensor}, "
        f"{made_text(board_map.made_s)}"
    )
