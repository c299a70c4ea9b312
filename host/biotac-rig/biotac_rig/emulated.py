"""The emulated board: a microcontroller's own flash image in an emulator, playing a Source.

The emulator is a Node program in this project's repository (tools/emulator/), not part of the installed package. It
has the board's link on a pty created here.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from biotac.errors import DeviceLostError, PortError
from biotac.sim.source import Source

from .process import ProcessBoard

# Another reader of the link hears the board too: an answer may already be there.
LISTEN_S = 0.005


PAGE = "host/docs/develop/pico2.md"  # how to fetch the Pico 2's
BOARDS = ("pico", "pico2")


@dataclass(frozen=True)
class Tools:
    node: str
    program: Path
    sensors: Path
    image: Path
    chip: list[str]


class EmulatedBoard(ProcessBoard):
    """A running emulator; ``path`` is a pty that any serial program can open.

    With ``uart``, a second pty, ``uart_path``, is connected to the pins of the board's UART. ``verbs``, which rig.mjs
    lists, are done before it boots.
    """

    _pass_fds: tuple[int, ...] = ()  # besides those of the two ptys

    def __init__(
        self,
        board: str,
        source: Source,
        *,
        pace: float,
        hold: bool,
        live: bool = False,
        image: str | None = None,
        uart: bool = False,
        verbs: Sequence[str] = (),
    ) -> None:
        self._tools = find_tools(board, image)
        self._verbs = verbs
        self._has_uart = uart
        self.uart_path = ""
        super().__init__(source, pace=pace, hold=hold, live=live)

    def _start(self, options: list[str]) -> Any:
        tools = self._tools
        command = [tools.node, str(tools.program), "--image", str(tools.image), "--wasm", str(tools.sensors)]
        command += [*tools.chip, *options]
        command += [f"--do={verb}" for verb in self._verbs]
        with ExitStack() as ptys:
            master, path = ptys.enter_context(new_pty())
            command += ["--pty", path, "--master", str(master)]
            fds = [master, *self._pass_fds]
            if self._has_uart:
                uart_master, self.uart_path = ptys.enter_context(new_pty())
                command += ["--uart-master", str(uart_master)]
                fds.append(uart_master)
            pipe = subprocess.PIPE
            how: dict[str, Any] = {"pass_fds": fds, "start_new_session": True}
            return subprocess.Popen(command, stdin=pipe, stdout=pipe, stderr=pipe, **how)

    def plan(self, seconds: float, verb: str) -> None:
        """Schedule an event of the board for when the sensors' time reaches ``seconds``; see rig.mjs for verbs."""
        self.send_line(f"@{seconds:.9f} {verb}")

    def do(self, verb: str) -> None:
        """Make an event happen to the board before any later write to the link; see rig.mjs.

        Verbs and the link are separate pipes: without waiting for an answer, the link could overtake the verb.
        """
        self.send_line(verb)
        self.counters()

    def counters(self) -> dict[str, Any]:
        """The emulator's counters: time, resets, latency, violations of the rules."""
        return dict(self._asked("counters")[1])

    def arrivals(self) -> list[tuple[int, int, float]]:
        """For each FRAME: its t_us, its finger, and the board's time in us when the last byte reached the host."""
        return [tuple(arrival) for arrival in self._asked("arrivals")[1]]

    def until(self, seconds: float, **counters: Any) -> dict[str, Any]:
        """Wait until these counters have these values; return all counters.

        Raises DeviceLostError if they do not within ``seconds`` of emulated time. Emulated time stands still while it
        is held, or waits for the program that has the link open to read.
        """
        word, facts = self._asked(f"until {seconds:.6f} {json.dumps(counters)}")
        if word == "never":
            seen = {name: facts.get(name) for name in counters}
            raise DeviceLostError(
                f"the emulated board came to {seen} within {seconds:g} s of its time: expected {counters}"
            )
        return dict(facts)

    def _asked(self, line: str) -> tuple[str, Any]:
        self.send_line(line)
        while not self._answers:
            self.receive(LISTEN_S)
        word, _, text = self._answers.pop(0).partition(" ")
        return word, json.loads(text)


@contextmanager
def new_pty() -> Iterator[tuple[int, str]]:
    """A new pty: the master's descriptor, to be passed on, and the path of the other side.

    The master cannot be read while nobody has the other side open; this serves as the board's DTR.
    """
    import pty  # here, because Windows has neither
    import tty

    master, slave = pty.openpty()
    try:
        tty.setraw(slave)  # from the start: an echoing terminal would send our own frames back to us
        path = os.ttyname(slave)
        os.close(slave)
        os.set_blocking(master, False)
        yield master, path
    finally:
        os.close(master)


def find_tools(board: str, image: str | None) -> Tools:
    """The files that the emulator needs. Raises PortError, with a remedy, if one is missing."""
    if board not in BOARDS:
        raise PortError(f"no emulated board {board!r}: expected emu:pico or emu:pico2")
    if os.name != "posix":
        raise PortError("emulated boards need a pty, which this system lacks; use Linux or macOS")
    folder = find_folder()
    root = folder.parent.parent
    node = shutil.which("node")
    if node is None:
        raise PortError("node, which runs the emulator, is missing; install it (Debian: apt-get install nodejs npm)")
    sensors = root / "build" / "emulator" / "sensors.wasm"
    if not sensors.is_file() or not (root / "tools" / "node_modules" / "rp2040js").is_dir():
        raise PortError(f"the emulator is not ready; run {folder / 'prepare'} once")
    path = Path(image) if image else root / "build" / board / f"biotac-{board}.bin"
    if not path.is_file():
        build = f"cmake -S {root / 'firmware'} --preset {board} && cmake --build {path.parent}"
        cure = "check the path" if image else f"build it: {build}"
        raise PortError(f"no image at {path}; {cure}")
    return Tools(node, folder / "main.mjs", sensors, path, chip_of(board))


def chip_of(board: str) -> list[str]:
    """Options of the emulator. Only the Pico's chip comes with the repository."""
    if board == "pico":
        return []
    fetched = os.environ.get("BIOTAC_RP2350JS", "")
    if not Path(fetched).is_file():
        seen = f"nothing at {fetched}" if fetched else "BIOTAC_RP2350JS is not set"
        raise PortError(f"the Pico 2's emulator is fetched by hand ({PAGE}), and {seen}: expected the file made there")
    return ["--chip", "rp2350", "--emulator", fetched]


def find_folder() -> Path:
    """tools/emulator of the repository that contains the working directory, this environment or this file."""
    override = os.environ.get("BIOTAC_EMULATOR")
    if override:
        folders = [Path(override)]
    else:
        starts = [Path.cwd(), Path(sys.prefix), Path(__file__).resolve()]
        folders = [folder / "tools" / "emulator" for start in starts for folder in (start, *start.parents)]
    for folder in folders:
        if (folder / "main.mjs").is_file():
            return folder.resolve()
    raise PortError(
        f"no emulator in {folders[0]}; it is in the project's repository: run from inside a clone, or set "
        "BIOTAC_EMULATOR to its tools/emulator"
    )
