"""Facts for the doctor to diagnose, made up: a healthy board of two fingers, with or without a change."""

import dataclasses
from typing import Any

import numpy as np
from serial.tools.list_ports_common import ListPortInfo

from biotac.clock import Fit
from biotac.doctor import ExaminedBoard, Facts
from biotac.doctor.connection import release
from biotac.version import __version__
from biotac.wire import messages_gen as wire
from biotac.wire.batches import LinkStats
from biotac.wire.frames import FRAME_DTYPE, IDLE_DTYPE, PAC_DTYPE

PORT = "/dev/ttyACM0"

RELEASE = release(__version__)


def usb_port(device: str, serial: str | None = None, *, ours: bool = True, description: str = "a port") -> ListPortInfo:
    """pyserial's entry for a port: our board's, or something else's."""
    info = ListPortInfo(device, skip_link_detection=True)
    info.description, info.serial_number = description, serial
    if ours:
        info.vid, info.pid = wire.USB_VENDOR, wire.USB_PRODUCT
    return info


def message(kind: Any, **values: Any) -> Any:
    fields = {f.name: (0,) * 5 if f.name == "finger_faults" else 0 for f in dataclasses.fields(kind)}
    return kind(**fields | values)


def info(finger: int, serial: str, flex: str = "20", software: str = "0210") -> wire.SensorInfo:
    ascii_of = {"serial": serial, "flex_version": flex, "software_version": software}
    return message(wire.SensorInfo, finger=finger, present=1, **{k: tuple(v.encode()) for k, v in ascii_of.items()})


def rounds(fingers: tuple[int, ...] = (0, 1), n: int = 300, step_us: int = 10_000) -> np.ndarray:
    frames = np.zeros(n * len(fingers), FRAME_DTYPE)
    for k, finger in enumerate(fingers):
        own = slice(k, None, len(fingers))
        frames["finger"][own] = finger
        frames["seq"][own] = np.arange(n)
        frames["t_us"][own] = np.arange(n) * step_us
    noise = np.random.default_rng(7).integers(-1, 2, (len(frames), 22))
    frames["counts"] = 3000 + noise[:, :19]
    for k, name in enumerate(("pdc", "tac", "tdc")):
        frames[name] = 2000 + noise[:, 19 + k]
    return frames


def dynamic_pressure(fingers: tuple[int, ...] = (0, 1), n: int = 300) -> np.ndarray:
    pac = np.zeros(n * len(fingers), PAC_DTYPE)
    pac["finger"] = np.tile(fingers, n)
    pac["pac"] = 2030 + np.random.default_rng(8).integers(-4, 5, pac["pac"].shape)
    return pac


def hello(*firmware: int, **values: Any) -> wire.Hello:
    names = ("firmware_major", "firmware_minor", "firmware_patch")
    return message(wire.Hello, slot_hz=4400, fingers=5, **dict(zip(names, firmware, strict=True)), **values)


def healthy(**changes: Any) -> ExaminedBoard:
    """Two fingers, a second, nothing to complain of."""
    states = [message(wire.SensorStatus, finger=f, tare_state=wire.TareState.REST, words_stuck=9) for f in range(5)]
    after = [dataclasses.replace(s, words_good=4400) if s.finger < 2 else s for s in states]
    after[3] = dataclasses.replace(after[3], words_stuck=4409)  # an open chip select: it reads so, and is no fault
    facts = {
        "hello": hello(*RELEASE, fingers_present=0b11),
        "sensors": [info(0, "BT00001"), info(1, "BT00002")],
        "before": message(wire.Status, uptime_s=10, fingers_present=0b11, slots_late=2**32 - 1),
        "after": message(wire.Status, uptime_s=11, fingers_present=0b11, slots_late=2**32 - 1),
        "sensors_before": states,
        "sensors_after": after,
        "frames": rounds(),
        "pac": dynamic_pressure(),
        "idle": np.empty(0, IDLE_DTYPE),
        "stats": LinkStats(1000, 200, 0, 0, 0, 0, 0),
        "clock": Fit(0.0, 1.0, 0.001, -60.0, 30.0),
        "clock_resets": 0,
        "warnings": [],
    }
    return ExaminedBoard(**facts | changes)


def board(**changes: Any) -> Facts:
    return Facts(PORT, board=healthy(**changes))
