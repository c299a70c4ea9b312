"""Finding and choosing boards, and naming the program that has a port, from lists and trees made up by a test."""

import dataclasses
import errno
import json
import subprocess
from pathlib import Path

import pytest
from doctor_facts import usb_port
from serial.tools import list_ports

import biotac
from biotac.cli.main import main
from biotac.link.discovery import boards, choose, serial_ports
from biotac.link.holders import Holder, holders
from biotac.link.port_text import options_of
from biotac.link.serial_port import open_error
from biotac.wire import messages_gen as wire
from biotac.wire.identity import ascii_text, serial_text

ROOT = Path(__file__).resolve().parents[3]


ONE = [usb_port("/dev/ttyACM0", "E6605838831F5B2C"), usb_port("/dev/ttyUSB0", "A5XK3RJT", ours=False)]
TWO = [usb_port("COM10", "E6605838831F5B2C"), usb_port("COM3", "E660583883200000")]


def test_only_our_usb_ids_are_boards() -> None:
    assert [p.device for p in boards(ONE)] == ["/dev/ttyACM0"]
    assert [p.device for p in serial_ports(ONE)] == ["/dev/ttyACM0", "/dev/ttyUSB0"]


def test_of_a_macs_two_names_the_one_that_does_not_wait_is_kept() -> None:
    both = [usb_port("/dev/tty.usbmodem1"), usb_port("/dev/cu.usbmodem1"), usb_port("/dev/tty.usbmodem2")]
    assert [p.device for p in boards(both)] == ["/dev/cu.usbmodem1", "/dev/tty.usbmodem2"]


@pytest.mark.parametrize("number", ["E6605838831F5B2C", "e6605838831f5b2c"])
def test_a_board_is_chosen_by_its_serial_number(number: str) -> None:
    assert choose(number, TWO) == "COM10"


@pytest.mark.parametrize(
    ("entries", "number", "message"),
    [
        ([], None, r"no board on any USB port; plug one in"),
        ([ONE[1]], "A5XK3RJT", r"no board with serial number A5XK3RJT on any USB port"),
        (ONE, "0", r"no board has serial number 0; expected one of serial:E6605838831F5B2C on /dev/ttyACM0"),
        (TWO, None, r"found 2 boards: serial:E660583883200000 on COM3, serial:E6605838831F5B2C on COM10; name one"),
    ],
)
def test_what_cannot_be_chosen_is_said_with_what_is_there(entries, number, message: str) -> None:
    with pytest.raises(biotac.PortError, match=message):
        choose(number, entries)


def test_open_without_a_port_opens_the_only_board(scripted_board, hello, monkeypatch) -> None:
    board = scripted_board(lambda i, p: hello(p) if i == wire.HelloRequest.ID else b"")
    monkeypatch.setattr(
        list_ports,
        "comports",
        lambda: [usb_port(board.path, "E6605838831F5B2C"), usb_port("/dev/ttyNOWHERE", ours=False)],
    )
    for port in (None, "serial:E6605838831F5B2C"):
        with biotac.open(port) as hand:
            assert hand.port == board.path


def test_a_serial_number_in_a_hello_is_that_of_usb() -> None:
    def text(raw: bytes) -> str:
        facts = dict.fromkeys((field.name for field in dataclasses.fields(wire.Hello)), 0)
        return serial_text(wire.Hello(**facts | {"board_serial": tuple(raw.ljust(12, b"\0"))}))

    assert text(bytes.fromhex("E6605838831F5B2C")) == "E6605838831F5B2C"
    assert text(bytes.fromhex("E660583883200000")) == "E660583883200000"  # the zeros belong to the number
    assert text(b"posix-sim") == "posix-sim"
    assert text(bytes(range(1, 13))) == "0102030405060708090A0B0C"


