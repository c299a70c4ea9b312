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

if TYPE_CHECKING:
    from .core.compute import MAPPED_RESULT_DTYPE as MAPPED_RESULT_DTYPE
    from .core.compute import RESULT_DTYPE as RESULT_DTYPE
    from .core.compute import compute as compute
    from .core.compute import per_frame as per_frame
    from .core.finger import FINGER_DTYPE as FINGER_DTYPE
    from .core.finger import Finger as Finger
    from .errors import BiotacError as BiotacError
    from .errors import CallbackError as CallbackError
    from .errors import CommandRefusedError as CommandRefusedError
    from .errors import DeviceLostError as DeviceLostError
    from .errors import FlashError as FlashError
    from .errors import InputError as InputError
    from .errors import NotAGatewayError as NotAGatewayError
    from .errors import PortBusyError as PortBusyError
    from .errors import PortError as PortError
    from .errors import RecordingError as RecordingError
    from .errors import RecordingWarning as RecordingWarning
    from .errors import ScenarioError as ScenarioError
    from .errors import WireVersionError as WireVersionError
    from .hand import aio as aio
    from .hand.compatibility import HandWarning as HandWarning
    from .hand.faults import Faults as Faults
    from .hand.gap import Gap as Gap
    from .hand.hand import Hand as Hand
    from .hand.opening import open as open
    from .hand.views import FingerView as FingerView
    from .keep import Calibration as Calibration
    from .recording import Recorder as Recorder
    from .recording import Recording as Recording
    from .recording import load as load
    from .version import __version__ as __version__
    from .wire.batches import Batch as Batch
    from .wire.batches import LinkStats as LinkStats
    from .wire.frames import FRAME_DTYPE as FRAME_DTYPE
    from .wire.frames import IDLE_DTYPE as IDLE_DTYPE
    from .wire.frames import PAC_DTYPE as PAC_DTYPE
    from .wire.frames import Frame as Frame
    from .wire.messages_gen import Bands as Bands
    from .wire.messages_gen import CalibrationState as CalibrationState
    from .wire.messages_gen import FaultFlags as FaultFlags
    from .wire.messages_gen import ForceModel as ForceModel
    from .wire.messages_gen import FrameFlags as FrameFlags
    from .wire.messages_gen import PocWeights as PocWeights
    from .wire.messages_gen import QuantityFlags as QuantityFlags
    from .wire.messages_gen import Setting as Setting
    from .wire.messages_gen import Status as Status
    from .wire.messages_gen import Tare as Tare
    from .wire.messages_gen import TareReason as TareReason
    from .wire.messages_gen import TareState as TareState
    from .wire.messages_gen import Touch as Touch

#: The names of each module, which is imported when one of them is first used.
_HOMES = {
    ".core.compute": "MAPPED_RESULT_DTYPE RESULT_DTYPE compute per_frame",
    ".core.finger": "FINGER_DTYPE Finger",
    ".errors": "BiotacError CallbackError CommandRefusedError DeviceLostError FlashError InputError "
    "NotAGatewayError PortBusyError PortError RecordingError RecordingWarning ScenarioError WireVersionError",
    ".hand.aio": "aio",
    ".hand.compatibility": "HandWarning",
    ".hand.faults": "Faults",
    ".hand.gap": "Gap",
    ".hand.hand": "Hand",
    ".hand.opening": "open",
    ".hand.views": "FingerView",
    ".keep": "Calibration",
    ".recording": "Recorder Recording load",
    ".version": "__version__",
    ".wire.batches": "Batch LinkStats",
    ".wire.frames": "FRAME_DTYPE IDLE_DTYPE PAC_DTYPE Frame",
    ".wire.messages_gen": "Bands CalibrationState Event EventKind FaultFlags ForceModel FrameFlags PocWeights "
    "QuantityFlags Setting Status Tare TareReason TareState Touch",
}
_HOME_OF = {name: module for module, names in _HOMES.items() for name in names.split()}

__all__ = sorted(_HOME_OF)


def __getattr__(name: str) -> object:
    if name not in _HOME_OF:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    module = importlib.import_module(_HOME_OF[name], __name__)
    value = globals()[name] = getattr(module, name, module)
    return value


def __dir__() -> list[str]:
    return [*globals(), *__all__]
