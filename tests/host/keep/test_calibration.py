"""A finger's own calibration: values, file and record; and the use that boards, recordings and verbs make of it."""

import json
import struct
import zlib
from dataclasses import replace
from pathlib import Path

import pytest
from kept_board import boot, serial_of
from maps import make_map

import biotac
from biotac import Calibration, CalibrationState, PocWeights, Setting
from biotac.cli.main import main
from biotac.documents import write_new
from biotac.keep import calibration_file as file
from biotac.keep import eeprom
from biotac.map import file as map_file
from biotac.recording.crosscheck import CrossCheck
from biotac.recording.reader import Recording
from biotac.wire import messages_gen as wire

SERIAL = "BTEMU00000000042"
ODD = Calibration(PocWeights.ABS_N2, (1, -2, 3), (-4, 5), -600, SERIAL, 1_763_731_310, 9_500_000)


# ---- values ------------------------------------------------------------------------------------


def test_the_values_are_the_per_finger_settings_by_id() -> None:
    # Ids 1 to 6, 10 and 11, by hand from link.toml.
    assert ODD.wire_values() == (0, 1, -2, 3, -4, 5, -600, 9_500_000)
    assert [int(s) for s in ODD.settings()] == [1, 2, 3, 4, 5, 6, 10, 11]
    assert Calibration.from_wire(ODD.wire_serial(), ODD.made_s, ODD.wire_values()) == ODD
    assert bytes(replace(ODD, serial="BT1").wire_serial()) == b"BT1" + bytes(13)
    defaults = {s: wire.SETTINGS[s].default for s in wire.CALIBRATION_SETTINGS}
    assert Calibration().settings() == defaults


@pytest.mark.parametrize("k", range(8))
def test_a_value_keeps_its_settings_range(k: int) -> None:
    spec = wire.SETTINGS[wire.CALIBRATION_SETTINGS[k]]
    for value, good in ((spec.low, True), (spec.low - 1, False), (spec.high, True), (spec.high + 1, False)):
        values = [*ODD.wire_values()]
        values[k] = value
        if good:
            assert Calibration.from_wire(b"", 0, values).wire_values()[k] == value
        else:
            with pytest.raises(ValueError, match=f"{wire.CALIBRATION_SETTINGS[k].name.lower()} is {value}, expected"):
                Calibration.from_wire(b"", 0, values)


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"force_gain_nn": (1, 2)}, "force_gain_nn has 2 values, expected 3"),
        ({"torque_gain_nn": (1, 2.0)}, "torque_gain_nn is 2.0, expected a whole number"),
        ({"poc_weights": True}, "poc_weights is True, expected a whole number"),
        ({"made_s": 2**32}, "expected seconds since 1970"),
        ({"serial": "BT" + 15 * "0"}, "expected up to 16 ASCII"),
        ({"serial": "BTä"}, "expected up to 16 ASCII"),
        ({"serial": "BT\n"}, "expected up to 16 ASCII"),
    ],
)
def test_what_is_no_calibration_is_refused(change: dict[str, object], text: str) -> None:
    with pytest.raises(ValueError, match=text):
        replace(ODD, **change)  # type: ignore[arg-type]


# ---- file --------------------------------------------------------------------------------------


