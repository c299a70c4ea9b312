"""What this session has told the board, for a board that comes back without knowing it."""

from __future__ import annotations

import threading
from typing import Any

from ..wire import messages_gen as wire

_KEYS = {
    wire.SetSetting: "setting",
    wire.Subscribe: "fingers",
    wire.SetCalibration: "finger",
    wire.ClearCalibration: "finger",
}
_OF_A_MAP = (wire.BeginMap, wire.WriteMap, wire.EndMap, wire.ClearMap)


class Session:
    """The latest of each thing that was changed: settings, calibrations, maps and subscriptions.

    Tares are left out: after a reboot the board takes its own, and a former one may be wrong by then.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._told: dict[tuple[str, int], Any] = {}
        self._maps: dict[int, bytes | None] = {}
        self._upload = bytearray()

    def note(self, request: Any) -> None:
        """The board has accepted this."""
        if isinstance(request, _OF_A_MAP):
            self._note_map(request)
            return
        name = _KEYS.get(type(request))
        if name is None:
            return
        family = "calibration" if name == "finger" else type(request).__name__
        key = (family, int(getattr(request, name)))
        with self._lock:
            self._told.pop(key, None)  # to the end: of overlapping subscriptions the latest holds
            self._told[key] = request

    def requests(self) -> list[Any]:
        """What to say again, in this order."""
        with self._lock:
            return list(self._told.values())

    def maps(self) -> dict[int, bytes | None]:
        """The map that each finger was given; None: it was cleared."""
        with self._lock:
            return dict(self._maps)

    def _note_map(self, request: Any) -> None:
        with self._lock:
            if isinstance(request, wire.BeginMap):
                self._upload = bytearray(request.size_bytes)
            elif isinstance(request, wire.WriteMap):
                data = bytes(request.data)[: len(self._upload) - request.offset]
                self._upload[request.offset : request.offset + len(data)] = data
            else:
                self._maps[request.finger] = bytes(self._upload) if isinstance(request, wire.EndMap) else None
