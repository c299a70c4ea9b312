"""How much of a stream fits through a UART: the bytes of all messages against the bit rate of the line."""

from __future__ import annotations

from typing import Any

from ..errors import InputError
from ..wire import messages_gen as wire
from ..wire.framing import encode
from ..wire.sensor_gen import MAX_SENSORS
from ..wire.slots import FRAME_HZ

BITS_PER_BYTE = 10  # with start and stop bit


def bits_per_s(streams: int, fingers: int) -> int:
    """The bit rate of ``streams`` for so many fingers, all touched; without messages that come only now and then."""
    a_round = sum(map(_bytes, _round_messages(streams)))
    a_second = _bytes(wire.Status) + fingers * _bytes(wire.SensorStatus) if streams & wire.StreamFlags.STATUS else 0
    return BITS_PER_BYTE * (round(FRAME_HZ * fingers * a_round) + a_second)


def most_fingers(streams: int, line_bits_per_s: int) -> int:
    """How many fingers' ``streams`` fit the line, 0 to 5."""
    return max(n for n in range(MAX_SENSORS + 1) if n == 0 or bits_per_s(streams, n) <= line_bits_per_s)


def check(port: str, line_bits_per_s: int, streams: int, fingers: int) -> None:
    """Raise InputError when ``streams`` of so many fingers exceed the line's bit rate."""
    needed = bits_per_s(streams, fingers)
    if needed <= line_bits_per_s:
        return
    lean = wire.StreamFlags.FRAMES | wire.StreamFlags.STATUS
    asked = " and ".join(str(wire.STREAMS_OF[message]) for message in _round_messages(streams))
    raise InputError(
        f"{port} carries {line_bits_per_s} bit/s, but {asked} of {fingers} fingers take {needed}; stream at most "
        f"{most_fingers(streams, line_bits_per_s)} finger(s), or {most_fingers(lean, line_bits_per_s)} without PAC"
    )


def _round_messages(streams: int) -> list[Any]:
    return [message for message in wire.EVERY_ROUND if streams & wire.STREAMS_OF[message]]


def _bytes(message: Any) -> int:
    return len(encode(message.ID, bytes(message.STRUCT.size)))
