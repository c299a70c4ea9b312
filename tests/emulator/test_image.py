"""tools/image: the second-stage boot's CRC, UF2, and the checks on an image, with inputs that must fail them."""

import struct
import subprocess
import sys
import zlib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "tools"))

from image import boot2, stack, symbols, uf2, waits  # noqa: E402

PORTS = ROOT / "firmware/port"
PORT = PORTS / "rp2"
CHIPS = (PORTS / "rp2040", PORTS / "rp2350")


def test_the_boot_crc_is_crc32_mpeg2() -> None:
    assert boot2.crc32_mpeg2(b"123456789") == 0x0376E6E7  # catalogue of parametrised CRC algorithms
    data = bytes(range(252))
    # A CRC with nothing inverted at the end is zero over data and the CRC behind them, most significant byte first.
    assert boot2.crc32_mpeg2(data + boot2.crc32_mpeg2(data).to_bytes(4, "big")) == 0
    assert boot2.block(b"ab") == b"ab" + bytes(250) + boot2.crc32_mpeg2(b"ab" + bytes(250)).to_bytes(4, "little")
    with pytest.raises(ValueError, match="253 bytes"):
        boot2.block(bytes(253))


def test_uf2_is_what_its_specification_says() -> None:
    image = boot2.block(b"boot") + bytes(range(256)) + b"tail"
    blocks = struct.iter_unpack("<8I476sI", uf2.uf2(image))
    seen = b""
    for k, (first, second, flags, at, size, number, count, family, data, last) in enumerate(blocks):
        assert (first, second, last) == (0x0A324655, 0x9E5D5157, 0x0AB16F30)
        assert (flags, family) == (0x2000, 0xE48BFF56)  # family id present: RP2040
        assert (at, size, number, count) == (0x10000000 + 256 * k, 256, k, 3)
        assert data[256:] == bytes(220)
        seen += data[:256]
    assert seen == image + bytes(252)


def test_uf2_refuses_an_image_that_the_chip_would_not_start() -> None:
    image = bytearray(boot2.block(b"boot") + b"program")
    image[1] ^= 1
    with pytest.raises(ValueError, match="second-stage boot"):
        uf2.uf2(bytes(image))


NOTE = b"BIOTAC image" + struct.pack("<HH3BBB3xII", 2, 2, 3, 4, 5, 6, 7, 0, 0)  # size and CRC still to come


def told_by_the_build(folder: Path, image: bytes) -> subprocess.CompletedProcess[str]:
    path = folder / "image.bin"
    path.write_bytes(image)
    # -I: as in a build, where the package is not to be found
    command = [sys.executable, "-I", str(ROOT / "tools/image/note.py"), str(path)]
    return subprocess.run(command, capture_output=True, text=True, check=False)


def test_the_note_of_an_image_is_told(tmp_path: Path) -> None:
    size = 320 + len(NOTE) + 7
    answer = told_by_the_build(tmp_path, bytes(320) + NOTE + b"program")
    # Of the image with the size in it, and zeros for the CRC itself.
    sized = bytes(320) + NOTE[:-8] + struct.pack("<II", size, 0) + b"program"
    crc32 = zlib.crc32(sized)
    assert (answer.returncode, answer.stdout) == (0, f"note  board 2, firmware 3.4.5, wire 6.7, CRC-32 {crc32:08x}\n")
    sealed = bytes(320) + NOTE[:-8] + struct.pack("<II", size, crc32) + b"program"
    assert (tmp_path / "image.bin").read_bytes() == sealed


@pytest.mark.parametrize(
    ("image", "why"),
    [
        (bytes(320), "says 0 times"),
        (bytes(321) + NOTE, "says 0 times"),  # not where a linker puts it: text with the same bytes
        (NOTE + NOTE, "says 2 times"),
        (NOTE[:-1], "says 0 times"),
        (NOTE[:12] + b"\3" + NOTE[13:], "layout 3"),
    ],
)
def test_an_image_that_does_not_say_what_it_is_is_not_built(tmp_path: Path, image: bytes, why: str) -> None:
    answer = told_by_the_build(tmp_path, image)
    assert answer.returncode == 1
    assert why in answer.stderr


