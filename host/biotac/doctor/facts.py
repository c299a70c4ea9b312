"""What the checks judge. Plain values, so that a test can make any case up."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ..clock import Fit
from ..errors import BiotacError
from ..hand.compatibility import HandWarning
from ..link.discovery import SerialPort
from ..link.holders import Holder
from ..wire import messages_gen as wire
from ..wire.batches import LinkStats
from ..wire.frames import StructArray


@dataclass(frozen=True)
class SystemFacts:
    """This computer, without opening anything."""

    boards: list[SerialPort] = field(default_factory=list)
    usb_boards: int = 0  #: devices with our ids, whether they have a port or not; Linux only
    loaders: list[str] = field(default_factory=list)  #: where boards wait in their loader
    permitted: bool = True  #: this user may read and write the port
    owner: str = ""  #: of the port, in words
    holders: list[Holder] = field(default_factory=list)  #: who else has the port open
    modem_manager: bool = False  #: it is running
    left_alone: bool = False  #: by it, as udev has been told


def grown(before: Any, after: Any, counter: str) -> int:
    """By how much a 32-bit counter of a message has."""
    return int(getattr(after, counter) - getattr(before, counter)) % 2**32


@dataclass(frozen=True)
class BoardFacts:
    """What a board said within some seconds. Lists of sensor states are by finger, all five; ``sensors`` has those that
    gave a serial number, those of a wrong type, too."""

    hello: wire.Hello
    sensors: list[wire.SensorInfo]
    before: wire.Status
    after: wire.Status
    sensors_before: list[wire.SensorStatus]
    sensors_after: list[wire.SensorStatus]
    frames: StructArray  #: FRAME_DTYPE
    idle: StructArray  #: IDLE_DTYPE
    stats: LinkStats
    clock: Fit | None  #: None where the board's time is no clock: a simulated one
    clock_resets: int
    warnings: list[HandWarning]

    @property
    def present(self) -> list[int]:
        """Fingers whose sensor answered at first."""
        return [finger for finger in range(len(self.sensors_before)) if self.hello.fingers_present >> finger & 1]

    def more(self, finger: int, counter: str) -> int:
        """By how much a sensor's 32-bit counter has grown."""
        return grown(self.sensors_before[finger], self.sensors_after[finger], counter)

    def more_of_board(self, counter: str) -> int:
        """By how much one of the board's has grown."""
        return grown(self.before, self.after, counter)


@dataclass(frozen=True)
class PairFacts:
    """What the sensor board at the other end of the leads heard meanwhile; all five of its sensors are plugged in."""

    before: wire.EmuStatus
    after: wire.EmuStatus
    serials: tuple[str, ...]  #: by finger, as they were plugged in

    def more(self, counter: str) -> int:
        """By how much one of its 32-bit counters has grown."""
        return grown(self.before, self.after, counter)


@dataclass(frozen=True)
class Facts:
    """Everything about one port."""

    port: str | None  #: None: there is nothing to open
    system: SystemFacts = field(default_factory=SystemFacts)
    error: BiotacError | None = None  #: why it could not be opened, or was lost
    board: BoardFacts | None = None  #: None when it could not be examined
    expected_fingers: int | None = None
    pair: PairFacts | None = None  #: where the sensors are a board of ours
