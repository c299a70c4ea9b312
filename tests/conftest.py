"""Fixtures of several test folders: a scripted board on a pty, and the path of the real recordings."""

import gc
import os
import pty
import re
import select
import shutil
import threading
import time
import tty
from collections import Counter, defaultdict
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from deframer import Deframer
from served_board import ServedBoard

from biotac.link.serial_port import SerialLink
from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode

SHARED_DATA = Path(__file__).resolve().parents[2] / "shared" / "data"

Answer = Callable[[int, bytes], bytes]


def pytest_addoption(parser: pytest.Parser) -> None:
    """Here and not in tests/hil: pytest asks only the outermost conftest files for options."""
    parser.addoption("--rig", action="append", help="run tests/hil against this rig only; may be repeated")
    parser.addoption("--image", help="a Pico image, for tests/emulator/test_hazards.py")
    parser.addoption("--port", help="a real board's port, for the rigs 'real' and 'bench' of tests/hil")
    parser.addoption("--sensor-port", help="port of the sensor board that is wired to it, for the rig 'bench'")
    parser.addoption("--image-command", default="", help="what starts a simulated board, for the rig 'image'")


def pytest_report_header(config: pytest.Config) -> list[str]:
    """Name tests/hil as left out: without a port, pytest does not even collect its tests."""
    return [] if config.getoption("--port") else ["tests/hil: no --port, so no real board is tested"]


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup() -> Iterator[None]:
    """A test that lacks a compiler or another program says so and is left out; CI has them all."""
    try:
        yield
    except FileNotFoundError as missing:
        program = str(missing.filename)
        if os.environ.get("BIOTAC_CI") or os.sep in program or shutil.which(program):
            raise
        pytest.skip(f"no {program} on the PATH")


pytest_runtest_call = pytest_runtest_setup


def pytest_terminal_summary(terminalreporter: Any) -> None:
    """Passed tests of each rig of tests/hil, and the tests left out, by the board's missing ability."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for outcome in ("passed", "failed", "error", "skipped"):
        for report in terminalreporter.stats.get(outcome, []):
            rig = dict(report.user_properties).get("rig") if hasattr(report, "user_properties") else None
            if rig is not None:
                why = report.longrepr[2].removeprefix(f"Skipped: {rig}: ") if outcome == "skipped" else ""
                counts[rig][f"left out: {why.removeprefix('Skipped: ')}" if why else outcome] += 1
    for rig, reported in counts.items():
        terminalreporter.section(f"rig {rig}")
        for what, count in reported.items():
            terminalreporter.line(f"{count:5} {what}")


@pytest.fixture(scope="session", autouse=True)
def patience() -> Iterator[None]:
    """A board's answer is awaited for minutes, however busy this computer is."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(SerialLink, "patience", 60.0)  # of a cable, whose far end is another process here
        yield


@pytest.fixture
def time_passes(monkeypatch: pytest.MonkeyPatch) -> Callable[[], bytes]:
    """For boards that answer only some requests: the string returned here, in place of an answer, ends the wait.
    The host's clock jumps ahead, and an empty packet makes the host read it.
    """
    ahead_s = 0.0

    def jump() -> bytes:
        nonlocal ahead_s
        ahead_s += 3600.0
        return b"\0"

    real_s = time.monotonic
    monkeypatch.setattr(time, "monotonic", lambda: real_s() + ahead_s)
    monkeypatch.setattr(SerialLink, "patience", 1.0)  # a command waits for a condition, which no clock ends
    return jump


