"""The facts for the checks: plain values, so that a test can make up any case."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from serial.tools.list_ports_common import ListPortInfo

from ..board.handshake import HandWarning
from ..clock import Fit
from ..errors import BiotacError
from ..link.holders import Holder
from ..wire import messages_gen as wire
from ..wire.batches import LinkStats
from ..wire.frames import StructArray
from .catalogue import Finding


@dataclass(frozen=True)
class SystemFacts:
    """Facts about this computer, found without opening a port."""

    boards: list[ListPortInfo] = field(default_factory=list)
    usb_boards: int = 0  #: devices with our USB ids, with or without a serial port; Linux only
    loaders: list[str] = field(default_factory=list)  #: where boards wait in their boot loader
    permitted: bool = True  #: this user may read and write the port
    owner: str = ""  #: of the port, in words
    holders: list[Holder] = field(default_factory=list)  #: other programs that have the port open
    modem_manager: bool = False  #: ModemManager is running
    left_alone: bool = False  #: udev makes ModemManager ignore the port


def grown(before: Any, after: Any, counter: str) -> int:
    """Increase of a message's 32-bit counter."""
    return int(getattr(after, counter) - getattr(before, counter)) % 2**32


@dataclass(frozen=True)
class ExaminedBoard:
    """A board's reports within some seconds.

    Lists of sensor states have all five fingers, in order. ``sensors`` has those that gave a serial number, including
    those of a wrong type.
    """

    hello: wire.Hello
    sensors: list[wire.SensorInfo]
    before: wire.Status
    after: wire.Status
    sensors_before: list[wire.SensorStatus]
    sensors_after: list[wire.SensorStatus]
    frames: StructArray  #: FRAME_DTYPE
    pac: StructArray  #: PAC_DTYPE
    idle: StructArray  #: IDLE_DTYPE
    stats: LinkStats
    clock: Fit | None  #: None where the board's time is no clock, as on a simulated board
    clock_resets: int
    warnings: list[HandWarning]
    chip: wire.BoardFacts | None = None  #: None: the board cannot measure itself, or is a recording

    @property
    def present(self) -> list[int]:
        """Fingers with a sensor that answered at the start."""
        return [finger for finger in range(len(self.sensors_before)) if self.hello.fingers_present >> finger & 1]

    def more(self, finger: int, counter: str) -> int:
        """Increase of one of a sensor's 32-bit counters."""
        return grown(self.sensors_before[finger], self.sensors_after[finger], counter)


@dataclass(frozen=True)
class Facts:
    port: str | None  #: None: there is nothing to open
    system: SystemFacts = field(default_factory=SystemFacts)
    error: BiotacError | None = None  #: why the port could not be opened, or was lost
    board: ExaminedBoard | None = None  #: None when it could not be examined
    expected_fingers: int | None = None
    pair: object | None = None  #: the observations of a sensor board at the other end of the leads (biotac-rig)
    leads: tuple[Finding, ...] = ()  #: and the faults of those
