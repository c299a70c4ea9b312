"""A board to be flashed that is neither here nor emulated, images for it, and a clock that does not wait."""

import struct
import sys
import time
from collections.abc import Callable
from pathlib import Path

import pytest
from doctor_facts import usb_port
from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from biotac.errors import DeviceLostError, PortError
from biotac.flash import loader_drive
from biotac.flash.image import Image
from biotac.flash.loader_drive import linux_folders
from biotac.flash.note import seal
from biotac.hand.hand import Hand
from biotac.link.serial_port import SerialLink
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tools"))

from image import boot2, uf2

NEW_SETTING = max(wire.Setting) + 1  # one that this library does not know yet


def note(
    board: int = wire.BoardKind.PICO, version: tuple[int, int, int] = (0, 2, 0), major: int = wire.WIRE_MAJOR
) -> bytes:
    return b"BIOTAC image" + struct.pack("<HH3BBB3x8x", 2, board, *version, major, 0)


#: The words that an RP2350's boot ROM looks for: a stack, an entry, and behind the vectors IMAGE_DEF.
RP2350_START = struct.pack("<2I56x5I", 0x20001E00, 0x10000101, 0xFFFFDED3, 0x10210142, 0x1FF, 0, 0xAB123579)


def program(code: bytes, pages: int = 20, chip: str = "rp2040") -> bytes:
    """The bytes of a flash that a chip would boot."""
    start = boot2.block(b"boot") if chip == "rp2040" else RP2350_START
    return sealed((start + bytes(64) + code).ljust(pages * 256, b"\x5a"))


def sealed(image: bytes) -> bytes:
    """The image as the build leaves it; unchanged where it has not one note."""
    try:
        return seal(image)
    except ValueError:
        return image


def make_image(folder: Path, code: bytes | None = None, name: str = "new.uf2", chip: str = "rp2040") -> Path:
    path = folder / name
    own = note(wire.BoardKind.PICO if chip == "rp2040" else wire.BoardKind.PICO2)
    path.write_bytes(uf2.uf2(program(own if code is None else code, chip=chip), chip))
    return path


