"""What a program wants of the board, by name, as the flags that SUBSCRIBE and START carry."""

from __future__ import annotations

from dataclasses import dataclass, replace

from ..errors import InputError
from ..wire.batches import Batch
from ..wire.messages_gen import QuantityFlags, StreamFlags
from ..wire.sensor_gen import SLOT_HZ, SLOTS

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
FRAME_HZ = SLOT_HZ / len(SLOTS)


@dataclass(frozen=True, slots=True)
class Wants:
    """Flags for the board, and every how many frames this side takes one."""

    quantities: QuantityFlags
    streams: StreamFlags
    every: int

    @classmethod
    def of(cls, names: tuple[str, ...], *, rest: bool, rate_hz: float | None) -> Wants:
        """InputError for a name or a rate that there is not."""
        for name in names:
            if name not in NAMES:
                raise InputError(f"nothing is called {name!r}; expected some of {', '.join(NAMES)}")
        if not names:
            raise InputError(f"nothing is wanted; expected some of {', '.join(NAMES)}")
        if rate_hz is not None and not 0 < rate_hz <= FRAME_HZ:
            raise InputError(f"rate_hz is {rate_hz}, expected above 0 and at most {FRAME_HZ:g}, the board's own")
        quantities = QuantityFlags(0)
        for name in names:
            quantities |= QUANTITIES.get(name, QuantityFlags(0))
        if rest:
            quantities |= QuantityFlags.REST_FRAMES
        # The link's sign of life, 36 bytes a second: without it a hand without sensors would be a dead one.
        streams = StreamFlags.STATUS
        if any(name in QUANTITIES or name in IN_EVERY_FRAME for name in names):
            streams |= StreamFlags.FRAMES
        for name in names:
            streams |= STREAMS.get(name, StreamFlags(0))
        return cls(quantities, streams, 1 if rate_hz is None else round(FRAME_HZ / rate_hz))

    def thin(self, batch: Batch) -> Batch:
        """Frames whose seq is a multiple of ``every``; everything else stays."""
        if self.every == 1 or not len(batch.wire):
            return batch
        kept = batch.seq % self.every == 0
        return replace(batch, wire=batch.wire[kept], seq=batch.seq[kept], t_us=batch.t_us[kept])
