"""Calibrations in a 24Cxx on a finger's harness: page by page, in turn, and under any failure of the supply."""

import errno
import io
import json
import random
import struct
import sys
import zlib
from pathlib import Path

import fake_smbus
import pytest

from biotac import Calibration
from biotac.cli.main import main
from biotac.errors import InputError, PortError
from biotac.keep import calibration_file as file
from biotac.keep import chip as chips
from biotac.keep import eeprom, harness
from biotac.keep.chip import KINDS, Chip

USABLE = sorted(set(KINDS) - {"24c01"})
OLD = Calibration(serial="BTEMU00000000001", made_s=1, force_gain_nn=(-1, 2, -3))
NEW = Calibration(serial="BTEMU00000000001", made_s=2, torque_gain_nn=(7, -8), thermal_gain_milli=-5000)


def wired(monkeypatch, kind: str) -> tuple[fake_smbus.Wires, fake_smbus.Eeprom]:
    """One chip at 1:0x50, by the data sheet's numbers rather than the library's."""
    sizes = {"24c01": 128, "24c02": 256, "24c04": 512, "24c08": 1024, "24c16": 2048}
    kbits = int(kind[3:])
    size = sizes.get(kind, kbits * 128)
    pages = {1: 8, 2: 8, 4: 16, 8: 16, 16: 16, 32: 32, 64: 32, 128: 64, 256: 64, 512: 128}
    made = fake_smbus.Eeprom(size, pages[kbits], 1 if kbits <= 16 else 2)
    wires = fake_smbus.Wires({0x50: made})
    monkeypatch.setitem(sys.modules, "smbus2", wires.module())
    return wires, made


def store(kind: str, calibration: Calibration) -> bool:
    with Chip("1:0x50", kind) as chip:
        return eeprom.store(chip, calibration)


def load(kind: str) -> Calibration:
    with Chip("1:0x50", kind) as chip:
        return eeprom.load(chip)


@pytest.mark.parametrize("kind", USABLE)
def test_what_is_stored_is_loaded_again(monkeypatch, kind: str) -> None:
    wires, made = wired(monkeypatch, kind)
    for number in range(5):
        calibration = Calibration(made_s=number, force_gain_nn=(number, 0, 0))
        assert store(kind, calibration)
        assert load(kind) == calibration
    assert set(made.memory[256:]) <= {0xFF}
    assert wires.open_buses == 0


def test_the_bytes_are_those_of_the_specification(monkeypatch) -> None:
    _, made = wired(monkeypatch, "24c32")
    store("24c32", OLD)
    store("24c32", NEW)
    # protocol/SPEC.md, Calibrations; values by id: poc_weights, force x y z, torque y z, thermal, pressure.
    data = b"BTEMU00000000001" + struct.pack("<I8i", 2, 1, 1_063_440, 252_325, 2_262_234, 7, -8, -5000, 0)
    header = struct.pack("<IHHI", 0x52544F42, 2, 1, len(data))
    page = (header + b"\xff" * 4 + data).ljust(256, b"\xff")
    record = header + struct.pack("<I", zlib.crc32(page)) + data
    covered = (struct.pack("<I", 2) + record).ljust(124, b"\xff")
    assert bytes(made.memory[128:256]) == struct.pack("<I", zlib.crc32(covered)) + covered


def test_the_same_again_wears_nothing(monkeypatch) -> None:
    _, made = wired(monkeypatch, "24c02")
    assert store("24c02", OLD)
    before = made.bytes_kept
    assert not store("24c02", OLD)
    assert made.bytes_kept == before


@pytest.mark.parametrize(("kind", "ragged"), [("24c02", None), ("24c32", 1), ("24c512", None)])
def test_a_write_that_is_torn_at_any_byte_leaves_the_old_one(monkeypatch, kind: str, ragged: int | None) -> None:
    _, made = wired(monkeypatch, kind)
    made.busy_for = 0
    for past in range(3):  # the places change their part
        store(kind, Calibration(made_s=100 + past))
        store(kind, OLD)
        before = bytes(made.memory)
        store(kind, NEW)
        after = bytes(made.memory)
        cuts = 0
        while True:
            made.memory[:] = before
            made.bytes_left = cuts
            made.ragged = random.Random(cuts * 7 + ragged) if ragged else None
            try:
                store(kind, NEW)
                break
            except fake_smbus.PowerFailsError:
                made.bytes_left = None
                # Bytes still to come may be there already, as the 0xFF at the end are.
                assert load(kind) == (NEW if bytes(made.memory) == after else OLD)
                store(kind, NEW)  # the half record left there is no obstacle
                assert load(kind) == NEW
                cuts += 1
        assert cuts == eeprom.SLOT_BYTES
        made.bytes_left = None


