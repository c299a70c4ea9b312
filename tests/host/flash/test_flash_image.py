"""biotac flash: which images are refused, and why."""

import struct
from collections.abc import Callable
from pathlib import Path

import pytest
from fake_flash_board import RP2350_START, make_image, note, uf2

from biotac.errors import InputError
from biotac.flash import read_image
from biotac.flash.families import FAMILIES, RP2040, RP2350
from biotac.flash.image import BLOCK_BYTES, MAPS_BYTES, SETTINGS_BYTES, note_text
from biotac.wire import messages_gen as wire

ROOT = Path(__file__).resolve().parents[3]
FLASH = 0x10000000
KEPT = FLASH + RP2040.flash_bytes - SETTINGS_BYTES - MAPS_BYTES  # from here on


def changed(at: int, format_: str, value: int, block: int = 3) -> Callable[[bytes], bytes]:
    """The image with one field of one block changed."""

    def change(data: bytes) -> bytes:
        out = bytearray(data)
        struct.pack_into(format_, out, block * BLOCK_BYTES + at, value)
        return bytes(out)

    return change


def dropped(first: int, last: int) -> Callable[[bytes], bytes]:
    return lambda data: data[: first * BLOCK_BYTES] + data[last * BLOCK_BYTES :]


def swapped(data: bytes) -> bytes:
    blocks = [data[at : at + BLOCK_BYTES] for at in range(0, len(data), BLOCK_BYTES)]
    blocks[4], blocks[5] = blocks[5], blocks[4]
    return b"".join(blocks)


def test_an_image_says_what_it_is(tmp_path: Path) -> None:
    image = read_image(make_image(tmp_path))
    assert note_text(image.note) == f"PICO, firmware 0.2.0, wire {wire.WIRE_MAJOR}.0"
    assert len(image.blocks) == 20
    assert image.boot_last() == (*image.blocks[1:], image.blocks[0])


