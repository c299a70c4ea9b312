"""Host side of the open BioTac gateway: forces, points of contact and torques from BioTac fingertips.

>>> import biotac
>>> with biotac.open("sim:press.toml") as hand:
...     frames = hand.read(seconds=1.0)
>>> frames["force_n"].shape
(100, 3)
"""

from __future__ import annotations

from ._wire import FrameFlags, PocWeights, Setting
from .errors import (
    BiotacError,
    CommandRefusedError,
    DeviceLostError,
    InputError,
    NotAGatewayError,
    PortError,
    RecordingError,
    ScenarioError,
    WireVersionError,
)
from .frames import FRAME_DTYPE, PAC_DTYPE, Frame
from .hand import Hand, LinkStats
from .link import open_link
from .recording import Recorder, Recording, load
from .version import __version__

__all__ = [
    "FRAME_DTYPE",
    "PAC_DTYPE",
    "BiotacError",
    "CommandRefusedError",
    "DeviceLostError",
    "Frame",
    "FrameFlags",
    "Hand",
    "InputError",
    "LinkStats",
    "NotAGatewayError",
    "PocWeights",
    "PortError",
    "Recorder",
    "Recording",
    "RecordingError",
    "ScenarioError",
    "Setting",
    "WireVersionError",
    "__version__",
    "load",
    "open",
]


def open(port: str, *, pace: float = 0.0) -> Hand:
    """Open a board and shake hands.

    ``port`` is a device path (``/dev/ttyACM0``, ``COM3``) or ``sim:SOURCE`` for a simulated board,
    where SOURCE is a scenario (``press.toml``) or a recording of counts (``.npz``, ``.btd``).
    ``pace`` is for simulated boards: device seconds per second, 0 for as fast as this side reads.

    The source's settings (an emulated finger's own gains) and stored tare are given to a simulated
    board before it starts, as one would to a real one.

    Raises PortError, NotAGatewayError, WireVersionError, or InputError for a source that cannot be
    played.
    """
    from .link.setup import prepare

    hand = Hand(open_link(port, pace=pace))
    return prepare(hand)
