"""The Pico alone: settings in flash over power cuts, the way into the loader, the watchdog. Emulated.

The flash chip and the boot ROM are this project's models (tools/emulator/rom.mjs); silicon has not been tried.
"""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

import biotac
from biotac import FaultFlags, Setting
from biotac.wire import messages_gen as wire
from rig import Rig

XIP = 0x10000000  # where the flash begins for the program
PAGE = 256
SECTOR = 4096
RECORDS = SECTOR // PAGE - 1
PATIENCE_S = 5  # of the board's time, for steps that take some ms of it
WORLD = "name = 'rest'\nseed = 1\nfingers = 1\n[[step]]\ndo = 'rest'\nseconds = 600\n"


class Pico:
    """An emulated board that is only asked questions, and the faults that a test may play to it."""

    def __init__(self, hand: biotac.Hand) -> None:
        self.hand = hand
        self.board: Any = self.hand.link.board  # type: ignore[attr-defined]
        self.hand.stop()
        self.hand.link.release()

    def counters(self) -> dict[str, Any]:
        return self.board.counters()

    def until(self, **counters: Any) -> dict[str, Any]:
        return self.board.until(PATIENCE_S, **counters)

    def up(self, boots: int) -> None:
        """Booted so many times, and the port open."""
        self.until(boots=boots, usb={"state": "configured"})
        self.hand.ping()

    def boot_id(self) -> int:
        return self.hand.board.ask(wire.HelloRequest(0, 1), wire.Hello).boot_id

    def save_with_cut(self, value: int, cut: int) -> None:
        """Power fails once so many bytes of flash were erased or programmed."""
        self.hand.board.set_setting(Setting.IDLE_PERIOD_MS, value)
        self.board.do(f"cut power after {cut} flash bytes")
        self.hand.board.send(wire.SaveSettings(0))


@pytest.fixture
def pico(rig: Rig, tmp_path: Path) -> Iterator[Pico]:
    rig.need("flash")
    source = tmp_path / "rest.toml"
    source.write_text(WORLD)
    made = Pico(rig.open(f"{source}?pace=fast"))
    yield made
    wrong = made.counters()["flash"]["wrong"]
    made.hand.close()
    assert wrong == []  # no code was read from a flash that was busy, and the like


@pytest.mark.daily
def test_saved_settings_are_in_force_after_power_was_off(pico: Pico) -> None:
    assert pico.hand.board.setting(Setting.IDLE_PERIOD_MS) == 100
    pico.hand.board.set_setting(Setting.IDLE_PERIOD_MS, 250)
    pico.hand.board.set_setting(Setting.FORCE_GAIN_X_NN, -7)
    pico.hand.board.save_settings()
    pico.hand.board.set_setting(Setting.IDLE_PERIOD_MS, 260)  # not saved
    first = pico.boot_id()
    pico.board.send_line("cut power")
    pico.up(2)
    assert pico.hand.board.setting(Setting.IDLE_PERIOD_MS) == 250
    assert pico.hand.board.setting(Setting.FORCE_GAIN_X_NN) == -7
    assert pico.boot_id() != first


def cut_at_each(pico: Pico, cuts: tuple[int, ...], saved: int) -> None:
    """Power fails at each of these bytes of a save; every time the old settings or the new ones are there."""
    for cut in cuts:
        boots = pico.counters()["boots"]
        pico.save_with_cut(1000 + cut, cut)
        pico.up(boots + 1)
        found = pico.hand.board.setting(Setting.IDLE_PERIOD_MS)
        assert found in (saved, 1000 + cut), cut
        saved = found


@pytest.mark.daily
def test_a_power_cut_while_a_record_is_written_leaves_the_old_settings_or_the_new(pico: Pico) -> None:
    pico.hand.board.set_setting(Setting.IDLE_PERIOD_MS, 20)
    pico.hand.board.save_settings()
    cut_at_each(pico, (0, 1, 15, 16, 65, 66, PAGE - 1), 20)
    assert pico.counters()["flash"]["erases"] == 1