def test_a_file_is_read_back_and_tells_where_it_comes_from(tmp_path: Path) -> None:
    path = tmp_path / "thumb.json"
    path.write_text(file.dumps(ODD, {"by": "hand"}))
    assert file.load(path) == ODD
    tree = json.loads(path.read_text())
    assert (tree["poc_weights"], tree["force_gain_nn"]) == ("ABS_N2", {"x": 1, "y": -2, "z": 3})
    assert tree["provenance"] == {"by": "hand"}


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"format": "biotac-calibration/2"}, 'expected "biotac-calibration/1"'),
        ({"crc32": "0f0f0f0f"}, r'"crc32": "0f0f0f0f", but its content has "\w{8}": it is damaged'),
        ({"crc32": None}, 'if you edited it, write "crc32": "edited"'),
        ({"gain": 1}, "key 'gain' is unknown; expected"),
        ({"made_s": None}, "made_s is None, expected a whole number"),
        ({"poc_weights": 1}, "poc_weights is 1, expected one of ABS_N2, COMPRESS_N1, COMPRESS_N2"),
        ({"force_gain_nn": {"x": 1, "y": 2}}, "expected an object with x, y, z"),
        ({"torque_gain_nn": [1, 2]}, "expected an object with y, z"),
        ({"force_gain_nn": {"x": 1, "y": 2, "z": 100_000_001}}, "force_gain_z_nn is 100000001, expected -100000000"),
        ({"provenance": "hand"}, "provenance is not an object"),
    ],
)
def test_a_file_that_cannot_be_used_says_why(tmp_path: Path, change: dict[str, object], text: str) -> None:
    path = tmp_path / "bad.json"
    path.write_text(json.dumps(file.to_dict(ODD) | {"crc32": "edited"} | change))
    with pytest.raises(biotac.InputError, match=text) as refusal:
        file.load(path)
    assert str(refusal.value).startswith(f"{path} is not usable: ")


@pytest.mark.parametrize("key", [key for key in file.KEYS if key != "provenance"])
def test_every_key_but_provenance_must_be_there(key: str) -> None:
    tree = file.to_dict(ODD)
    del tree[key], tree["provenance"]
    with pytest.raises(ValueError, match=key):
        file.from_dict(tree)


@pytest.mark.parametrize("text", ["", "[]", '{"format": NaN}', "[" * 100_000])
def test_what_is_no_file_at_all(text: str) -> None:
    with pytest.raises(biotac.InputError, match=r"it is not usable: .* expected a calibration, as"):
        file.loads(text, "it")


def test_files_that_cannot_be_read_or_written(tmp_path: Path) -> None:
    with pytest.raises(biotac.InputError, match="cannot be read"):
        file.load(tmp_path / "none.json")
    for path, text in ((tmp_path, "already exists; choose another"), (tmp_path / "no" / "such", "cannot be written")):
        with pytest.raises(biotac.InputError, match=text):
            write_new(path, "")
    (tmp_path / "latin.json").write_bytes(b'{"by": "M\xfcller"}')
    with pytest.raises(biotac.InputError, match=r"is not usable: .* decode"):
        file.load(tmp_path / "latin.json")


# ---- record ------------------------------------------------------------------------------------


def sealed(record_id: int, version: int, data: bytes) -> bytes:
    header = struct.pack("<IHHI", 0x52544F42, record_id, version, len(data))
    crc = zlib.crc32((header + b"\xff" * 4 + data).ljust(256, b"\xff"))
    return header + struct.pack("<I", crc) + data


GOOD = eeprom.pack(ODD)[16:]


@pytest.mark.parametrize(
    ("data", "text"),
    [
        (b"", "no intact record"),
        (eeprom.pack(ODD)[:-3], "no intact record: its CRC is wrong"),
        (eeprom.pack(ODD) + b"\0", "no intact record"),
        (sealed(1, 1, GOOD), "a record other than a calibration"),
        (sealed(2, 2, GOOD), "a newer format"),
        (sealed(2, 1, GOOD[:-4]), "a value out of range"),
        (sealed(2, 1, b""), "a cleared calibration"),
        (sealed(2, 1, b"B\xe4" + GOOD[2:]), "an invalid calibration"),
    ],
)
def test_a_record_that_is_none_says_why(data: bytes, text: str) -> None:
    with pytest.raises(biotac.InputError, match=text):
        eeprom.unpack(data, "it")


@pytest.mark.parametrize("at", range(68))
def test_no_byte_of_a_record_may_change(at: int) -> None:
    data = bytearray(eeprom.pack(ODD))
    data[at] ^= 0x20
    with pytest.raises(biotac.InputError):
        eeprom.unpack(bytes(data), "it")