def test_a_damaged_place_falls_back_to_the_one_before(monkeypatch) -> None:
    _, made = wired(monkeypatch, "24c16")
    store("24c16", OLD)
    store("24c16", NEW)
    for at in range(128, 256):
        made.memory[at] ^= 0x10
        assert load("24c16") == OLD
        made.memory[at] ^= 0x10
    made.memory[130] ^= 1
    made.memory[20] ^= 1
    with pytest.raises(InputError, match=r"the CRCs of both copies are wrong; check its kind"):
        load("24c16")
    assert store("24c16", NEW)
    assert load("24c16") == NEW


def test_generations_may_wrap(monkeypatch) -> None:
    _, made = wired(monkeypatch, "24c02")
    store("24c02", OLD)
    covered = struct.pack("<I", 2**32 - 1) + bytes(made.memory[8:128])
    made.memory[:128] = struct.pack("<I", zlib.crc32(covered)) + covered
    for number in range(4):
        store("24c02", Calibration(made_s=number))
        assert load("24c02").made_s == number


def test_a_blank_chip_says_so(monkeypatch) -> None:
    wired(monkeypatch, "24c02")
    with pytest.raises(InputError, match=r"EEPROM 1:0x50 is blank; `biotac calibrate put` writes"):
        load("24c02")


def test_a_chip_that_is_too_small_is_refused(monkeypatch) -> None:
    wired(monkeypatch, "24c01")
    with pytest.raises(InputError, match="a 24c01 has 128 bytes, expected 256 or more"):
        load("24c01")


def test_nobody_there_and_a_chip_that_never_comes_back(monkeypatch) -> None:
    wires, made = wired(monkeypatch, "24c02")
    with (
        pytest.raises(PortError, match=r"EEPROM 1:0x51: no acknowledge .* check power, SDA, SCL"),
        Chip("1:0x51", "24c02") as chip,
    ):
        eeprom.load(chip)
    store("24c02", OLD)
    made.busy_for = chips.QUESTIONS + 1
    with pytest.raises(PortError, match=r"did not acknowledge any of 1000 polls after a page write"):
        store("24c02", NEW)
    assert wires.open_buses == 0
    made.busy = 0
    assert load("24c02") == OLD


def test_a_protected_chip_and_one_that_was_named_wrongly_read_back_otherwise(monkeypatch) -> None:
    _, made = wired(monkeypatch, "24c02")
    made.protected = True
    with pytest.raises(PortError, match=r"does not read back the bytes written; check --chip and .*WP"):
        store("24c02", OLD)
    wired(monkeypatch, "24c04")
    with pytest.raises(PortError, match="does not read back the bytes written"):
        store("24c32", OLD)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (FileNotFoundError(errno.ENOENT, "no"), "no I2C bus 1; enable I2C"),
        (PermissionError(errno.EACCES, "no"), r"no permission to open /dev/i2c-1; sudo usermod"),
        (OSError(errno.EBUSY, "busy"), r"/dev/i2c-1 cannot be opened .*busy"),
    ],
)
def test_a_bus_that_cannot_be_opened(monkeypatch, fault: OSError, message: str) -> None:
    wires, _ = wired(monkeypatch, "24c02")
    wires.open_fault = fault
    with pytest.raises(PortError, match=message):
        load("24c02")


def test_a_bus_that_fails(monkeypatch) -> None:
    wires, _ = wired(monkeypatch, "24c02")
    wires.fault = OSError(errno.ETIMEDOUT, "Connection timed out")
    with pytest.raises(PortError, match=r"the bus failed .*timed out"):
        load("24c02")


