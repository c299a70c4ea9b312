"""What a recording's metadata say, as values."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from ..errors import InputError
from ..keep import Calibration
from ..keep.calibration_file import from_dict
from ..keep.map_blob import as_blob
from ..keep.values import own_settings
from ..wire import messages_gen as wire
from ..wire.identity import NO_IMAGE
from . import layout


@dataclass(frozen=True)
class Facts:
    """Board, sensors and what was in force when it began; ``calibrations`` and ``maps`` by finger, ``names`` fingers
    by name.
    """

    info: wire.Hello
    sensors: list[wire.SensorInfo]
    settings: dict[wire.Setting, int]
    calibrations: dict[int, Calibration]
    maps: dict[int, bytes]
    names: dict[str, int]

    @classmethod
    def read(cls, metadata: Mapping[str, str]) -> Facts:
        """KeyError, TypeError, ValueError, AttributeError, RecursionError or OverflowError for damaged ones."""
        hello: dict[str, Any] = {"image_crc32": NO_IMAGE} | json.loads(metadata["hello"])
        named = json.loads(metadata["settings"])
        own = json.loads(metadata.get("calibrations", "{}"))
        return cls(
            wire.Hello(**_tuples(hello)),
            [wire.SensorInfo(**_tuples(s)) for s in json.loads(metadata.get("sensors", "[]"))],
            # A setting or a calibration that this recording's firmware did not have yet: what it did, and none.
            {s: int(named.get(s.name.lower(), wire.SETTINGS[s].before)) for s in wire.Setting},
            {int(finger): from_dict(its) for finger, its in own.items()},
            _maps(metadata.get("maps", "{}")),
            layout.names_of(metadata),
        )

    @property
    def finger_settings(self) -> dict[int, dict[wire.Setting, int]]:
        """All settings that a finger's results come from, for the fingers that had a calibration in force."""
        return own_settings(self.settings, self.calibrations)


def _maps(text: str) -> dict[int, bytes]:
    """Maps as JSON had them; ValueError for what is none."""
    try:
        return {finger: as_blob(its) for finger, its in layout.maps_of(text).items()}
    except InputError as error:
        raise ValueError(error) from error


def _tuples(fields: dict[str, Any]) -> dict[str, Any]:
    """A message's fields as JSON had them."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in fields.items()}
