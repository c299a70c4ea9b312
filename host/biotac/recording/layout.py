"""Names that writers and readers of recordings share."""

from __future__ import annotations

import base64
import json
from collections.abc import Mapping

# Additions that an older reader may ignore (topics, metadata keys) do not change it.
FORMAT_VERSION = "1"
TOPIC = "/biotac/wire"
MESSAGE_ENCODING = "biotac-wire"
SCHEMA_NAME = "biotac.link"
SCHEMA_ENCODING = "biotac-schema"
METADATA_NAME = "biotac"
CONTINUES = "continues"  # metadata key: the file that ended when the board restarted


def frame_id(finger: int) -> str:
    """The coordinate frame of a finger's results, in recordings and exports (SPEC.md, Frames of reference)."""
    return f"biotac_finger{finger}"


def maps_text(maps: Mapping[int, bytes]) -> str:
    """Maps by finger, as the metadata has them; ``maps_of`` reads it."""
    return json.dumps({finger: base64.b64encode(blob).decode() for finger, blob in maps.items()})


def maps_of(text: str) -> dict[int, bytes]:
    """Inverse of maps_text; ValueError for what is none."""
    return {int(finger): base64.b64decode(its, validate=True) for finger, its in json.loads(text).items()}
