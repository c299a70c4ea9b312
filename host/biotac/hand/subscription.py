"""What a program wants from the board: by name, as the flags of SUBSCRIBE and START, and what the board was told."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from ..errors import InputError
from ..wire.batches import Batch
from ..wire.messages_gen import Event, QuantityFlags, Start, Stop, StreamFlags, Subscribe, Touch
from ..wire.sensor_gen import MAX_SENSORS
from ..wire.slots import FRAME_HZ
from . import bandwidth
from .board import Board
from .callbacks import Callbacks
from .compatibility import BANDS_SINCE_MINOR, EVENTS_SINCE_MINOR, PRESSURE_SINCE_MINOR, need
from .views import Fingers, Latest

#: What a FRAME can say about a contact, for Hand.subscribe.
RESULTS = QuantityFlags.POC | QuantityFlags.FORCE | QuantityFlags.TORQUE | QuantityFlags.PRESSURE
AT_FIRST = RESULTS | QuantityFlags.REST_FRAMES
# Messages that a board sends only when a callback wants them.
TOLD_OF = {Touch: QuantityFlags.TOUCH, Event: QuantityFlags.EVENTS}

QUANTITIES = {
    "force": QuantityFlags.FORCE,
    "poc": QuantityFlags.POC,
    "torque": QuantityFlags.TORQUE,
    "pressure": QuantityFlags.PRESSURE,
    "sigma": QuantityFlags.SIGMA,
    "touch": QuantityFlags.TOUCH,
    "events": QuantityFlags.EVENTS,
}
IN_EVERY_FRAME = ("raw", "pdc", "temperature")
STREAMS = {"pac": StreamFlags.PAC, "bands": StreamFlags.BANDS}
NAMES = (*QUANTITIES, *IN_EVERY_FRAME, *STREAMS, "status")


@dataclass(frozen=True, slots=True)
class Wants:
    """Flags for the board; this side keeps one of ``every`` frames."""

    quantities: QuantityFlags
    streams: StreamFlags
    every: int

    @classmethod
    def of(cls, names: tuple[str, ...], *, rest: bool, rate_hz: float | None) -> Wants:
        """The flags for ``names``. Raises InputError for an unknown name, no name, or a rate out of range."""
        for name in names:
            if name not in NAMES:
                raise InputError(f"unknown name {name!r}; expected some of {', '.join(NAMES)}")
        if not names:
            raise InputError(f"no name was given; expected some of {', '.join(NAMES)}")
        if rate_hz is not None and not 0 < rate_hz <= FRAME_HZ:
            raise InputError(f"rate_hz is {rate_hz}, expected above 0 and at most {FRAME_HZ:g}, the board's rate")
        quantities = QuantityFlags(0)
        for name in names:
            quantities |= QUANTITIES.get(name, QuantityFlags(0))
        if rest:
            quantities |= QuantityFlags.REST_FRAMES
        # The link's sign of life: without it, a hand without sensors would look dead.
        streams = StreamFlags.STATUS
        if any(name in QUANTITIES or name in IN_EVERY_FRAME for name in names):
            streams |= StreamFlags.FRAMES
        for name in names:
            streams |= STREAMS.get(name, StreamFlags(0))
        return cls(quantities, streams, 1 if rate_hz is None else round(FRAME_HZ / rate_hz))

    def thin(self, batch: Batch) -> Batch:
        """The batch with only those frames whose seq is a multiple of ``every``; everything else stays."""
        if self.every == 1 or not len(batch.wire):
            return batch
        kept = batch.seq % self.every == 0
        return replace(batch, wire=batch.wire[kept], seq=batch.seq[kept], t_us=batch.t_us[kept])


class Subscription:
    """What a board was told to compute and send: what was asked for, and what ``callbacks`` need in addition."""

    def __init__(self, board: Board, latest: Latest, callbacks: Callbacks) -> None:
        #: The last START; None before the first and after a STOP.
        self.started: Start | None = None
        self.wants: Wants | None = None
        self._board = board
        self._latest = latest
        self._callbacks = callbacks
        self._hinted = StreamFlags(0)  # the streams that carry what callbacks wait for
        self._quantities = dict.fromkeys(range(MAX_SENSORS), AT_FIRST)

    def start(self, streams: int, fingers: int, keepalive_ms: int) -> None:
        """Start the stream. Raises InputError when it does not fit a UART, WireVersionError for missing BANDS."""
        streams |= self._hinted
        if streams & StreamFlags.BANDS:
            need(self._board.info, BANDS_SINCE_MINOR, "bands of PAC")
        link = self._board.link
        if link.bits_per_s is not None:
            asked = (fingers & self._board.info.fingers_present).bit_count()
            bandwidth.check(link.port, link.bits_per_s, streams, asked)
        started = Start(0, int(streams), fingers, keepalive_ms)
        self._board.tell(started)
        self.started = started

    def resume(self) -> None:
        """Make a board that was away stream again, if it did before."""
        if self.started is not None:
            self._board.tell(self.started)

    def stop(self) -> None:
        """Stop the stream."""
        self._board.tell(Stop(0))
        self.started = None

    def subscribe(self, quantities: QuantityFlags, fingers: Fingers) -> None:
        """See Streams.subscribe."""
        asked = quantities
        if self._board.info.wire_minor < PRESSURE_SINCE_MINOR:
            asked &= ~QuantityFlags.PRESSURE
        if self._board.info.wire_minor < EVENTS_SINCE_MINOR:
            asked &= ~QuantityFlags.EVENTS
        for kind, quantity in TOLD_OF.items():
            asked |= quantity if self._callbacks.wants(kind) else QuantityFlags(0)
        mask = self._latest.mask(fingers)
        self._board.tell(Subscribe(0, mask, int(asked)), lasting=("subscription", mask))
        self._quantities.update({f: asked for f in range(MAX_SENSORS) if mask >> f & 1})

    def tell_of(self, kind: type[Any]) -> None:
        """Subscribe every finger to messages of this kind, which a callback wants."""
        for quantities in {q for q in self._quantities.values() if TOLD_OF[kind] not in q}:
            mask = sum(1 << f for f, q in self._quantities.items() if q == quantities)
            self.subscribe(quantities, mask)

    def hint(self, streams: StreamFlags) -> bool:
        """Add ``streams`` to every START from now on; true when the last one lacked any of them."""
        self._hinted |= streams
        return self.started is not None and bool(self._hinted & ~self.started.streams)
