"""Two emulated boards: a gateway running the flash image, and a second Pico that plays a Source as sensors.

biotac-two-boards                    prints both ports, as of two real ones; runs until Ctrl-C
biotac-two-boards "SS2 to nothing"   with a lead that ends elsewhere; leads are SCK MOSI MISO SS0..SS4
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import ExitStack, closing
from typing import Any

import numpy as np

from biotac.errors import PortError
from biotac.link.serial_port import SerialLink
from biotac.sim.source import Source
from biotac.wire.sensor_gen import SLOTS

from .emulated import EmulatedBoard, new_pty
from .process import ProcessLink
from .sensor_board import SensorBoard

NOTHING = Source("nothing", np.zeros((1, 1, len(SLOTS)), np.uint16))


class TwoPicos(EmulatedBoard):
    """A running emulator; ``path`` is the gateway's pty, ``sensor_board`` answers on the other's, ``sensor_path``.

    Without a source nothing is played, and both ports are for other programs, like those of two real boards.
    """

    def __init__(
        self,
        source: Source | None,
        *,
        pace: float,
        hold: bool,
        image: str | None = None,
        verbs: Sequence[str] = (),
    ) -> None:
        self.sensor_path = ""
        self._alone = source is None
        self.sensor_board: SensorBoard | None = None
        self._sensors = ExitStack()
        super().__init__("pico", source or NOTHING, pace=pace, hold=hold, image=image, verbs=verbs)

    def _start(self, options: list[str]) -> Any:
        image = self._tools.image.parent.parent / "sensor-board" / "biotac-sensor.bin"
        if not image.is_file():
            raise PortError(f"no image at {image}; build it as firmware/sensor_board/README.md says")
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
            self._sensors.close()
            raise
        return process

    def _plug(self, process: Any, path: str) -> None:
        """Plug in the sensors and feed the start of the tape, before the gateway gets power."""
        if process.stdout.readline().split() != [b"sensor", path.encode()]:
            return  # the code that waits for the gateway's pty reports the error
        if not self._alone:
            link = SerialLink(path)
            link.patience = ProcessLink.patience
            self.sensor_board = self._sensors.enter_context(closing(SensorBoard(link)))
            self.sensor_board.plug(self.source)
            self._sensors.enter_context(self.sensor_board.feeding())
        process.stdin.write(b"power\n")
        process.stdin.flush()

    def close(self) -> None:
        super().close()  # first: the feeding thread may be waiting for it
        self._sensors.close()


def main() -> int:
    """Start them with the leads of the command line, and wait."""
    boards = TwoPicos(None, pace=1.0, hold=False)
    try:
        for lead in sys.argv[1:]:
            boards.do(f"lead {lead}")
        print(f"--port {boards.path} --sensor-port {boards.sensor_path}", flush=True)
        while not boards.over:
            boards.receive(None)
    except KeyboardInterrupt:
        pass
    finally:
        boards.close()
    return 0


if __name__ == "__main__":
    sys.exit(main())
