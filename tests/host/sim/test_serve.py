"""The simulated board for other programs: a pty of this user, or a TCP port that only hears clients with the token."""

import os
import secrets
import socket
import stat
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import parse_qs, urlsplit

import numpy as np
import pytest
from live_board import WAIT_S
from served_board import ServedBoard

import biotac
from biotac.cli.main import main
from biotac.sim.loading import load_source
from biotac.sim.serve import LOCAL, listen

# Parts that Windows lacks: modules of the standard library, and some calls.
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


PRESS = load_source("press.toml", fingers=2, seconds=60)


@pytest.fixture
def board() -> Iterator[ServedBoard]:
    board = ServedBoard(PRESS, pace=1.0, address=LOCAL)
    yield board
    board.close()


@pytest.mark.parametrize("address", [None, LOCAL])
def test_a_port_carries_the_same_frames_as_the_board_itself(address: str | None) -> None:
    served = ServedBoard(PRESS, pace=1.0, hold=True, address=address)
    rows = []
    for port in (served.path, "sim:press.toml?fingers=2"):
        with biotac.open(port) as hand:
            hand.link.release = served.release if port == served.path else hand.link.release  # type: ignore[method-assign]
            rows.append(hand.read(seconds=2.0))
    served.close()
    assert len(rows[0]) == 400
    for name in rows[0].dtype.names or ():
        np.testing.assert_array_equal(rows[0][name], rows[1][name], err_msg=name)


def test_its_pty_is_of_this_user_alone() -> None:
    served = ServedBoard(PRESS, pace=1.0)
    assert stat.S_IMODE(os.stat(served.path).st_mode) == 0o600
    served.close()
    assert not os.path.exists(served.path)


@pytest.mark.parametrize("address", [None, LOCAL])
def test_programs_come_one_after_the_other(address: str | None) -> None:
    served = ServedBoard(PRESS, pace=1.0, address=address)
    for _ in range(3):
        with biotac.open(served.path) as hand:
            assert len(hand.read(seconds=0.1))
    served.close()


def test_without_ptys_it_is_a_port_of_this_computer(monkeypatch: pytest.MonkeyPatch) -> None:
    def none_left() -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.openpty", none_left)
    served = ServedBoard(PRESS, pace=1.0)
    assert served.path.startswith(f"socket://{LOCAL}:")
    served.close()


def test_the_end_of_the_board_is_told(board: ServedBoard) -> None:
    with biotac.open(board.path) as hand:
        hand.read(seconds=0.1)
        board.close()
        with pytest.raises(biotac.DeviceLostError, match=r"socket://127\.0\.0\.1:\d+ went away"):
            hand.read(seconds=1.0)


def test_an_address_that_is_not_here_is_refused(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sim", "press.toml", "--address", "192.0.2.1"]) == biotac.PortError.exit_code
    error = capsys.readouterr().err
    assert "cannot listen on 192.0.2.1" in error and "can use the board from other computers" in error


def test_nobody_else_binds_its_port() -> None:
    with listen() as first, pytest.raises(OSError), socket.socket() as second:
        second.bind(first.getsockname())


def answer_to(port: str, token: str, wait_s: float = WAIT_S) -> bytes:
    """The board's answers to a client that sends this, and then asks which board it is."""
    with socket.create_connection(("127.0.0.1", urlsplit(port).port or 0), WAIT_S) as program:
        program.settimeout(wait_s)
        try:
            program.sendall(token.encode() + b"\0" * 40)
            return program.recv(1)
        except TimeoutError:
            return b"silence"
        except ConnectionError:
            return b""


def test_only_who_knows_the_token_is_heard(board: ServedBoard) -> None:
    token = parse_qs(urlsplit(board.path).query)["token"][0]
    assert len(token) == 32
    assert answer_to(board.path, secrets.token_hex(16)) == b""  # it hangs up
    assert answer_to(board.path, token[:-1]) == b""
    silent = socket.create_connection(("127.0.0.1", urlsplit(board.path).port or 0))  # a silent client keeps nobody out
    with silent, biotac.open(board.path) as hand:
        assert hand.fingers == [0, 1] and token not in hand.port
        # One host at a time: the next one waits, and is not heard.
        assert answer_to(board.path, token, 0.5) == b"silence"
        assert len(hand.read(seconds=0.2)) == 40


def test_the_socket_is_on_the_loopback_interface_alone(board: ServedBoard) -> None:
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
    command = [sys.executable, "-m", "biotac", "sim", "press.toml", "--address", LOCAL, "--link", str(tmp_path / "tty")]
    ended = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert ended.returncode == biotac.PortError.exit_code and "--link" in ended.stderr