# ---- a board with flash --------------------------------------------------------------------------


def test_a_saved_calibration_is_the_record_and_holds_after_the_next_boot(tmp_path: Path) -> None:
    flash = tmp_path / "flash"
    with boot(flash) as hand:
        given = replace(ODD, serial=serial_of(hand, 0))
        hand.board.set_calibration(0, given)
        hand.board.set_calibration(1, replace(ODD, serial=""))
        hand.board.save_settings()
        hand.board.clear_calibration(1)  # not saved
    assert eeprom.pack(given) in flash.read_bytes()
    with boot(flash) as hand:
        assert hand.board.calibrations() == {0: given, 1: replace(ODD, serial="")}
        hand.board.clear_calibration(1)
        hand.board.save_settings()
    with boot(flash, ["BTOTHER", "BTANOTHER"]) as hand:
        assert hand.board.calibration_state(0) == CalibrationState.OTHER_SENSOR
        assert hand.board.calibration(0) == given
        assert (hand.board.calibration(1), hand.board.calibration_state(1)) == (None, CalibrationState.NONE)
        assert hand.board.calibrations() == {}


# ---- boards, recordings ------------------------------------------------------------------------


@pytest.fixture
def two_gains(tmp_path: Path) -> Path:
    """A recording of two fingers, one with the board's settings and one with settings of its own."""
    path = tmp_path / "two.mcap"
    with biotac.open("sim:shear.toml?fingers=2&seconds=3") as hand:
        gains = Calibration(PocWeights.COMPRESS_N2, (900_000, 800_000, 700_000), (600_000, 500_000), 300)
        hand.board.set_calibration(1, replace(gains, serial=serial_of(hand, 1), made_s=7))
        hand.record(path)
        hand.read(2.5)
    return path


def test_a_recording_knows_the_calibrations_and_is_checked_by_them(two_gains: Path, capsys) -> None:
    recording = Recording(two_gains)
    assert list(recording.calibrations) == [1]
    assert recording.calibrations[1].force_gain_nn == (900_000, 800_000, 700_000)
    assert main(["check", str(two_gains)]) == 0
    assert "good" in capsys.readouterr().out
    # Without the calibration the same frames are wrong, those of that finger and no others.
    blind = CrossCheck()
    blind.add(recording.wire, recording.settings)
    assert blind.violations > 50
    assert all(text.startswith("finger 1 ") for text in blind.findings)
    # And with the calibration on the wrong finger.
    swapped = CrossCheck()
    swapped.add(recording.wire, recording.settings, {0: recording.finger_settings[1]})
    assert swapped.violations > blind.violations
    assert swapped.findings[0].startswith("finger 0 ")


# ---- command line --------------------------------------------------------------------------------


