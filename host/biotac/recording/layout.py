"""Names that writers and readers of recordings share."""

from __future__ import annotations

# Additions that an older reader may ignore (topics, metadata keys) do not change it.
FORMAT_VERSION = "1"
TOPIC = "/biotac/wire"
MESSAGE_ENCODING = "biotac-wire"
SCHEMA_NAME = "biotac.link"
SCHEMA_ENCODING = "biotac-schema"
METADATA_NAME = "biotac"


def frame_id(finger: int) -> str:
    """The coordinate frame of a finger's results, in recordings and exports (SPEC.md, Frames of reference)."""
    return f"biotac_finger{finger}"
