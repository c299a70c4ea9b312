"""A scripted board that streams on demand, can vanish, and come back as another boot; a hand on it; and a clock that
tests turn."""

import os
import threading
import time
from collections.abc import Callable
from dataclasses import fields
from pathlib import Path
from typing import Any

from biotac.board.gap import Gap
from biotac.clock.host_clock import HostClock
from biotac.hand.hand import Hand
from biotac.link.serial_port import SerialLink
from biotac.wire import messages_gen as wire
from biotac.wire.batches import Batch, StreamDecoder
from biotac.wire.dtypes_gen import DTYPES
from biotac.wire.framing import encode

WAIT_S = 600.0  # only a failing test waits so long
#: A scripted board with a clock started this long ago, so that frames of the past can be sent.
AHEAD_S = 40.0
#: A look waits for its answer for minutes, also where fixtures let looks follow each other at once.
PATIENCE = 12_000.0
#: All frames of a board without one are fresh.
ANY_AGE_S = 1e6


def packed(message: Any) -> bytes:
    """A message as it goes over the link."""
    return encode(message.ID, message.pack())


def frame(seq: int, finger: int = 0, force_z_n: float = 0.0, t_us: int | None = None, **fields: Any) -> bytes:
    """A FRAME of device time 10 ms * seq, unless told otherwise."""
    values: dict[str, Any] = dict.fromkeys(DTYPES[wire.FrameMessage.ID].names or (), 0)
    t_us = seq * 10_000 if t_us is None else t_us
    values |= {"seq": seq % 65536, "t_us": t_us % 2**32, "finger": finger, "counts": (2000,) * 19}
    values |= {"tare_q4": (32000,) * 19, "poc_um": (0, 0, 5080), "force_100un": (0, 0, round(force_z_n * 1e4))}
    values |= {"torsion_mnmm": 250 * finger, "torque_mnmm": (0, 0, 0)}
    return packed(wire.FrameMessage(**values | fields))


def heartbeat(seq: int, finger: int = 0, frames: int = 1) -> bytes:
    """An IDLE in place of so many frames, the last of device time 10 ms * seq."""
    return packed(wire.Idle(seq % 65536, seq * 10_000, finger, 0, 0, frames, 0, 2000, 2000, 0))


def batch_of(*frames: bytes) -> Batch:
    """These bytes as the decoder reads them, at once."""
    return StreamDecoder().feed(b"".join(frames), time.monotonic())


