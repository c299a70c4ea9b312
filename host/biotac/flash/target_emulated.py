"""An emulated board: its process outlives a restart, and its port keeps its name."""

from __future__ import annotations

from ..errors import InputError
from ..hand.hand import Hand
from ..link.serial_port import SerialLink
from ..sim.emulated import EmulatedBoard
from ..sim.loading import load_source
from ..sim.ports import parse_sim
from .interfaces import Target

BACK_S = 10.0  # of emulated time
WORLD_S = 600.0  # the tape must outlast everything done here: time stands still after its end


class EmulatedTarget(Target):
    """The board named by an ``emu:`` PORT, started here."""

    def __init__(self, port: str) -> None:
        self.port = port
        sim = parse_sim(port, 0.0)
        if sim.board == "posix":
            raise InputError(f"{port} has no image to flash; expected a device path or emu:pico?source=SOURCE")
        source = load_source(sim.source, fingers=sim.fingers, seconds=sim.seconds or WORLD_S)
        self.board = EmulatedBoard(sim.board, source, pace=sim.pace, hold=True, image=sim.image)
        self.board.release()

    def there(self) -> bool:
        return bool(self.board.counters()["usb"]["state"] == "configured")

    def open(self) -> Hand:
        return Hand(SerialLink(self.board.path))

    def touch(self) -> None:
        self.board.say("touch at 1200 baud")

    def reopen(self) -> Hand:
        self.board.until(BACK_S, loader=None, usb={"state": "configured"})
        return self.open()

    def close(self) -> None:
        self.board.close()
