"""Flashing an STM32F405 through its ROM's loader: the package stm32loader against a model of the loader (AN3155)."""

from __future__ import annotations

import os
import re
import struct
import threading
import tty
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
import serial
from deframer import Deframer
from fake_flash_board import FakeBoard
from live_board import until

from biotac.cli.main import main
from biotac.errors import FlashError, InputError, PortError
from biotac.flash.image import Image, read_image
from biotac.flash.loader_stm32 import Stm32Loader
from biotac.flash.note import find, seal
from biotac.wire import messages_gen as wire

pytest.importorskip("stm32loader")

BOARD = Path(__file__).resolve().parents[3] / "firmware/boards/f405/flash.json"
SECTORS = (0, 0x4000, 0x8000, 0xC000, 0x1_0000, *range(0x2_0000, 0x10_0001, 0x2_0000))  # RM0090, table 5
CHIP, BOOT_AT, IMAGE_AT = 0x413, 0x0800_0000, 0x0800_C000
ACK, NACK = b"\x79", b"\x1f"
FLASH_BYTES = SECTORS[-1]


class Rom:
    """The loader: 1 MiB of flash, erased in sectors, and what was done to it; or the firmware, on the same wires."""

    def __init__(self) -> None:
        self._master, self._slave = os.openpty()
        tty.setraw(self._slave)
        self.device = self.path = os.ttyname(self._slave)
        self.chip = CHIP
        self.firmware: FakeBoard | None = None
        self.stuck_at = -1  # a byte that cannot be programmed
        self.image_bytes = 70_000
        self.flash = bytearray(os.urandom(FLASH_BYTES))
        self.events: list[tuple[str, int]] = []
        self.writes_left = 1 << 30  # then its supply is gone
        threading.Thread(target=self._run, daemon=True).start()

    def _read(self, count: int) -> bytes:
        got = b""
        while len(got) < count:
            got += os.read(self._master, count - len(got))
        return got

    def _send(self, data: bytes) -> None:
        os.write(self._master, data)

    def _run(self) -> None:
        synchronized, deframer = False, Deframer()
        try:
            while True:
                byte = self._read(1)
                if self.firmware is not None and not self.firmware.in_loader:
                    synchronized = False
                    for message in deframer.feed(byte):
                        self._send(self.firmware._answer(*message))
                    continue
                if not synchronized:
                    synchronized = byte == b"\x7f"
                    self._send(ACK if synchronized else b"")
                    continue
                command = byte[0]
                good = self._read(1)[0] == command ^ 0xFF
                do = {
                    0x00: self._get,
                    0x02: self._get_id,
                    0x11: self._read_memory,
                    0x21: self._go,
                    0x31: self._write,
                    0x44: self._erase,
                }
                if not good or command not in do:
                    self._send(NACK)
                    continue
                self._send(ACK)
                do[command]()
        except OSError:
            return

    def _address(self) -> int:
        *data, checksum = self._read(5)
        assert data[0] ^ data[1] ^ data[2] ^ data[3] == checksum
        self._send(ACK)
        return int(struct.unpack(">I", bytes(data))[0]) - BOOT_AT

    def _get(self) -> None:
        commands = bytes([0x00, 0x02, 0x11, 0x21, 0x31, 0x44])
        self._send(bytes([len(commands), 0x31]) + commands + ACK)

    def _get_id(self) -> None:
        self._send(b"\x01" + struct.pack(">H", self.chip) + ACK)

    def _read_memory(self) -> None:
        at = self._address()
        count, checksum = self._read(2)
        assert count ^ 0xFF == checksum
        self._send(ACK + bytes(self.flash[at : at + count + 1]))

    def _go(self) -> None:
        self.events.append(("go", self._address()))
        if self.firmware is not None:  # it finds in flash who it is
            at = IMAGE_AT - BOOT_AT
            self.firmware.write(Image(Path(), (), find(bytes(self.flash[at : at + self.image_bytes]))), print)

    def _write(self) -> None:
        at = self._address()
        (count,) = self._read(1)
        *data, _ = self._read(count + 2)
        if self.writes_left == 0:
            os.close(self._master)
            raise OSError("no supply")
        self.writes_left -= 1
        for k, byte in enumerate(data):
            self.flash[at + k] &= byte  # programming only clears bits
            self.flash[at + k] &= 0 if at + k == self.stuck_at else 255
        self.events.append(("write", at))
        self._send(ACK)

    def _erase(self) -> None:
        (count,) = struct.unpack(">H", self._read(2))
        for sector in struct.unpack(f">{count + 1}H", self._read(2 * (count + 1))):
            self.flash[SECTORS[sector] : SECTORS[sector + 1]] = b"\xff" * (SECTORS[sector + 1] - SECTORS[sector])
            self.events.append(("erase", sector))
        self._read(1)
        self._send(ACK)