class Firmware:
    """A gateway's answers, and a list of all commands. It streams nothing by itself."""

    def __init__(self, hello: Callable[..., bytes], **facts: Any) -> None:
        self._hello = hello
        self.facts: dict[str, Any] = {"fingers_present": 0b11111} | facts
        self.begin_s: float | None = None  # of the clock; without one, board time is that of the frames sent
        self.t_us = 0
        self.streams = 0  # that are on
        self.faults = 0
        self.tare_reason = wire.TareReason.START
        self.idle = True  # all fingers rest: STATUS counts their heartbeats on
        self.frames_idle = 0
        self.mute: set[type] = set()  # kinds that the board does not answer
        self.refuses: dict[type, int] = {}  # error, by kind
        self.before: dict[type, bytes] = {}  # bytes sent before the answer to a kind, once
        self.after: dict[type, bytes] = {}  # and with it
        self.settings: dict[int, int] = {}
        self.commands: list[Any] = []
        self.news = threading.Condition()

    def now_us(self) -> int:
        """The board's time."""
        return self.t_us if self.begin_s is None else round((time.monotonic() - self.begin_s) * 1e6)

    def __call__(self, message_id: int, payload: bytes) -> bytes:
        message = wire.MESSAGES[message_id].unpack(payload)
        kind = type(message)
        if kind is wire.Start:
            self.streams = message.streams
        elif kind is wire.Stop:
            self.streams = 0
        with self.news:
            self.commands.append(message)
            self.news.notify_all()
        answer = b"" if kind in self.mute else self._answer(message, payload)
        return self.before.pop(kind, b"") + answer + self.after.pop(kind, b"")

    def _answer(self, message: Any, payload: bytes) -> bytes:
        if type(message) in self.refuses:
            return packed(wire.Reply(message.req_id, message.ID, self.refuses[type(message)]))
        if isinstance(message, wire.HelloRequest):
            return self._hello(payload, **self.facts)
        if isinstance(message, wire.GetStatus):
            return packed(self.status(message.req_id))
        if isinstance(message, wire.GetSensorStatus):
            facts = dict.fromkeys((f.name for f in fields(wire.SensorStatus)), 0)
            facts |= {"req_id": message.req_id, "finger": message.finger, "tare_reason": self.tare_reason}
            return packed(wire.SensorStatus(**facts))
        if isinstance(message, wire.SetSetting):
            self.settings[message.setting] = message.value
        if isinstance(message, (wire.SetSetting, wire.GetSetting)):
            value = self.settings.get(message.setting, 0)
            return packed(wire.SettingValue(message.req_id, message.setting, value))
        return packed(wire.Reply(message.req_id, message.ID, 0))

    def status(self, req_id: int = 0) -> wire.Status:
        """The board's STATUS."""
        self.frames_idle += self.idle
        facts = dict.fromkeys((f.name for f in fields(wire.Status)), 0) | {"finger_faults": (0,) * 5}
        facts |= {"req_id": req_id, "t_us": self.now_us() % 2**32, "uptime_s": self.now_us() // 10**6}
        facts |= {"fingers_present": self.facts["fingers_present"]}
        return wire.Status(**facts | {"streams": self.streams, "faults": self.faults, "frames_idle": self.frames_idle})

    def received(self, kind: type[Any] | tuple[type[Any], ...]) -> list[Any]:
        """The received commands of one kind."""
        return [m for m in self.commands if isinstance(m, kind)]

    def wait_for(self, kind: type[Any] | tuple[type[Any], ...], count: int = 1) -> None:
        """Wait until so many commands of a kind have come."""
        with self.news:
            assert self.news.wait_for(lambda: len(self.received(kind)) >= count, WAIT_S), f"no {kind}: {self.commands}"

    def wait_for_looks(self, count: int = 2) -> None:
        """Wait until the host has looked so often, from now on; the first look may have been under way."""
        self.wait_for(wire.GetStatus, len(self.received(wire.GetStatus)) + count)


class Live:
    """A hand on a scripted board. Frames are as old as their arrival, unless ``start_clock`` is called first."""

    def __init__(self, board: Any, firmware: Firmware, link: SerialLink | None = None, **how: Any) -> None:
        self.board = board
        self.firmware = firmware
        link = link or SerialLink(board.path)
        link.keeps_time, link.patience = False, PATIENCE
        self.hand = Hand(link, **{"max_age_s": ANY_AGE_S} | how)

    def start_clock(self) -> None:
        """From now on the board's time is a real clock: send frames of the board's ``now_us``."""
        self.firmware.begin_s = time.monotonic() - AHEAD_S
        self.hand.link.keeps_time = True
        self.hand.sync()

    def send(self, *frames: bytes) -> None:
        """Let the board send this, in one piece."""
        self.firmware.t_us = max(self.firmware.t_us, batch_of(*frames).last_t_us() or 0)
        self.board.send(b"".join(frames))

    def send_rows(self, count: int) -> int:
        """Let the board send FRAMEs of seq 1 and on, at least so many; returns the last one's."""
        for first in range(1, count + 1, 100):
            self.send(*(frame(seq) for seq in range(first, first + 100)))
        return first + 99


def gaps_in(batches: list[Batch]) -> list[Gap]:
    """The gaps that they tell."""
    return [m for batch in batches for m in batch.messages if isinstance(m, Gap)]


def gaps_of(hand: Hand) -> Callable[[], list[Gap]]:
    """All gaps from now on."""
    gaps: list[Gap] = []
    hand.on_gap(gaps.append)
    return lambda: gaps


def until(condition: Callable[[], Any]) -> None:
    """Wait."""
    end_s = time.monotonic() + WAIT_S
    while not condition():
        assert time.monotonic() < end_s, "it never came true"
        time.sleep(0.001)


class Clock(HostClock):
    """Time moved by hand: ``sleep`` calls ``while_away`` instead of waiting."""

    def __init__(self) -> None:
        super().__init__()
        self.pauses = 0
        self.while_away: Callable[[int], None] = lambda n: None

    def sleep(self, seconds: float) -> None:
        self.pauses += 1
        self.while_away(self.pauses)


def point(link: Path, target: str) -> None:
    """Make ``link`` lead to a port, as udev's by-id links do; without a target it is gone."""
    link.unlink(missing_ok=True)
    if target:
        os.symlink(target, link)


def stops_at_the_next_look(firmware: Firmware, after_us: int) -> None:
    """The board has heard nothing for so long, and says so at the next look."""
    status = firmware.status

    def stopped(req_id: int = 0) -> wire.Status:
        firmware.status, firmware.streams = status, 0
        firmware.t_us += after_us
        return status(req_id)

    firmware.status = stopped