class FakeBoard:
    """Answers on a pty while it runs; takes an image while it is in the loader. Each event is listed in order."""

    name = "fake loader"
    serial = (1, 2, 3) + (0,) * 9

    def __init__(self, scripted_board, hello) -> None:
        self.events: list[str] = []
        self.board = int(wire.BoardKind.PICO)
        self.version = (0, 1, 0)
        self.boot_id = 7
        self.image_crc32 = 0
        self.settings = {int(s): spec.default for s, spec in wire.SETTINGS.items()} | {NEW_SETTING: 42}
        self.stored = dict(self.settings)
        self.in_loader = False
        self.answers = True
        self.silence: Callable[[], bytes] = bytes  # in place of answers
        self.accepts = True
        self.comes_back = True
        self.refuses_loader = 0  # or the error it answers
        self.refuses: set[int] = set()  # settings it refuses to change
        self.hello = hello
        self._link = scripted_board(self._answer)
        self.port = self._link.path

    def _answer(self, message_id: int, payload: bytes) -> bytes:
        if not self.answers:
            return self.silence()
        if message_id == wire.HelloRequest.ID:
            names = ("firmware_major", "firmware_minor", "firmware_patch")
            version = dict(zip(names, self.version, strict=True))
            facts = {"board": self.board, "boot_id": self.boot_id, "image_crc32": self.image_crc32}
            return self.hello(payload, board_serial=self.serial, **facts, **version)
        if message_id in (wire.GetSetting.ID, wire.SetSetting.ID):
            return self._setting(message_id, payload)
        if message_id == wire.GetCalibration.ID:
            values = tuple(wire.SETTINGS[setting].default for setting in wire.CALIBRATION_SETTINGS)
            none = wire.CalibrationMessage(payload[0], payload[1], wire.CalibrationState.NONE, (0,) * 16, 0, values)
            return encode(wire.CalibrationMessage.ID, none.pack())
        if message_id == wire.GetMap.ID:
            return encode(wire.MapInfo.ID, wire.MapInfo(payload[0], payload[1], 0, (0,) * 16, 0, 0, 0).pack())
        if message_id == wire.TakeLink.ID:
            self.events.append("take link")
        if message_id == wire.SaveSettings.ID:
            self.events.append("save")
            self.stored = dict(self.settings)
        if message_id == wire.RebootBootloader.ID and self.refuses_loader:
            return encode(wire.Reply.ID, wire.Reply(payload[0], message_id, self.refuses_loader).pack())
        if message_id == wire.RebootBootloader.ID:
            self.events.append("loader")
            self.in_loader = True
        return encode(wire.Reply.ID, wire.Reply(payload[0], message_id, 0).pack())

    def _setting(self, message_id: int, payload: bytes) -> bytes:
        req_id, key = payload[:2]
        error = 0 if key in self.settings else wire.Error.UNKNOWN_SETTING
        if message_id == wire.SetSetting.ID and not error:
            error = wire.Error.OUT_OF_RANGE if key in self.refuses else 0
            if not error:
                self.settings[key] = wire.SetSetting.unpack(payload).value
                self.events.append(f"set {key}")
        if error:
            return encode(wire.Reply.ID, wire.Reply(req_id, message_id, error).pack())
        return encode(wire.SettingValue.ID, wire.SettingValue(req_id, key, self.settings[key]).pack())

    # Target
    def port_exists(self) -> bool:
        return not self.in_loader

    def open(self) -> Hand:
        if self.in_loader:
            raise PortError("no port")
        return Hand(SerialLink(self._link.path))

    def touch(self) -> None:
        self.events.append("touch")
        self.in_loader = True

    def reopen(self) -> Hand:
        if not self.comes_back:
            raise DeviceLostError("the board did not come back; plug it in again")
        return self.open()

    def close(self) -> None:
        pass

    # Loader
    def ready(self) -> bool:
        return self.in_loader

    def cure(self) -> str:
        return "hold BOOTSEL"

    def write(self, image: Image, show: Callable[[int, int], None]) -> None:
        self.events.append("write")
        self.in_loader = False
        self.answers = True
        self.boot_id += 1
        self.settings = dict(self.stored)
        if self.accepts:
            self.version = image.note.firmware
            self.image_crc32 = image.note.crc32


def no_waiting(monkeypatch: pytest.MonkeyPatch) -> None:
    """A clock that only sleeping moves on."""
    now = [0.0]

    def sleep(seconds: float) -> None:
        now[0] += seconds

    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    monkeypatch.setattr(time, "sleep", sleep)


def plug_in(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    """Device: serial number, of the gateways that are plugged in; change it as you like."""
    plugged: dict[str, str] = {}

    def comports() -> list[ListPortInfo]:
        return [usb_port("/dev/ttyUSB7", ours=False), *(usb_port(*device) for device in plugged.items())]

    monkeypatch.setattr(list_ports, "comports", comports)
    no_waiting(monkeypatch)
    return plugged


def drives_below(root: Path, monkeypatch: pytest.MonkeyPatch, look: Callable[[], object] = lambda: None) -> None:
    """Loaders' drives are mounted below this folder; ``look`` is called whenever they are looked for."""

    def folders() -> list[Path]:
        look()
        return linux_folders(root)

    monkeypatch.setattr(loader_drive, "mounted_folders", folders)  # only root may mount in /media


def make_drive(folder: Path, board: str = "RPI-RP2") -> Path:
    folder.mkdir(parents=True)
    (folder / "INFO_UF2.TXT").write_text(f"UF2 Bootloader v2.0\r\nModel: Raspberry Pi RP2\r\nBoard-ID: {board}\r\n")
    return folder
