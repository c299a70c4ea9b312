"""Host side of the open BioTac gateway: forces, points of contact and torques from BioTac fingertips.

>>> import biotac
>>> with biotac.open("sim:press.toml") as hand:
...     frames = hand.read(seconds=1.0)
>>> frames["force_n"].shape
(100, 3)
"""

from __future__ import annotations

import importlib
from typing import TYPE_CHECKING

from .core.compute import MAPPED_RESULT_DTYPE, RESULT_DTYPE, compute
from .core.finger import FINGER_DTYPE, Finger
from .errors import (
    BiotacError,
    CallbackError,
    CommandRefusedError,
    DeviceLostError,
    FlashError,
    InputError,
    NotAGatewayError,
    PortError,
    RecordingError,
    ScenarioError,
    WireVersionError,
)
from .hand.compatibility import HandWarning
from .hand.gap import Gap
from .hand.hand import Hand
from .hand.opening import open
from .hand.views import FingerView
from .keep import Calibration
from .recording import Recorder, Recording, load
from .version import __version__
from .wire.batches import LinkStats
from .wire.frames import FRAME_DTYPE, IDLE_DTYPE, PAC_DTYPE, Frame
from .wire.messages_gen import CalibrationState, FrameFlags, PocWeights, QuantityFlags, Setting, TareReason, TareState

if TYPE_CHECKING:
    from .hand import aio


def __getattr__(name: str) -> object:
    if name == "aio":  # asyncio is imported for those who use it
        return importlib.import_module(".hand.aio", __name__)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


__all__ = [
    "FINGER_DTYPE",
    "FRAME_DTYPE",
    "IDLE_DTYPE",
    "MAPPED_RESULT_DTYPE",
    "PAC_DTYPE",
    "RESULT_DTYPE",
    "BiotacError",
    "Calibration",
    "CalibrationState",
    "CallbackError",
    "CommandRefusedError",
    "DeviceLostError",
    "Finger",
    "FingerView",
    "FlashError",
    "Frame",
    "FrameFlags",
    "Gap",
    "Hand",
    "HandWarning",
    "InputError",
    "LinkStats",
    "NotAGatewayError",
    "PocWeights",
    "PortError",
    "QuantityFlags",
    "Recorder",
    "Recording",
    "RecordingError",
    "ScenarioError",
    "Setting",
    "TareReason",
    "TareState",
    "WireVersionError",
    "__version__",
    "aio",
    "compute",
    "load",
    "open",
]
