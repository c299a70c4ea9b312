"""Host side of the open BioTac gateway: forces, points of contact and torques from BioTac fingertips.

>>> import biotac
>>> with biotac.open("sim:press.toml") as hand:
...     frames = hand.read(seconds=1.0)
>>> frames["force_n"].shape
(100, 3)
"""

from __future__ import annotations

from ._wire import CalibrationState, FrameFlags, PocWeights, QuantityFlags, Setting, TareReason, TareState
from .batch import MAPPED_RESULT_DTYPE, RESULT_DTYPE, compute
from .calibration import Calibration
from .compatibility import HandWarning
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
from .finger import FINGER_DTYPE, Finger
from .frames import FRAME_DTYPE, IDLE_DTYPE, PAC_DTYPE, Frame
from .hand import Hand
from .live import FingerView, Gap
from .opening import open
from .recording import Compact, Recorder, Recording, load, load_compact
from .stream import LinkStats
from .version import __version__

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
    "Compact",
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
    "compute",
    "load",
    "load_compact",
    "open",
]