def test_a_power_cut_while_the_sector_changes_leaves_the_old_settings_or_the_new(pico: Pico) -> None:
    for value in range(20, 20 + RECORDS):  # the first sector is full then
        pico.hand.board.set_setting(Setting.IDLE_PERIOD_MS, value)
        pico.hand.board.save_settings()
    assert pico.counters()["flash"]["erases"] == 1
    cuts = (0, 1, SECTOR - 1, SECTOR, SECTOR + 100, SECTOR + PAGE, SECTOR + PAGE + 10, SECTOR + 2 * PAGE - 1)
    cut_at_each(pico, cuts, 20 + RECORDS - 1)
    assert pico.counters()["flash"]["erases"] == 1 + len(cuts)


@pytest.mark.daily
def test_the_loader_is_entered_by_command_once_the_reply_is_out(pico: Pico) -> None:
    pico.hand.board.reboot_bootloader()
    facts = pico.until(loaders=1)
    assert facts["usb"]["state"] == "detached"
    assert facts["watchdog_resets"] == 0


def test_the_loader_is_entered_by_a_touch_at_1200_baud(pico: Pico) -> None:
    pico.board.send_line("touch at 1200 baud")
    pico.until(loaders=1)


@pytest.mark.daily
def test_a_board_that_hangs_starts_again_as_another_boot(pico: Pico) -> None:
    first = pico.boot_id()
    assert pico.hand.board.clear_faults().board == FaultFlags.STARTED
    pico.board.send_line("lose interrupts")
    facts = pico.until(watchdog_resets=1)
    assert facts["boots"] == 2
    pico.up(2)
    assert pico.boot_id() != first
    assert pico.hand.board.clear_faults().board == FaultFlags.HUNG
    pico.board.send_line("cut power")
    pico.up(3)
    assert pico.hand.board.faults().board == FaultFlags.STARTED


def test_the_flashs_number_is_the_boards_and_the_usb_serial(pico: Pico) -> None:
    assert bytes(pico.hand.info.board_serial).hex() == "e6605838831f5b2c" + "00000000"
    assert pico.counters()["usb"]["device"]["serial"] == "E6605838831F5B2C"


@pytest.mark.daily
def test_picotool_finds_name_version_and_pins_in_the_image(rig: Rig) -> None:
    # The layout as pico-sdk documents it (pico_binary_info/structure.h), read here from the file alone.
    rig.need("flash")
    image = rig.image.with_suffix(".bin").read_bytes()

    def word(at: int) -> int:
        return int.from_bytes(image[at : at + 4], "little")

    def text(address: int) -> str:
        at = address - XIP
        return image[at : image.index(b"\0", at)].decode()

    looked_at = (
        range(0x100, 0x200, 4) if rig.facts["board"] == "pico" else range(0, 0x400, 4)
    )  # as picotool does, by chip
    marks = [at for at in looked_at if word(at) == 0x7188EBF2 and word(at + 16) == 0xE71AA390]
    assert len(marks) == 1
    first, end, copies = (word(marks[0] + 4 * k) - XIP for k in (1, 2, 3))
    assert word(copies) == 0
    records = [word(at) - XIP for at in range(first, end, 4)]
    kinds = [(word(at) & 0xFFFF, word(at) >> 16) for at in records]
    assert {tag for _, tag in kinds} == {0x5052}
    entries = {word(at + 4): text(word(at + 8)) for at, (kind, _) in zip(records, kinds, strict=True) if kind == 6}
    pins = {word(at + 4): text(word(at + 8)) for at, (kind, _) in zip(records, kinds, strict=True) if kind == 9}
    assert entries[0x02031C86] == "biotac-gateway"
    assert entries[0x11A9BC3A].endswith(f"wire {wire.WIRE_MAJOR}.{wire.WIRE_MINOR}")
    assert entries[0xB63CFFBB] == rig.facts["board"]
    assert pins == {
        1 << 16: "SPI MISO",
        1 << 18: "SPI SCK",
        1 << 19: "SPI MOSI",
        **{1 << pin: f"chip select of finger {f}" for f, pin in enumerate((17, 20, 21, 22, 26))},
    }
