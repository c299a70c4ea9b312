"""Names that writer and reader share."""

from __future__ import annotations

FORMAT_VERSION = "1"
TOPIC = "/biotac/wire"
MESSAGE_ENCODING = "biotac-wire"
SCHEMA_NAME = "biotac.link"
SCHEMA_ENCODING = "biotac-schema"
METADATA_NAME = "biotac"