@pytest.fixture(autouse=True)
def a_pty_has_no_parity(monkeypatch: pytest.MonkeyPatch) -> None:
    real = serial.Serial

    def without(*place: Any, **options: Any) -> serial.Serial:
        if "parity" in options:
            assert (options["baudrate"], options["parity"]) == (115_200, "E")  # AN3155
            options["parity"] = "N"
        return real(*place, **options)

    monkeypatch.setattr("stm32loader.uart.serial.Serial", without)


@pytest.fixture
def rom() -> Iterator[Rom]:
    yield Rom()


@pytest.fixture
def image(tmp_path: Path) -> Callable[[int], Path]:
    """An image of so many bytes."""

    def make(size: int) -> Path:
        note = b"BIOTAC image" + struct.pack("<HH3BBB3x8x", 2, wire.Board.STM32F405, 1, 0, 0, wire.WIRE_MAJOR, 0)
        body = bytes(range(1, 251)) * (size // 250 + 1)
        path = tmp_path / "biotac-f405.bin"
        (tmp_path / "biotac-f405.flash.json").write_bytes(BOARD.read_bytes())
        path.write_bytes(seal(b"stackres" + bytes(4 * 18) + note + body[: size - 80 - len(note)]))
        return path

    return make


def test_the_image_is_written_the_settings_stay_and_where_to_begin_comes_last(rom: Rom, image) -> None:
    settings = bytes(rom.flash[SECTORS[1] : SECTORS[3]])
    path = image(70_001)
    loader = Stm32Loader(rom.device)
    assert loader.ready()
    shown: list[tuple[int, int]] = []
    loader.write(read_image(path), lambda done, total: shown.append((done, total)))
    data = path.read_bytes()
    at = IMAGE_AT - BOOT_AT
    assert rom.flash[at : at + len(data)] == data
    assert rom.flash[:8] == data[:8]
    assert bytes(rom.flash[SECTORS[1] : SECTORS[3]]) == settings
    assert [sector for kind, sector in rom.events if kind == "erase"] == [0, 3, 4]  # 16 and 64 KiB from 0xC000 on
    until(lambda: ("go", 0) in rom.events)  # which it acknowledges first
    assert rom.events[-2:] == [("write", 0), ("go", 0)]
    assert shown[-1][0] == shown[-1][1] == -(-len(data) // 256)


def test_a_supply_that_fails_leaves_nothing_to_begin_with(rom: Rom, image) -> None:
    rom.writes_left = 100
    loader = Stm32Loader(rom.device)
    assert loader.ready()
    with pytest.raises(FlashError, match="reset the board with BOOT0 high, and flash again"):
        loader.write(read_image(image(70_000)), lambda done, total: None)
    assert rom.flash[:8] == b"\xff" * 8


def test_its_command_line_would_erase_what_is_not_there() -> None:
    """`stm32loader -e -a 0x0800C000 -l 0x14000`: why the package is imported, though its licence is the GPL."""
    from stm32loader.bootloader import Stm32Bootloader

    pages = Stm32Bootloader(None, device_family="F4").pages_from_range(IMAGE_AT, IMAGE_AT + 0x1_4000)
    assert min(pages) > 0xFFFF > len(SECTORS)  # of 1 KiB from address 0 on, where AN3155 has 16 bits for a sector


def test_nobody_there_is_not_ready(tmp_path: Path) -> None:
    master, slave = os.openpty()
    loader = Stm32Loader(os.ttyname(slave))
    assert not loader.ready()
    assert re.search("0483:df11.*hold BOOT0 high", loader.cure())
    os.close(master)
    os.close(slave)


def test_a_port_that_is_not_there_is_no_disk_that_is_full(tmp_path: Path) -> None:
    with pytest.raises(PortError, match=r"no port .*ttyGONE; `biotac list`"):
        Stm32Loader(str(tmp_path / "ttyGONE")).ready()


def test_a_bin_of_another_board_or_none_is_refused(tmp_path: Path, image) -> None:
    path = image(1000)
    data = bytearray(path.read_bytes())
    data[200] ^= 1
    path.write_bytes(data)
    with pytest.raises(InputError, match="get the file again"):
        read_image(path)
    path.write_bytes(path.read_bytes().replace(data[104:112], bytes(8)))  # size and CRC, which an .elf may lack
    with pytest.raises(InputError, match="its note was never filled in"):
        read_image(path)
    path.write_bytes(seal(path.read_bytes().replace(struct.pack("<HH", 2, 5), struct.pack("<HH", 2, 2))))
    beside = path.with_suffix(".flash.json")
    beside.write_text('{"chip": "0x413"}')
    with pytest.raises(InputError, match=r"its \.bin with biotac-f405\.flash\.json beside it .*sectors_kib"):
        read_image(path)
    beside.unlink()
    with pytest.raises(InputError, match=r"a PICO.*use the build's \.uf2"):
        read_image(path)


@pytest.fixture
def running(rom: Rom, hello) -> FakeBoard:
    """A board that runs the gateway; ``rom`` is its loader."""

    def on_its_uart(answer: Any) -> Rom:
        return rom

    rom.firmware = FakeBoard(on_its_uart, hello)
    rom.firmware.board = int(wire.Board.STM32F405)
    rom.firmware.version = (0, 9, 0)
    return rom.firmware


def flash(rom: Rom, image: Path, *words: str) -> int:
    return main(["flash", f"uart:{rom.path}?baud=921600", str(image), "--backup", str(image.parent / "x.toml"), *words])


def test_a_running_board_is_flashed_over_its_uart_and_its_settings_compared(rom, running, image, capsys) -> None:
    path = image(rom.image_bytes)
    assert flash(rom, path) == 0
    assert running.events == ["loader", "write"] and running.version == (1, 0, 0)
    assert ("go", 0) in rom.events
    assert "settings match" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("wrong", "cure"),
    [
        ({"chip": 0x431}, "is 0x431; .* nothing was written; connect that board"),
        ({"stuck_at": 0xC123}, "reads back other bytes at 0x0800C100 .* flash again"),
    ],
)
def test_a_wrong_chip_and_flash_that_is_worn_out_are_told(rom, running, image, capsys, wrong, cure: str) -> None:
    vars(rom).update(wrong)
    assert flash(rom, image(rom.image_bytes)) == FlashError.exit_code
    assert re.search(cure, capsys.readouterr().err.replace("\n", " "))
    assert bool([e for e in rom.events if e[0] == "erase"]) == ("chip" not in wrong)
    assert rom.flash[:8] != image(rom.image_bytes).read_bytes()[:8]


def test_a_board_that_does_not_answer_at_this_rate_is_told_with_its_cure(
    rom, running, image, capsys, brief_silence
) -> None:
    running.answers = False
    assert flash(rom, image(rom.image_bytes)) != 0
    error = capsys.readouterr().err
    assert "baud= has to be the board's uart_bits_per_s" in error and "--no-backup" in error
    assert rom.events == []


def test_an_image_for_another_board_is_refused_before_anything_is_written(rom, running, image, capsys) -> None:
    running.board = int(wire.Board.PICO)
    assert flash(rom, image(rom.image_bytes)) == InputError.exit_code
    assert "use that board's image" in capsys.readouterr().err
    assert rom.events == []
