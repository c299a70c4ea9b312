"""A board that loses power or hangs and starts again, on rigs with power that a program can cut."""

from pathlib import Path
from typing import Any

from kept_board import kept_board
from stand_in import StandIn

import biotac
from biotac.hand.opening import shake_hands
from biotac.sim.loading import load_source
from biotac.sim.ports import SIM
from biotac_rig.emulated import EmulatedBoard
from rig import Rig, start

BOOT_S = 10  # of the board's time, with the second that the watchdog takes


class Restarts:
    """A rig's board, and a new Hand on it after each start."""

    def __init__(self, rig: Rig, folder: Path, world: str) -> None:
        self._rig = rig
        self._flash = folder / "flash.bin"
        path = folder / "world.toml"
        path.write_text(world)
        self._source = load_source(path)
        self._is_a_process = rig.facts.get("board") == SIM
        if not self._is_a_process:
            rig.need("power")
        self._open()

    def _open(self) -> None:
        if self._is_a_process:
            self.board: Any = kept_board(self._source, self._flash)
        else:
            self.board = start(self._rig.facts["board"], self._source, pace=0.0)
        self.link = self.board.link(self._rig.name)
        self._rig.opened.append(self.link)
        self._meet()

    def _meet(self) -> None:
        self._host: Any = StandIn(self.link)
        self.hand: biotac.Hand = shake_hands(self._host)

    def _leave(self) -> None:
        """The link is read here from now on, and by the next hand: this one is as if it had been killed."""

        def gone(data: bytes) -> None:
            raise biotac.DeviceLostError("the host was killed")

        self._host.write, self._host.close = gone, lambda: None
        self.hand.close()

    def lose_power(self) -> None:
        """Off and on again, at once: the board in this process ends, and another has the flash."""
        if isinstance(self.board, EmulatedBoard):
            self._start_by("cut power")
        else:
            self._leave()
            self.link.close()
            self._open()

    def hang(self) -> None:
        """Until the watchdog starts it."""
        self._start_by("lose interrupts")

    def _start_by(self, verb: str) -> None:
        self._leave()
        self.link.release()  # a watchdog's second passes only while time does
        before = self.board.counters()
        self.board.do(verb)
        # The stream has to be read: an unpaced board waits for the reader.
        while (now := self.board.counters())["boots"] == before["boots"] or now["usb"]["state"] != "configured":
            assert now["emulated_s"] < before["emulated_s"] + BOOT_S
            self.link.read(0.05)
        self._meet()

    def flip_saved_bit(self, save: Any) -> None:
        """``save()``, and one bit of the saved record turns over."""
        if isinstance(self.board, EmulatedBoard):
            save()
            self.board.do("flip a written bit")
            return
        before = self._flash.read_bytes()
        save()
        after = bytearray(self._flash.read_bytes())
        written = [at for at, (old, new) in enumerate(zip(before, after, strict=True)) if old != new]
        after[written[len(written) // 2]] ^= 1
        self._flash.write_bytes(after)
