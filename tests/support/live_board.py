"""A scripted board that streams on demand, can vanish, and come back as another boot; and a clock that tests turn."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from biotac.wire import messages_gen as wire
from biotac.wire.dtypes_gen import DTYPES
from biotac.wire.framing import encode


def frame(seq: int, finger: int = 0, force_z_n: float = 0.0) -> bytes:
    """A FRAME of device time 10 ms * seq."""
    values: dict[str, Any] = dict.fromkeys(DTYPES[wire.Frame.ID].names or (), 0)
    values |= {"seq": seq % 65536, "t_us": seq * 10_000, "finger": finger, "counts": (2000,) * 19}
    values |= {"tare_q4": (32000,) * 19, "poc_um": (0, 0, 5080), "force_100un": (0, 0, round(force_z_n * 1e4))}
    values |= {"torsion_mnmm": 250 * finger, "torque_mnmm": (0, 0, 0), "force_sigma_100un": (0, 0, 0)}
    return encode(wire.Frame.ID, wire.Frame(**values).pack())


class Firmware:
    """What a gateway answers, and all that it was told."""

    def __init__(self, hello: Callable[..., bytes], **facts: Any) -> None:
        self._hello = hello
        self._facts = facts
        self.told: list[Any] = []
        self.heard = threading.Condition()

    def __call__(self, message_id: int, payload: bytes) -> bytes:
        message = wire.MESSAGES[message_id].unpack(payload)
        with self.heard:
            self.told.append(message)
            self.heard.notify_all()
        if isinstance(message, wire.HelloRequest):
            return self._hello(payload, **self._facts)
        if isinstance(message, wire.SetSetting):
            answer = wire.SettingValue(message.req_id, message.setting, message.value)
            return encode(answer.ID, answer.pack())
        return encode(wire.Reply.ID, wire.Reply(message.req_id, message_id, 0).pack())

    def of(self, kind: type[Any] | tuple[type[Any], ...]) -> list[Any]:
        """What it was told of a kind."""
        return [m for m in self.told if isinstance(m, kind)]

    def wait_for(self, kind: type[Any] | tuple[type[Any], ...], count: int = 1) -> None:
        """Until it was told so many of a kind."""
        with self.heard:
            assert self.heard.wait_for(lambda: len(self.of(kind)) >= count, 600), f"no {kind}: {self.told}"


class Clock:
    """A HostClock by hand: ``sleep`` calls ``while_away`` instead of waiting."""

    def __init__(self) -> None:
        self.now_s = 1000.0
        self.pauses = 0
        self.while_away: Callable[[int], None] = lambda n: None

    def monotonic_s(self) -> float:
        return self.now_s

    def unix_ns(self) -> int:
        return round(self.now_s * 1e9)

    def sleep(self, seconds: float) -> None:
        self.pauses += 1
        self.now_s += seconds
        self.while_away(self.pauses)

    def wake(self) -> None:
        pass


def point(link: Path, target: str) -> None:
    """Make ``link`` lead to a port, as udev's by-id links do; without a target it is gone."""
    link.unlink(missing_ok=True)
    if target:
        os.symlink(target, link)
