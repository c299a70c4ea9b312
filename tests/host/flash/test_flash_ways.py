"""biotac flash: the drive, picotool, and the port that goes away and comes back."""

import os
from collections.abc import Callable
from pathlib import Path

import pytest
from fake_flash_board import FakeBoard, drives_below, make_drive, make_image, plug_in

from biotac.errors import DeviceLostError, FlashError
from biotac.flash import loader_drive, read_image
from biotac.flash.families import FAMILIES, RP2040, Family
from biotac.flash.image import BLOCK_BYTES
from biotac.flash.loader_drive import DriveLoader
from biotac.flash.loader_picotool import PicotoolLoader
from biotac.flash.target_serial import SerialTarget


@pytest.fixture(autouse=True)
def drives_of_the_test(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drives_below(tmp_path, monkeypatch)


@pytest.mark.parametrize("place", ["media/me/RPI-RP2", "media/RPI-RP2", "run/media/me/RPI-RP21"])
def test_a_drive_is_found_where_desktops_mount_it(tmp_path: Path, place: str) -> None:
    make_drive(tmp_path / "media/me/CAMERA", "SAMD51")
    (tmp_path / "media/me/empty").mkdir()
    assert not DriveLoader().ready()
    drive = make_drive(tmp_path / place)
    assert DriveLoader().drives() == [(drive, RP2040)]


def test_a_drive_is_found_where_somebody_mounted_it(tmp_path: Path) -> None:
    drive = make_drive(tmp_path / "my drüve")
    mounts = tmp_path / "proc/mounts"
    mounts.parent.mkdir()
    mounts.write_text(f"proc /proc proc rw 0 0\n/dev/sdb1 {str(drive).replace(' ', chr(92) + '040')} vfat rw 0 0\n")
    assert DriveLoader().drives() == [(drive, RP2040)]


def test_two_drives_are_one_too_many(tmp_path: Path) -> None:
    make_drive(tmp_path / "media/me/RPI-RP2")
    make_drive(tmp_path / "media/me/RPI-RP21")
    with pytest.raises(FlashError, match="2 boards are in their loader"):
        DriveLoader().ready()


@pytest.mark.parametrize("family", FAMILIES)
def test_another_chips_image_is_refused_both_ways(tmp_path: Path, family: Family) -> None:
    make_drive(tmp_path / "media/me" / family.drive, family.drive)
    loader = DriveLoader()
    assert loader.ready() and loader.family() is family and loader.name == f"drive {family.drive}"
    other = next(one for one in FAMILIES if one is not family)
    image = read_image(make_image(tmp_path, chip=other.chip.lower()))
    with pytest.raises(FlashError, match=rf"is for a {other.board} \({other.chip}\), and a {family.board} \(drive"):
        loader.write(image, lambda done, total: None)
    assert not (tmp_path / "media/me" / family.drive / loader_drive.FILE).exists()


def test_a_drive_that_is_not_mounted_is_told_apart_from_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "BOOTSEL" in DriveLoader().cure()
    disk = "/dev/disk/by-label/RP2350"
    monkeypatch.setattr(Path, "exists", lambda path: str(path) == disk)
    assert f"udisksctl mount -b {disk}" in DriveLoader().cure()


def test_a_drive_gets_the_whole_file_with_the_boot_block_last(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    drive = make_drive(tmp_path / "media/me/RPI-RP2")
    image = read_image(make_image(tmp_path))
    synced: list[int] = []
    monkeypatch.setattr(os, "fsync", lambda fd: synced.append((drive / "BIOTAC.UF2").stat().st_size))
    shown: list[int] = []
    DriveLoader().write(image, lambda done, total: shown.append(done))
    assert (drive / "BIOTAC.UF2").read_bytes() == b"".join(image.boot_last())
    assert synced == [19 * BLOCK_BYTES, 20 * BLOCK_BYTES]  # the boot block goes out after all others are
    assert shown[-1] == 20


@pytest.mark.parametrize("call", [1, 2])
def test_a_drive_that_vanishes(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, call: int) -> None:
    """The drive must vanish with the last block; before, it is a failure."""
    make_drive(tmp_path / "media/me/RPI-RP2")
    calls: list[int] = []

    def fsync(fd: int) -> None:
        calls.append(fd)
        if len(calls) == call:
            raise OSError(5, "Input/output error")

    monkeypatch.setattr(os, "fsync", fsync)
    image = read_image(make_image(tmp_path))
    if call == 2:
        DriveLoader().write(image, lambda done, total: None)
    else:
        with pytest.raises(FlashError, match=r"took 19 of 20 blocks .*the board stays in its loader"):
            DriveLoader().write(image, lambda done, total: None)


# ---- picotool ----------------------------------------------------------------------------------------


@pytest.fixture
def picotool(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[[str], Path]:
    """Puts a shell script on PATH as picotool; it writes down how it was called."""
    folder = tmp_path / "bin"
    folder.mkdir()
    log = tmp_path / "calls"
    monkeypatch.setenv("PATH", f"{folder}:/usr/bin:/bin")

    def make(script: str) -> Path:
        (folder / "picotool").write_text(f'#!/bin/sh\necho "$@" >> {log}\n{script}\n')
        (folder / "picotool").chmod(0o755)
        return log

    return make


def test_picotool_loads_verifies_and_starts(picotool: Callable[[str], Path], tmp_path: Path) -> None:
    log = picotool("exit 0")
    image = read_image(make_image(tmp_path))
    loader = PicotoolLoader()
    assert loader.ready()
    loader.write(image, lambda done, total: None)
    assert log.read_text().splitlines() == ["info", f"load -v -x {image.path}"]


def test_picotool_that_finds_no_board(picotool: Callable[[str], Path], tmp_path: Path) -> None:
    picotool("echo 'No accessible RP-series devices in BOOTSEL mode were found.' >&2; exit 249")
    loader = PicotoolLoader()
    assert not loader.ready()
    assert loader.cure() == "picotool says: No accessible RP-series devices in BOOTSEL mode were found."
    with pytest.raises(FlashError, match=r"did not load .*No accessible"):
        loader.write(read_image(make_image(tmp_path)), lambda done, total: None)


def test_without_picotool(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    assert not PicotoolLoader().ready()
    assert "install picotool" in PicotoolLoader().cure()


# ---- the board's port ------------------------------------------------------------------------------------


@pytest.fixture
def ports(monkeypatch: pytest.MonkeyPatch) -> dict[str, str]:
    return plug_in(monkeypatch)


@pytest.fixture
def fake(scripted_board, hello) -> FakeBoard:
    return FakeBoard(scripted_board, hello)


def test_a_board_is_found_again_by_its_serial_number(ports: dict[str, str], fake: FakeBoard) -> None:
    ports |= {"/dev/ttyACM0": "E66", "/dev/ttyACM1": "F00"}
    target = SerialTarget("/dev/ttyACM0")
    assert target.port_exists()
    del ports["/dev/ttyACM0"]
    assert not target.port_exists()
    ports[fake.port] = "E66"
    target.reopen().close()
    assert target.port == fake.port


def test_a_board_that_was_in_its_loader_is_the_new_port(ports: dict[str, str], fake: FakeBoard) -> None:
    ports["/dev/ttyACM1"] = "F00"
    target = SerialTarget(None)
    ports[fake.port] = "E66"
    target.reopen().close()
    assert target.port == fake.port


def test_a_port_that_does_not_come_back_says_what_was_looked_for(ports: dict[str, str]) -> None:
    ports["/dev/ttyACM0"] = "E66"
    target = SerialTarget("/dev/ttyACM0")
    ports.clear()
    with pytest.raises(DeviceLostError, match=r"within 20 s \(no port with serial number E66\)"):
        target.reopen()