@pytest.fixture
def interrupt_at(monkeypatch: pytest.MonkeyPatch) -> Callable[[Callable[[int, str], bool]], None]:
    """Lets Ctrl-C come, as Python delivers it, at a verb's step, by number and text; those that read do not count."""

    def at(is_due: Callable[[int, str], bool]) -> None:
        steps = 0

        def interrupt(self: object, text: str) -> None:
            nonlocal steps
            assert ": -" not in text  # a share of what is to be done
            steps += not text.startswith("reading")
            if is_due(steps, text):
                raise KeyboardInterrupt

        monkeypatch.setattr("biotac.cli.progress.Progress.show", interrupt)  # a signal comes at a time, not at a step

    return at


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Folders with the longest files go first, so that no process has one left at the end (tools/steps.sh)."""
    longest = re.compile(r"tests/(emulator|host/view|host/calibrate|stability|hil|faults|liveness)/")
    items.sort(key=lambda item: not longest.match(item.nodeid))


def pytest_collection_finish() -> None:
    """Modules stay to the end: from here on garbage is looked for among what tests make, in an eighth less of CPU."""
    gc.collect()
    gc.freeze()


class ScriptedBoard:
    """The far end of a pty: hands every good frame to a function and writes the bytes returned.
    ``frames`` splits bytes in place of a Deframer, for a board with messages of other lengths."""

    def __init__(self, answer: Answer, greeting: bytes = b"", frames: Any = None) -> None:
        self._frames = frames or Deframer()
        self._master: int | None
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        self._answer = answer
        self._sending = threading.Lock()
        self._stop_read, self._stop_write = os.pipe()
        self._thread = threading.Thread(target=self._run, daemon=True)
        if greeting:
            self.send(greeting)
        self._thread.start()

    def _run(self) -> None:
        while True:
            ready, _, _ = select.select([self._master, self._stop_read], [], [])
            if self._stop_read in ready:
                return
            for message_id, payload in self._frames.feed(os.read(self._master, 4096)):
                reply = self._answer(message_id, payload)
                if reply:
                    self.send(reply)

    def send(self, data: bytes) -> None:
        """Write this, in one piece."""
        assert self._master is not None
        with self._sending:
            while data:  # a process that was stopped has written a part
                data = data[os.write(self._master, data) :]

    def hang_up(self) -> None:
        """The far end goes away, as with a cable that is pulled."""
        if self._master is not None:
            os.write(self._stop_write, b"x")
            self._thread.join()
            for fd in (self._master, self._slave, self._stop_read, self._stop_write):
                os.close(fd)
        self._master = None

    def close(self) -> None:
        self.hang_up()


def hello_for(request: bytes, **changes: int) -> bytes:
    """A HELLO frame that answers a HELLO_REQUEST payload."""
    asked = wire.HelloRequest.unpack(request)
    facts = {
        "req_id": asked.req_id,
        "nonce": asked.nonce,
        "wire_major": wire.WIRE_MAJOR,
        "wire_minor": wire.WIRE_MINOR,
        "schema_hash": wire.SCHEMA_HASH,
        "firmware_major": 0,
        "firmware_minor": 1,
        "firmware_patch": 0,
        "board": int(wire.BoardKind.POSIX_SIM),
        "board_serial": (0,) * 12,
        "boot_id": 1,
        "slot_hz": 4400,
        "fingers_present": 1,
        "image_crc32": 0xFFFFFFFF,
        "fingers": 5,
        "map_bytes": 20480,
        "board_name": (0,) * 16,
    }
    return encode(wire.Hello.ID, wire.Hello(**(facts | changes)).pack())


@pytest.fixture
def scripted_board() -> Iterator[Callable[..., ScriptedBoard]]:
    """Factory of scripted boards that are closed after the test."""
    boards: list[ScriptedBoard] = []

    def make(answer: Answer, greeting: bytes = b"", frames: Any = None) -> ScriptedBoard:
        boards.append(ScriptedBoard(answer, greeting, frames))
        return boards[-1]

    yield make
    for board in boards:
        board.close()


@pytest.fixture
def port() -> Iterator[str]:
    """Port of a simulated board with two fingers, for one program after another."""
    board = ServedBoard(load_source("press.toml", fingers=2, seconds=600), pace=1.0)
    yield board.path
    board.close()


@pytest.fixture(scope="session")
def hello() -> Callable[..., bytes]:
    """Makes HELLO frames."""
    return hello_for


@pytest.fixture(scope="session")
def shared_data() -> Path:
    """Folder of real recordings; they are not ours to copy, so the test is skipped without them."""
    if not SHARED_DATA.is_dir():
        pytest.skip(f"no real recordings at {SHARED_DATA}: they may not be copied into this repository")
    return SHARED_DATA
