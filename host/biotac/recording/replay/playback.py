"""A recording that answers as the board did: commands in, stream out. No I/O, no clock.

It answers with the recorded HELLO, settings and sensors, and plays those messages that START asks for. Commands that
would change the board are refused: the recording cannot change any more.
"""

from __future__ import annotations

import dataclasses
import struct
from collections.abc import Iterator
from typing import Any

import numpy as np

from ...errors import InputError
from ...map import board_map as maps
from ...wire import messages_gen as wire
from ...wire.counters import nearest
from ...wire.decoder import Decoder
from ...wire.dtypes_gen import DTYPES
from ...wire.framing import encode
from ..reader import Recording
from ..unix_time import unwrapped_us

_STREAMS_OF = {message.ID: streams for message, streams in wire.STREAMS_OF.items()}
_TIME = struct.Struct("<I")
_OFFSETS: Any = {message_id: dtype.fields for message_id, dtype in DTYPES.items()}  # of a field: [id][name][1]
_TIME_AT = _OFFSETS[wire.FrameMessage.ID]["t_us"][1]  # in all stream messages
# Only these arrive in order of their times: a PAC can begin later than the FRAME that it precedes.
_CLOCKS = (wire.FrameMessage.ID, wire.Idle.ID)


class Playback:
    """The part of ``recording`` from ``from_s`` to ``to_s``, in device seconds since the first frame.

    Raises InputError when ``from_s`` is outside the recording, or ``to_s`` is not after it.
    """

    def __init__(self, recording: Recording, *, from_s: float = 0.0, to_s: float | None = None) -> None:
        self.recording = recording
        length_s = (recording.end_us - recording.begin_us) / 1e6
        if not 0 <= from_s <= length_s or (to_s is not None and not from_s < to_s):
            raise InputError(
                f"{recording.path} cannot be played from {from_s:g}{'' if to_s is None else f' to {to_s:g}'}; "
                f"expected 0 <= from < to, and from within its {length_s:.2f} s"
            )
        self.from_us = recording.begin_us + round(from_s * 1e6)
        self._to_us = None if to_s is None else recording.begin_us + round(to_s * 1e6)
        self._decoder = Decoder()
        self._stream = self._timed()
        self._next: tuple[int, bytes] | None = None
        self._asked: wire.Start | None = None
        self.playing = False
        self.over = False
        # The answer to GET_STATUS: the last one played; before that, the last one before the part played. An older one
        # would be mistaken for one after a wrap of the board's clock.
        statuses = [m for m in recording.messages if isinstance(m, wire.Status)]
        times_us = unwrapped_us(recording.begin_us, [m.t_us for m in statuses])
        before = max(0, int(np.searchsorted(times_us, self.from_us, side="right")) - 1)
        self._status: wire.Status | None = statuses[before] if statuses else None
        sensors = [m for m in reversed(recording.messages) if isinstance(m, wire.SensorStatus)]
        self._sensor_status: dict[int, wire.SensorStatus] = {m.finger: m for m in sensors}

    # ---- the stream ----------------------------------------------------------------------------

    def next_us(self) -> int | None:
        """Device time in us since ``from_s`` at which the next bytes are due; None when the playback is over."""
        while self._next is None and not self.over:
            t_us, message = next(self._stream, (0, None))
            self.over = message is None
            data = None if message is None else self._wanted(*message)
            self._next = None if data is None else (t_us - self.from_us, data)
        return None if self._next is None else self._next[0]

    def pop(self) -> bytes:
        """The next bytes; empty when the playback is over."""
        self.next_us()
        data = b"" if self._next is None else self._next[1]
        self._next = None
        return data

    def _timed(self) -> Iterator[tuple[int, tuple[int, bytes]]]:
        """Messages in the played range, each with the device time at which it came."""
        now_us = self.from_us - (self.from_us > self.recording.begin_us)  # messages before the clock began are older
        for message_id, payload in self._messages():
            if message_id in _CLOCKS:
                (raw_us,) = _TIME.unpack_from(payload, _TIME_AT)
                now_us = nearest(raw_us, now_us)
            if self._to_us is not None and now_us >= self._to_us:
                return
            if now_us >= self.from_us:
                yield now_us, (message_id, payload)

    def _messages(self) -> Iterator[tuple[int, bytes]]:
        """All, without the blocks that end before ``from_us``."""
        for k, block in enumerate(self.recording.heads()):
            if self.from_us <= (block.head.last_us or self.from_us):
                yield from self.recording.messages_in(k)

    def _wanted(self, message_id: int, payload: bytes) -> bytes | None:
        """The message's bytes as sent to this session; None if they are not sent."""
        if self._asked is None:
            return None
        if message_id == wire.Reply.ID:
            # A START in mid-recording: the reply tells a decoder that the gap before it is not a loss. No request has
            # the id 0.
            reply = wire.Reply.unpack(payload[: wire.Reply.STRUCT.size])
            again = reply.command == wire.Start.ID and reply.error == wire.Error.OK
            return encode(wire.Reply.ID, dataclasses.replace(reply, req_id=0).pack()) if again else None
        if not self._asked.streams & _STREAMS_OF.get(message_id, 0):
            return None
        fields = _OFFSETS[message_id]
        if "req_id" in fields and payload[fields["req_id"][1]]:
            return None  # it answered a request at the time
        if message_id == wire.Status.ID:
            self._status = wire.Status.unpack(payload[: wire.Status.STRUCT.size])
        if message_id == wire.SensorStatus.ID:
            status = wire.SensorStatus.unpack(payload[: wire.SensorStatus.STRUCT.size])
            self._sensor_status[status.finger] = status
        is_wanted = "finger" not in fields or self._asked.fingers >> payload[fields["finger"][1]] & 1
        return encode(message_id, payload) if is_wanted else None

    # ---- the answers ---------------------------------------------------------------------------

    def requests(self, data: bytes) -> list[tuple[int, bytes]]:
        """The commands completed by these bytes from the host."""
        return [request for request in self._decoder.feed(data).others if request[1]]

    def answer(self, message_id: int, payload: bytes) -> bytes | None:
        """The reply to one command; None if a recording cannot execute it (see ``refusal``)."""
        req_id = payload[0]
        if message_id in (wire.Ping.ID, wire.Stop.ID):
            self.playing = self.playing and message_id != wire.Stop.ID
            return _reply(req_id, message_id)
        if message_id == wire.HelloRequest.ID:
            hello = wire.HelloRequest.unpack(payload)
            return _message(dataclasses.replace(self.recording.info, req_id=req_id, nonce=hello.nonce))
        if message_id == wire.Start.ID:
            self._asked = wire.Start.unpack(payload)
            self.playing = True
            return _reply(req_id, message_id)
        if message_id == wire.GetSetting.ID:
            return self._setting(wire.GetSetting.unpack(payload))
        if message_id == wire.GetCalibration.ID:
            return self._calibration(req_id, payload[1])
        if message_id == wire.GetMap.ID:
            return self._map(req_id, payload[1])
        if message_id == wire.ReadMap.ID:
            return self._map_part(wire.ReadMap.unpack(payload))
        if message_id == wire.GetSensorInfo.ID:
            infos = {info.finger: info for info in self.recording.sensors}
            return _again(infos.get(payload[1]), req_id) or _reply(req_id, message_id, wire.Error.NO_SUCH_FINGER)
        if message_id == wire.GetStatus.ID:
            # The streams that are on here; those of the recording are of another program.
            streams = self._asked.streams if self._asked is not None and self.playing else 0
            return _again(self._status and dataclasses.replace(self._status, streams=streams), req_id)
        if message_id == wire.GetSensorStatus.ID:
            return _again(self._sensor_status.get(payload[1]), req_id)
        return None

    def refusal(self, message_id: int, payload: bytes) -> bytes:
        """The reply to a command for which ``answer`` returned None."""
        return _reply(payload[0], message_id, wire.Error.NOT_HERE)

    def _setting(self, asked: wire.GetSetting) -> bytes:
        if asked.setting not in list(wire.Setting):
            return _reply(asked.req_id, wire.GetSetting.ID, wire.Error.UNKNOWN_SETTING)
        value = self.recording.settings[wire.Setting(asked.setting)]
        return _message(wire.SettingValue(asked.req_id, asked.setting, value))

    def _calibration(self, req_id: int, finger: int) -> bytes:
        found = self.recording.calibrations.get(finger)
        if found is None:
            values = tuple(self.recording.settings[setting] for setting in wire.CALIBRATION_SETTINGS)
            return _message(wire.CalibrationMessage(req_id, finger, wire.CalibrationState.NONE, (0,) * 16, 0, values))
        state = wire.CalibrationState.IN_FORCE
        return _message(
            wire.CalibrationMessage(req_id, finger, state, found.wire_serial(), found.made_s, found.wire_values())
        )

    def _map(self, req_id: int, finger: int) -> bytes:
        found = self.recording.maps.get(finger)
        if found is None:
            return _message(wire.MapInfo(req_id, finger, wire.CalibrationState.NONE, (0,) * 16, 0, 0, 0))
        return _message(maps.info(found, req_id, finger))

    def _map_part(self, asked: wire.ReadMap) -> bytes:
        found = self.recording.maps.get(asked.finger, b"")
        if asked.offset >= len(found):
            return _reply(asked.req_id, wire.ReadMap.ID, wire.Error.OUT_OF_RANGE)
        return _message(wire.MapData(asked.req_id, asked.finger, asked.offset, maps.part(found, asked.offset)))


def _message(message: Any) -> bytes:
    return encode(message.ID, message.pack())


def _again(message: Any, req_id: int) -> bytes | None:
    """A recorded message as the answer to this request; None if there is none."""
    return None if message is None else _message(dataclasses.replace(message, req_id=req_id))


def _reply(req_id: int, message_id: int, error: wire.Error = wire.Error.OK) -> bytes:
    return _message(wire.Reply(req_id, message_id, error))
