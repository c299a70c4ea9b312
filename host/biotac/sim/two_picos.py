"""Two emulated boards: the gateway's flash image, and in place of its sensors a second Pico that plays a Source."""

from __future__ import annotations

import subprocess
import threading
from contextlib import suppress

import numpy as np

from ..errors import BiotacError, PortError
from ..link.serial_port import SerialLink
from ..wire.sensor_gen import SLOTS
from .emulated import EmulatedBoard, new_pty
from .sensor_board import SensorBoard
from .source import Source

NOTHING = Source("nothing", np.zeros((1, 1, len(SLOTS)), np.uint16))


class _EmulatedSensorLink(SerialLink):
    patience = 60.0


class TwoPicos(EmulatedBoard):
    """A running emulator; ``path`` is the gateway's pty, ``sensor_board`` answers on the other's, ``sensor_path``.

    Without a source nothing is played: both ports are for other programs, as two real boards' would be.
    """

    def __init__(self, source: Source | None, *, pace: float, hold: bool, image: str | None = None) -> None:
        self.sensor_path = ""
        self._alone = source is None
        self._ended = threading.Event()
        self._feeding: threading.Thread | None = None
        self.sensor_board: SensorBoard | None = None
        super().__init__("pico", source or NOTHING, pace=pace, hold=hold, image=image)

    def _start(self, options: list[str]) -> subprocess.Popen[bytes]:
        image = self._tools.image.parent.parent / "pico-sensor" / "biotac-sensor.bin"
        if not image.is_file():
            raise PortError(f"no image at {image}; build it as firmware/boards/pico_sensor/README.md says")
        with new_pty() as (master, path):
            self._pass_fds = (master,)
            self.sensor_path = path
            more = ["--endless"] if self._alone else []
            more += ["--sensor", str(image), "--sensor-pty", path, "--sensor-master", str(master)]
            process = super()._start([*options, *more])
        try:
            self._plug(process, path)
        except BaseException:
            process.kill()
            raise
        return process

    def _plug(self, process: subprocess.Popen[bytes], path: str) -> None:
        """Sensors and the begin of their tape are there before the gateway has power."""
        assert process.stdout is not None and process.stdin is not None
        if process.stdout.readline().split() != [b"sensor", path.encode()]:
            return  # its last words are for whoever waits for the gateway's pty
        if not self._alone:
            self.sensor_board = SensorBoard(_EmulatedSensorLink(path))
            self.sensor_board.plug(self.source)
            self.sensor_board.feed(until_full=True)
            self._feeding = threading.Thread(target=self._feed, name="biotac sensor board", daemon=True)
        process.stdin.write(b"power\n")
        process.stdin.flush()
        if self._feeding is not None:
            self._feeding.start()

    def _feed(self) -> None:
        assert self.sensor_board is not None
        with suppress(BiotacError):  # the emulator is gone, and its link says so
            self.sensor_board.feed(ended=self._ended)

    def close(self) -> None:
        """See SimBoard.close."""
        self._ended.set()
        super().close()
        if self._feeding is not None:
            self._feeding.join()
        if self.sensor_board is not None:
            self.sensor_board.close()
