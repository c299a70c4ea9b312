"""The wire protocol: generated messages, framing, the decoder, and batches of numbered frames.

The names are imported on first use: `biotac --version` needs the messages and not NumPy.
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from . import messages_gen as messages
    from . import sensor_gen as sensor
    from . import slots
    from .batches import StreamDecoder
    from .decoder import Decoder
    from .dtypes_gen import DTYPES
    from .framing import OVERHEAD_BYTES, encode

__all__ = ["DTYPES", "OVERHEAD_BYTES", "Decoder", "StreamDecoder", "encode", "messages", "sensor", "slots"]

_HOMES = {
    "DTYPES": ".dtypes_gen", "OVERHEAD_BYTES": ".framing", "Decoder": ".decoder", "StreamDecoder": ".batches",
    "encode": ".framing", "messages": ".messages_gen", "sensor": ".sensor_gen",
}  # fmt: skip


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(_HOMES.get(name, f".{name}"), __name__)
    return getattr(module, name, module)
