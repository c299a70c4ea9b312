"""The simulated board without a pty, as on Windows: a loopback socket, on which only who has the secret is heard."""

from __future__ import annotations

import os
import secrets
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest

import biotac
from biotac.sim import SimFinger, world
from biotac.sim.loading import load_source
from biotac.sim.process import SimBoard
from biotac.wire.native import BUILT

# What Windows has not: modules of the standard library, and some calls.
AS_ON_WINDOWS = """
import builtins, importlib, os, pkgutil, signal
absent = {"pty", "tty", "termios", "fcntl", "grp", "pwd", "resource", "readline", "syslog"}
imported = builtins.__import__
def checked(name, globals=None, *others, **named):
    importer = (globals or {}).get("__name__", "")
    assert name not in absent or not importer.startswith("biotac."), f"{importer} imports {name}"
    return imported(name, globals, *others, **named)
builtins.__import__ = checked
import biotac
del signal.SIGHUP, signal.pthread_kill, signal.pthread_sigmask, os.openpty, os.ttyname
for module in pkgutil.walk_packages(biotac.__path__, "biotac."):
    if not module.name.endswith("__main__"):
        try:
            importlib.import_module(module.name)
        except ImportError as error:  # an extra's
            print(error)
"""


@pytest.fixture(autouse=True)
def by_socket(monkeypatch: pytest.MonkeyPatch) -> None:
    command = os.environ.get("BIOTAC_SIM") or BUILT / "bin" / "biotac-sim"
    monkeypatch.setenv("BIOTAC_SIM", f"{command} --socket")


@pytest.fixture
def board() -> Iterator[SimBoard]:
    board = SimBoard(load_source("press.toml", fingers=2, seconds=60), pace=1.0, hold=False)
    yield board
    board.close()


def frames_of(port: str) -> np.ndarray:
    with biotac.open(port) as hand:
        return hand.read(seconds=2.0)


def test_both_kinds_of_link_carry_the_same_frames(monkeypatch: pytest.MonkeyPatch) -> None:
    by_socket = frames_of("sim:press.toml?fingers=2")
    monkeypatch.delenv("BIOTAC_SIM")
    by_pty = frames_of("sim:press.toml?fingers=2")
    assert len(by_socket) == 400
    for name in by_pty.dtype.names or ():
        np.testing.assert_array_equal(by_socket[name], by_pty[name], err_msg=name)


def test_a_recording_is_complete_and_ends_with_its_source(tmp_path: Path) -> None:
    file = tmp_path / "press.mcap"
    command = [sys.executable, "-m", "biotac", "record", "sim:press.toml?fingers=2&seconds=3", str(file)]
    subprocess.run(command, check=True, capture_output=True, timeout=120)
    frames = biotac.Recording(file).frames
    assert [frames["seq"][frames["finger"] == finger].tolist() for finger in (0, 1)] == [list(range(300))] * 2


@pytest.mark.parametrize("how", ["restart", "cut_power", "unplug"])
def test_a_board_comes_back_to_its_host(how: str) -> None:
    with world({"index": SimFinger(1), "thumb": SimFinger(2)}) as w:
        w.run(0.5)
        boot = w.hand.info.boot_id
        getattr(w, how)(*(() if how == "restart" else (0.3,)))
        now = w.run(1.5)
        assert now["index"].frame is not None and now["thumb"].frame is not None
        assert (w.hand.info.boot_id != boot) == (how != "unplug")


@pytest.mark.filterwarnings("ignore::biotac.ReadWarning")  # of the gap
def test_a_board_that_plays_a_tape_restarts() -> None:
    with biotac.open("sim:press.toml", reconnect=True) as hand:
        hand.read(seconds=0.3)
        boot = hand.info.boot_id
        hand.board.restart()
        assert hand.info.boot_id == boot + 1
        assert len(hand.read(seconds=0.5))


def test_the_end_of_the_process_is_told(board: SimBoard) -> None:
    with biotac.open(board.path) as hand:
        hand.read(seconds=0.1)
        board.close()
        with pytest.raises(biotac.DeviceLostError, match=r"socket://127\.0\.0\.1:\d+ went away"):
            hand.read(seconds=1.0)


def answer_to(port: str, token: str) -> bytes:
    """What the board answers to who says this, and then asks who it is."""
    with socket.create_connection(("127.0.0.1", urlsplit(port).port or 0), 5.0) as program:
        program.settimeout(0.5)
        try:
            program.sendall(token.encode() + b"\0" * 40)
            return program.recv(1)
        except TimeoutError:
            return b"silence"
        except ConnectionError:
            return b""


def test_only_who_knows_the_token_is_heard(board: SimBoard) -> None:
    token = parse_qs(urlsplit(board.path).query)["token"][0]
    assert len(token) == 32
    assert answer_to(board.path, secrets.token_hex(16)) == b""  # it hangs up
    assert answer_to(board.path, token[:-1]) == b""
    silent = socket.create_connection(
        ("127.0.0.1", urlsplit(board.path).port or 0)
    )  # who says nothing keeps nobody out
    with silent, biotac.open(board.path) as hand:
        assert hand.fingers == [0, 1] and token not in hand.port
        # One host at a time: the next one waits, and is not heard.
        assert answer_to(board.path, token) == b"silence"
        assert len(hand.read(seconds=0.2)) == 40


def test_the_socket_is_on_the_loopback_interface_alone(board: SimBoard) -> None:
    if not Path("/proc/net/tcp").is_file():
        pytest.skip("only Linux lists its sockets in /proc")
    port = urlsplit(board.path).port or 0
    rows = [line.split() for line in Path("/proc/net/tcp").read_text().splitlines()[1:]]
    listening = [
        row[1].partition(":")[0] for row in rows if row[3] == "0A" and int(row[1].partition(":")[2], 16) == port
    ]
    assert listening == ["0100007F"]


def test_each_module_is_imported_without_what_only_posix_has() -> None:
    subprocess.run([sys.executable, "-c", AS_ON_WINDOWS], check=True, timeout=120, env={**os.environ})


def test_a_link_to_a_socket_is_refused(tmp_path: Path) -> None:
    command = [sys.executable, "-m", "biotac", "sim", "press.toml", "--link", str(tmp_path / "tty")]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert ended.returncode == biotac.PortError.exit_code and "--link" in ended.stderr