@pytest.mark.parametrize(
    ("spoil", "why"),
    [
        (lambda data: b"", "0 bytes are not a UF2"),
        (lambda data: b"\x7fELF" + bytes(508), "block 0 of 1 has magic number 0x464C457F"),
        (changed(508, "<I", 7), "block 3 of 20 has last magic number 0x7, expected 0xAB16F30"),
        (changed(8, "<I", 0x2001), "block 3 of 20 has flags 0x2001, expected 0x2000"),
        (changed(100, "<I", 0), "CRC-32"),
        (changed(300, "<B", 1), "block 3 has data after its 256 bytes"),
        (changed(28, "<I", 0xE48BFF59), "family 0xE48BFF59, expected 0xE48BFF56"),
        (changed(28, "<I", 0xE48BFF59, block=0), "block 1 of 20 has family 0xE48BFF56, expected 0xE48BFF59"),
        (changed(16, "<I", 476), "size 0x1DC, expected 0x100"),
        (dropped(19, 20), "block 0 of 19 has count of blocks 0x14, expected 0x13"),
        (dropped(4, 5), "use the whole .uf2 file"),
        (swapped, "block 4 of 20 has address 0x10000500, expected 0x10000400"),
        (changed(12, "<I", 0x20000000), "address 0x20000000, expected 0x10000300"),
        (lambda data: data[:512] * ((KEPT - FLASH) // 256 + 1), "where maps and settings begin"),
        (changed(12, "<I", KEPT - 256), "expected 0x10000300"),
        (changed(32, "<B", 1, block=0), "second-stage boot has CRC"),
    ],
)
def test_an_image_that_a_board_would_not_take_whole_is_refused(
    tmp_path: Path, spoil: Callable[[bytes], bytes], why: str
) -> None:
    path = make_image(tmp_path)
    path.write_bytes(spoil(path.read_bytes()))
    with pytest.raises(InputError, match=why) as caught:
        read_image(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (b"", "0 times which board"),
        (note() + note(), "2 times which board"),
        (note()[:12] + b"\x03" + note()[13:], "layout 3"),
    ],
)
def test_an_image_that_does_not_say_its_board_is_refused(tmp_path: Path, content: bytes, why: str) -> None:
    with pytest.raises(InputError, match=why):
        read_image(make_image(tmp_path, content))


def test_no_flipped_bit_is_overlooked(tmp_path: Path) -> None:
    path = make_image(tmp_path)
    whole = path.read_bytes()
    for bit in range(0, 8 * len(whole), 101):  # 101 has no factor with 8: every bit of a byte, every part of a block
        flipped = bytearray(whole)
        flipped[bit // 8] ^= 1 << bit % 8
        path.write_bytes(flipped)
        with pytest.raises(InputError):
            read_image(path)


def test_settings_and_maps_are_where_the_firmware_has_them() -> None:
    storage = (ROOT / "firmware/core/keep/storage.h").read_text()
    assert "#define BT_FLASH_SECTOR_BYTES 4096" in storage
    assert "#define BT_STORAGE_BYTES      (2 * BT_FLASH_SECTOR_BYTES)" in storage
    slots = (ROOT / "firmware/core/map/store.h").read_text()
    assert "#define BT_MAP_SLOT_BYTES BT_MAP_MAX_BYTES" in slots
    assert "#define BT_MAP_SLOTS      BT_MAP_SLOTS_OF(BT_MAX_FINGERS)" in slots
    port = (ROOT / "firmware/port/rp2/flash.c").read_text()
    assert "#define MAPS_OFFSET    (STORAGE_OFFSET - BT_MAPS_BYTES)" in port
    assert (SETTINGS_BYTES, MAPS_BYTES) == (2 * 4096, 11 * 20480)
    for family, boot2 in zip(FAMILIES, (" - 256", ""), strict=True):
        folder, mib = ROOT / "firmware/port" / family.chip.lower(), family.flash_bytes >> 20
        assert f"#define FLASH_BYTES    ({mib}u * 1024 * 1024)" in (folder / "chip_flash.h").read_text()
        length = f"LENGTH = {mib}M{boot2} - {(SETTINGS_BYTES + MAPS_BYTES) // 1024}K"
        assert length in (folder / f"{folder.name}.ld").read_text()


@pytest.mark.parametrize(
    ("at", "value", "why"),
    [
        (64, 0xFFFFDED4, "0 IMAGE_DEF blocks in its first 4 KiB"),
        (200, 0xFFFFDED3, "2 IMAGE_DEF blocks"),
        (68, 0x10110142, "IMAGE_DEF is FFFFDED3 10110142"),  # not Secure
        (68, 0x00210142, "00210142"),  # an RP2040's
        (72, 0x2FF, "000002FF"),
        (76, 64, "00000040"),  # a link to another block
        (80, 0, "00000000; the chip expects"),
        (0, 0x20082008, "no stack in RAM"),
        (0, 0x20001E01, "no stack in RAM"),
        (4, 0x10000100, "code in flash"),  # not Thumb
        (4, 0x20000101, "code in flash"),
    ],
)
def test_an_image_that_an_rp2350_would_not_start_is_refused(at: int, value: int, why: str) -> None:
    image = bytearray(RP2350_START.ljust(8192, b"\0"))
    RP2350.check(bytes(image))
    struct.pack_into("<I", image, at, value)
    with pytest.raises(ValueError, match=why):
        RP2350.check(bytes(image))
    with pytest.raises(ValueError, match=why):
        uf2.uf2(bytes(image), "rp2350")  # nor does the build write it


def test_an_image_whose_board_has_another_chip_is_refused(tmp_path: Path) -> None:
    assert read_image(make_image(tmp_path, chip="rp2350")).family is RP2350
    with pytest.raises(InputError, match="it is for a PICO, and its blocks are an RP2350's"):
        read_image(make_image(tmp_path, note(), chip="rp2350"))