LISTING = """
10000100 <main>:
10000100:\tb5f0      \tpush\t{r4, r5, r6, r7, lr}
10000102:\tb082      \tsub\tsp, #8
10000104:\tf000 f800 \tbl\t10000110 <helper>
10000108:\te7fa      \tb.n\t10000100 <main>

10000110 <helper>:
10000110:\tb510      \tpush\t{r4, lr}
10000112:\tf000 f800 \tbl\t10000120 <__in_sram_veneer>
10000116:\tbd10      \tpop\t{r4, pc}

10000120 <__in_sram_veneer>:
10000120:\tb401      \tpush\t{r0}
10000122:\t4760      \tbx\tip

20000000 <in_sram>:
SOURCE:2 (discriminator 1)
20000000:\t4798      \tblx\tr3
SOURCE:3
20000002:\t4770      \tbx\tlr
"""
CALL = "port->answer("


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "sram.c"
    path.write_text("void in_sram(void) {\n    port->answer(0);\n}\n")
    return path


def program(source: str | Path, pointers: dict[str, tuple[str, ...]]) -> stack.Program:
    listing = LISTING.replace("SOURCE", str(source)).splitlines()
    return stack.Program(stack.read_functions(listing), {"helper": 24}, pointers)


def test_the_stack_is_that_of_the_deepest_chain(source: Path) -> None:
    depth, chain = program(source, {CALL: ()}).deepest("main")
    assert (depth, chain) == (28 + 24 + 4, ("main", "helper", "__in_sram_veneer", "in_sram"))


def test_what_cannot_be_bounded_is_refused(source: Path) -> None:
    for others in ({}, {"port->ask(": ()}):
        with pytest.raises(stack.Unknown, match=rf"in_sram calls through a pointer at {source}:2: port->answer\(0\);"):
            program(source, others).deepest("main")
    with pytest.raises(stack.Unknown, match="recursion: main -> helper"):
        program(source, {CALL: ("helper",)}).deepest("main")


@pytest.mark.parametrize("where", ["", "/no/such/folder/sram.c"])
def test_a_call_through_a_pointer_from_a_line_nobody_can_read_is_refused(where: str) -> None:
    with pytest.raises(stack.Unknown, match=r"in_sram calls through a pointer.*no line of source"):
        program(where, {"": (), CALL: ()}).deepest("main")


def test_forbidden_symbols() -> None:
    for name in (
        "__aeabi_fadd", "__aeabi_dmul", "__aeabi_i2d", "__aeabi_i2f", "__aeabi_ui2d", "__aeabi_ul2d", "__aeabi_d2iz",
        "__aeabi_dcmplt", "__aeabi_cfcmple", "__divsf3", "__mulsf3", "__floatsidf",
    ):  # fmt: skip
        assert symbols.FLOAT_SYMBOL.match(name), name
    for name in ("malloc", "_malloc_r", "free", "calloc", "printf", "snprintf", "_vfiprintf_r", "vsnprintf", "_sbrk"):
        assert symbols.LIBRARY_SYMBOL.match(name), name
    for name in ("__aeabi_ldivmod", "__aeabi_uidiv", "__aeabi_idivmod", "__aeabi_lmul", "memcpy", "first_free",
                 "bt_session_stop", "print_font"):  # fmt: skip
        assert not symbols.FLOAT_SYMBOL.match(name) and not symbols.LIBRARY_SYMBOL.match(name), name


def test_the_port_waits_only_with_a_bound() -> None:
    folders = (PORT, *CHIPS, PORTS / "cortex_m")
    assert [wait for folder in folders for wait in waits.unbounded(folder, PORT, *CHIPS)] == []


@pytest.mark.parametrize(
    ("code", "why"),
    [
        ("void f(void)\n{\n    while (!(SPI0_SSPSR & SSPSR_RNE)) {\n    }\n}\n", "x.c:3: while loop"),
        ("void f(void)\n{\n    do {\n    } while (TIMER_TIMERAWL != 3);\n}\n", "x.c:4: while loop"),
        ("void f(void)\n{\n    for (; PLL_CS(b) == 0;) {\n    }\n}\n", "x.c:3: for loop waits for PLL_CS"),
        ("void f(void)\n{\n    for (;;) {\n    }\n}\n", "x.c:3: endless for loop"),
        ("void f(void)\n{\n    for (int k = 0; k < 9; k++) {\n    } // while (SPI0_SSPSR)\n}\n", None),
    ],
)
def test_waits_are_found(tmp_path: Path, code: str, why: str | None) -> None:
    (tmp_path / "x_regs.h").write_text((PORT / "rp2_regs.h").read_text())
    (tmp_path / "x.c").write_text(code)
    found = waits.unbounded(tmp_path)
    assert (len(found) == 1 and found[0].startswith(why)) if why else found == []