def test_a_bus_that_fails_while_the_chip_writes(monkeypatch) -> None:
    wires, made = wired(monkeypatch, "24c02")

    def acknowledge() -> bool:
        if made.bytes_kept:
            raise OSError(errno.ETIMEDOUT, "Connection timed out")
        return True

    made.acknowledge = acknowledge
    with pytest.raises(PortError, match=r"the bus failed .*timed out.*check its wires"):
        store("24c02", NEW)
    assert wires.open_buses == 0


def test_without_smbus2_the_cure_is_named(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "smbus2", None)
    with pytest.raises(PortError, match=r"needs smbus2 .*pip install 'biotac-gateway\[bus\]'"):
        load("24c02")


@pytest.mark.parametrize("place", ["", "1:", "1:0x4f", "1:0x58", "x:0x50", "-1:0x50"])
def test_a_place_that_is_none(place: str) -> None:
    with pytest.raises(PortError, match=r"BUS:ADDRESS|is at 0x50 to 0x57"):
        chips.parse_address(place)


def test_places() -> None:
    assert chips.parse_address("1:0x50") == (1, 0x50)
    assert chips.parse_address("10:0X57") == (10, 0x57)
    assert chips.parse_address("0:80") == (0, 80)


def test_the_command_line_puts_shows_and_gets(monkeypatch, capsys, tmp_path: Path) -> None:
    wired(monkeypatch, "24c02")
    where = "i2c:1:0x50:24c02"
    path, back = tmp_path / "in.json", tmp_path / "out.json"
    path.write_text(file.dumps(NEW))
    verb = ["calibrate"]
    assert main([*verb, "get", where, "-"]) == 2
    assert "is blank" in capsys.readouterr().err
    assert main([*verb, "put", where, str(path)]) == 0
    assert "for sensor BTEMU00000000001, made 1970-01-01 00:00 UTC, stored" in capsys.readouterr().out
    assert main([*verb, "put", where, str(path)]) == 0
    assert "held already" in capsys.readouterr().out
    assert main([*verb, "show", where, "--json"]) == 0
    assert file.from_dict(json.loads(capsys.readouterr().out)) == NEW
    assert main([*verb, "get", where, str(back)]) == 0
    assert file.load(back) == NEW
    assert main([*verb, "get", where, str(back)]) == 2
    assert main([*verb, "get", where, "-"]) == 0
    text = capsys.readouterr().out.partition("{")
    monkeypatch.setattr(sys, "stdin", io.StringIO(file.dumps(OLD)))
    assert json.loads(text[1] + text[2])["provenance"]["from"] == where
    assert main([*verb, "put", where, "-"]) == 0
    assert load("24c02") == OLD
    assert main([*verb, "put", "i2c:2:0x50:24c02", str(path)]) == 3
    assert "no I2C bus 2" in capsys.readouterr().err


# ---- the EEPROMs of a port's fingers -------------------------------------------------------------


@pytest.mark.parametrize(
    ("port", "bare", "places"),
    [
        ("spidev:0.0", "spidev:0.0", {}),
        ("spidev:0.0?calibration=1:0x50:24c02", "spidev:0.0", {0: ("1:0x50", "24c02")}),
        ("spidev:0.0,0.1?calibration=,1:0x57:24c32", "spidev:0.0,0.1", {1: ("1:0x57", "24c32")}),
    ],
)
def test_a_port_names_its_fingers_eeproms(port: str, bare: str, places: dict[int, tuple[str, str]]) -> None:
    assert harness.parse(port) == (bare, places)


@pytest.mark.parametrize(
    ("port", "message"),
    [
        ("spidev:0.0?kalibration=1:0x50:24c02", "option 'kalibration' is unknown; expected spidev:"),
        ("spidev:0.0?calibration=1:0x50", "'1:0x50' names no known EEPROM"),
        ("spidev:0.0?calibration=1:0x40:24c02", "is at 0x50 to 0x57"),
        ("spidev:0.0?calibration=1:0x50:24c02,1:0x51:24c02", r"2 EEPROMs for 1 finger\(s\)"),
    ],
)
def test_a_port_that_names_them_wrongly(port: str, message: str) -> None:
    with pytest.raises(PortError, match=message):
        harness.parse(port)