def test_the_verbs_move_a_calibration_to_a_board_and_back(port: str, capsys, tmp_path: Path) -> None:
    path, back = tmp_path / "thumb.json", tmp_path / "back.json"
    with biotac.open(port) as hand:
        given = replace(ODD, serial=serial_of(hand, 1))
    path.write_text(file.dumps(given))
    verb = ["calibrate"]
    assert main([*verb, "get", port, "--finger", "1", str(back)]) == 2
    assert "finger 1 on" in capsys.readouterr().err
    assert main([*verb, "put", port, str(path), "--finger", "0"]) == 7
    assert "OTHER_SENSOR" in capsys.readouterr().err
    assert main([*verb, "put", port, str(path), "--finger", "0", "--force", "--save"]) == 0
    assert "finger 0: calibration in force, saved; for any sensor, made 2025-11-21" in capsys.readouterr().out
    assert main([*verb, "put", port, str(path), "--finger", "1"]) == 0
    assert "until the next reboot" in capsys.readouterr().out
    assert main([*verb, "get", port, "--finger", "1", str(back)]) == 0
    assert file.load(back) == given
    assert json.loads(back.read_text())["provenance"]["finger"] == 1
    assert main([*verb, "get", port, "--finger", "1", str(back)]) == 2
    assert main([*verb, "get", port, "--finger", "0", str(back), "--force"]) == 0
    assert file.load(back) == replace(given, serial="")
    capsys.readouterr()
    assert main([*verb, "show", port]) == 0
    shown = capsys.readouterr().out
    assert "finger 1: calibration in force; for sensor BT" in shown
    assert shown.count("thermal_gain_milli = -600 count/1000 per TDC count") == 2
    assert main([*verb, "clear", port, "--finger", "0"]) == 0
    capsys.readouterr()
    assert main([*verb, "show", port, "--json"]) == 0
    states = {finger: both["calibration"]["state"] for finger, both in json.loads(capsys.readouterr().out).items()}
    assert states == {"0": "NONE", "1": "IN_FORCE", "2": "NONE", "3": "NONE", "4": "NONE"}
    assert main(["info", port, "--json"]) == 0
    assert list(json.loads(capsys.readouterr().out)["calibrations"]) == ["1"]


def test_a_finger_with_a_calibration_and_a_map(port: str, capsys, tmp_path: Path) -> None:
    """Files state their kind; a board that holds both kinds names both."""
    own, wrench_map, back = tmp_path / "own.json", tmp_path / "map.json", tmp_path / "back.json"
    own.write_text(file.dumps(replace(ODD, serial="")))
    wrench_map.write_text(map_file.dumps(make_map(1)))
    verb = "calibrate"
    for path in (own, wrench_map):
        assert main([verb, "put", port, str(path), "--finger", "0"]) == 0
    capsys.readouterr()
    assert main([verb, "show", port]) == 0
    shown = capsys.readouterr().out
    assert "finger 0: calibration in force; for any" in shown and "finger 0: wrench map in force; force" in shown
    for argv in (["get", port, str(back)], ["clear", port]):
        assert main([verb, *argv, "--finger", "0"]) == 2
        assert "name one: --kind calibration or map" in capsys.readouterr().err
    assert main([verb, "get", port, str(back), "--finger", "0", "--kind", "map"]) == 0
    assert map_file.load(back) == make_map(1)
    assert main([verb, "clear", port, "--finger", "0", "--kind", "map"]) == 0
    assert main([verb, "get", port, str(back), "--finger", "0", "--force"]) == 0
    assert file.load(back) == replace(ODD, serial="")
    assert main([verb, "clear", port, "--finger", "0"]) == 0
    assert main([verb, "clear", port, "--finger", "0"]) == 0  # is clear already
    capsys.readouterr()
    assert main([verb, "show", port]) == 0
    assert "finger 0: none, the board's settings apply" in capsys.readouterr().out


def test_a_file_is_shown(capsys, tmp_path: Path) -> None:
    path = tmp_path / "thumb.json"
    path.write_text(file.dumps(ODD))
    assert main(["calibrate", "show", str(path)]) == 0
    assert f"{path}: for sensor {SERIAL}, made 2025-11-21 13:21 UTC" in capsys.readouterr().out
    assert main(["calibrate", "show", "--json", str(path)]) == 0
    assert file.from_dict(json.loads(capsys.readouterr().out)) == ODD


def test_settings_leave_a_calibrated_finger_alone() -> None:
    with biotac.open("sim:press.toml?fingers=2&seconds=1") as hand:
        hand.board.set_calibration(1, replace(ODD, serial=""))
        hand.board.set_setting(Setting.FORCE_GAIN_X_NN, 42)
        assert hand.board.finger_settings()[1] == hand.board.settings() | ODD.settings()
        assert hand.board.setting(Setting.FORCE_GAIN_X_NN) == 42
        with pytest.raises(biotac.CommandRefusedError, match="NO_SUCH_FINGER"):
            hand.board.calibration(5)
