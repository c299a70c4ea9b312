"""Facts about a recording (board, sensors, settings and calibrations), as values and as metadata."""

from __future__ import annotations

import base64
import json
import struct
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, fields, replace
from typing import Any

from ..errors import InputError, printable
from ..keep import Calibration
from ..keep.calibration_file import from_dict, to_dict
from ..map.board_map import as_blob
from ..version import __version__
from ..wire import messages_gen as wire
from ..wire.identity import version_text
from . import layout

Settings = Mapping[wire.Setting, int]


@dataclass(frozen=True)
class RecordedBoard:
    """Board, sensors, and the settings, calibrations and maps in force when the recording began.

    ``calibrations`` and ``maps`` are by finger; ``names`` are fingers by name. ``zero_ns``: see link.base.
    """

    info: wire.Hello
    sensors: list[wire.SensorInfo]
    settings: dict[wire.Setting, int]
    calibrations: dict[int, Calibration] = field(default_factory=dict)
    maps: dict[int, bytes] = field(default_factory=dict)
    names: dict[str, int] = field(default_factory=dict)
    zero_ns: int | None = None

    @classmethod
    def read(cls, metadata: Mapping[str, str]) -> RecordedBoard:
        """The board from a recording's metadata. Raises ValueError if it is damaged."""
        try:
            named = json.loads(metadata["settings"])
            own, maps = (json.loads(metadata.get(name, "{}")) for name in ("calibrations", "maps"))
            facts = cls(
                _message(wire.Hello, json.loads(metadata["hello"])),
                [_message(wire.SensorInfo, values) for values in json.loads(metadata.get("sensors", "[]"))],
                # A setting that the recording's firmware did not have yet is at the default; a calibration, none.
                {s: int(named.get(s.name.lower(), wire.SETTINGS[s].default)) for s in wire.Setting},
                {int(finger): from_dict(calibration) for finger, calibration in own.items()},
                {int(finger): as_blob(base64.b64decode(blob, validate=True)) for finger, blob in maps.items()},
                layout.names_of(metadata),
                int(metadata["zero_ns"]) if "zero_ns" in metadata else None,
            )
            messages: list[Any] = [facts.info, *facts.sensors]
            for message in messages:
                message.pack()  # so that every number and every text fits the field
            return facts
        except InputError as error:
            raise ValueError(error) from error
        except (KeyError, TypeError, AttributeError, RecursionError, OverflowError, struct.error) as error:
            raise ValueError(f"{type(error).__name__}: {error}") from error

    def metadata(self, port: str) -> dict[str, str]:
        """The metadata record: everything needed to read and interpret the wire later."""
        return {
            "format": layout.FORMAT_VERSION,
            "software": __version__,
            "port": printable(port),
            "wire": f"{wire.WIRE_MAJOR}.{wire.WIRE_MINOR}",
            "firmware": version_text(self.info),
            "hello": json.dumps(asdict(self.info)),
            **in_force(self.settings, self.calibrations, self.maps),
            layout.NAMES: json.dumps(self.names),
            "sensors": json.dumps([asdict(s) for s in self.sensors]),
            **({} if self.zero_ns is None else {"zero_ns": str(self.zero_ns)}),
        }


def in_force(settings: Settings, calibrations: Mapping[int, Calibration], maps: Mapping[int, bytes]) -> dict[str, str]:
    """Metadata entries that a recording's results depend on."""
    return {
        "settings": json.dumps({s.name.lower(): value for s, value in settings.items()}),
        "calibrations": json.dumps({finger: to_dict(own) for finger, own in calibrations.items()}),
        "maps": layout.maps_text(maps),
    }


def _message(kind: type[Any], values: dict[str, Any]) -> Any:
    """A message from JSON. As on the wire, fields that an older minor version lacks are 0, and a newer one's ignored.

    Raises TypeError for other names.
    """
    names = [field.name for field in fields(kind)]
    if [*values][: len(names)] != names[: len(values)]:
        raise TypeError(f"{kind.__name__} has {', '.join(values)}, expected {', '.join(names)}")
    zero = kind.unpack(bytes(kind.STRUCT.size))
    known = {name: values[name] for name in names if name in values}
    return replace(zero, **{name: tuple(value) if isinstance(value, list) else value for name, value in known.items()})