def test_list_asks_boards_and_nobody_else(scripted_board, hello, monkeypatch, capsys) -> None:
    asked = {"board": 0, "other": 0}

    def answer(name: str):
        def reply(message_id: int, payload: bytes) -> bytes:
            asked[name] += 1
            return hello(payload, fingers_present=0b101) if message_id == wire.HelloRequest.ID else b""

        return reply

    board, other = scripted_board(answer("board")), scripted_board(answer("other"))
    monkeypatch.setattr(
        list_ports, "comports", lambda: [usb_port(board.path, "0102"), usb_port(other.path, "A5", ours=False)]
    )
    assert main(["list", "--json"]) == 0
    ours, theirs = json.loads(capsys.readouterr().out)["ports"]
    assert (ours["fingers"], ours["firmware"], ours["board"]) == ([0, 2], "0.1.0", "POSIX_SIM")
    assert theirs["is_board"] is False
    assert asked["board"] > 0
    assert asked["other"] == 0
    assert main(["list", "--all"]) == 0
    assert asked["other"] > 0
    assert capsys.readouterr().out.splitlines()[0].endswith("fingers 0, 2")


def test_list_ends_with_what_can_be_simulated_if_there_is_no_board(monkeypatch, capsys) -> None:
    monkeypatch.setattr(list_ports, "comports", lambda: [usb_port("/dev/ttyS0", ours=False, description="n/a")])
    assert main(["list"]) == 0
    lines = capsys.readouterr().out.splitlines()
    first, second, third, *_ = [line for line in lines if "  simulated: " not in line]  # another test's boards
    assert first == "/dev/ttyS0  not a gateway's USB id"
    assert second.endswith("or try a simulated one:")
    assert third.startswith("sim:")


# ---- the program on the port -------------------------------------------------------------------------


def test_a_plus_in_an_option_is_no_space() -> None:
    assert options_of("csv:a.csv?columns=a+b%20c.toml", ("columns",), "") == ("a.csv", {"columns": "a+b c.toml"})


@pytest.mark.skipif(not Path("/proc/self/fd").is_dir(), reason="only Linux tells who has a port open")
def test_a_busy_port_names_the_program(tmp_path: Path) -> None:
    (path := tmp_path / "ttyACM0").touch()
    (link := tmp_path / "board").symlink_to(path)
    with path.open() as port, subprocess.Popen(["cat"], stdin=subprocess.PIPE, stderr=port) as cat:
        port.close()
        assert holders(str(link)) == [Holder(cat.pid, "cat")] and holders(str(tmp_path / "nobody")) == []
        for error in (OSError(errno.EBUSY, "busy"), Exception("Could not exclusively lock port")):
            busy = open_error(str(path), error)
            assert isinstance(busy, biotac.PortBusyError)
            assert str(busy) == f"{path} is in use by cat (process {cat.pid}); close that program and try again"
    assert "in use by another program" in str(open_error("COM3", PermissionError(13, "Access is denied.")))
    forbidden = open_error("/dev/ttyACM0", PermissionError(13, "Permission denied"))
    assert "no permission" in str(forbidden) and not isinstance(forbidden, biotac.PortBusyError)


def test_two_programs_that_want_one_port_are_told_apart(scripted_board, hello) -> None:
    board = scripted_board(lambda i, p: hello(p) if i == wire.HelloRequest.ID else b"")
    with biotac.open(board.path) as hand:
        with pytest.raises(biotac.PortError, match="in use by this program itself"):
            biotac.open(board.path)
        assert not hand.warnings


# ---- versions ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "cure"), [({}, "biotac flash"), ({"wire_minor": wire.WIRE_MINOR + 1}, "pip install -U biotac-gateway")]
)
def test_another_schema_is_a_warning_and_no_error(scripted_board, hello, capsys, changes, cure: str) -> None:
    different = {"schema_hash": wire.SCHEMA_HASH ^ 1}
    board = scripted_board(lambda i, p: hello(p, **different, **changes) if i == wire.HelloRequest.ID else b"")
    with biotac.open(board.path) as hand:
        (warning,) = hand.warnings
    assert warning.code == "schema_differs"
    assert f"{wire.SCHEMA_HASH:08x}" in warning.text
    assert cure in warning.text
    assert capsys.readouterr() == ("", "")


def test_a_sensors_text_moves_no_terminal() -> None:
    assert ascii_text(b"BT00\x1b[2J\r\x07\xff\0\0") == "BT00\ufffd[2J\ufffd\ufffd\ufffd"
