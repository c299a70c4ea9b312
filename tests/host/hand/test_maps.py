"""A finger's wrench map on this side of the link: to a board and back, over bad links, in files and recordings."""

import base64
import json
import zlib
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import fake_spidev
import numpy as np
import pytest
from kept_board import boot
from kept_board import serial_of as port_serial
from live_board import Clock, point
from maps import BIG, make_map
from record_all import written
from served_board import ServedBoard

import biotac
from biotac import CalibrationState
from biotac.cli.main import main
from biotac.export.columns import tables
from biotac.hand.hand import Hand
from biotac.link.serial_port import SerialLink
from biotac.map import file as map_file
from biotac.map.board_map import PART_BYTES, BoardBlock, BoardMap, for_any_sensor, from_blob, made_s_of, serial_of
from biotac.recording.reader import Recording
from biotac.recording.recompute import recompute
from biotac.sim.loading import load_source
from biotac.wire import map_gen as _map
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode

# ---- the header ------------------------------------------------------------------------------------


def test_the_header_is_read_as_the_boards_own_code_reads_it() -> None:
    blob = make_map(1_763_731_310, serial="BT123")
    opened = from_blob(blob)
    assert (serial_of(blob), made_s_of(blob)) == (opened.serial, opened.made_s) == ("BT123", 1_763_731_310)
    assert from_blob(for_any_sensor(blob)).serial == ""
    assert from_blob(for_any_sensor(blob)).blob == replace(opened, serial="").blob


@pytest.mark.parametrize("size", [0, _map.HEADER_BYTES - 1, _map.MAX_BYTES + 1])
def test_what_cannot_be_a_map_by_its_size_is_not_sent(size: int) -> None:
    with biotac.open("sim:press.toml") as hand:
        with pytest.raises(biotac.InputError, match=f"has {size} bytes, expected 32 to 20480"):
            hand.board.set_map(0, bytes(size))
        assert hand.status().rx_frames < 10


def test_a_map_of_the_librarys_own_goes_as_it_is() -> None:
    opened = from_blob(make_map(3))
    with biotac.open("sim:press.toml") as hand:
        hand.board.set_map(0, opened)
        assert hand.board.get_map(0) == opened.blob


# ---- over bad links --------------------------------------------------------------------------------


class Upload:
    """A board that stores one finger's map, and spoils it as the test asks."""

    def __init__(self, hello: Callable[..., bytes], time_passes: Callable[[], bytes]) -> None:
        self._hello = hello
        self._time_passes = time_passes
        self.kept = b""
        self.coming = bytearray()
        self.begun = False
        self.commands: list[type] = []
        self.silent: set[int] = set()  # of the commands for maps, by number: done, but not answered
        self.forgets: set[int] = set()  # restarts before this one
        self.reads_wrong = False

    def __call__(self, message_id: int, payload: bytes) -> bytes:
        if message_id == wire.HelloRequest.ID:
            return self._hello(payload)
        if wire.MESSAGES[message_id] in (wire.Stop, wire.Ping):
            return b""
        number = len(self.commands)
        self.commands.append(wire.MESSAGES[message_id])
        if number in self.forgets:
            self.begun = False
        answer = self._answer(wire.MESSAGES[message_id].unpack(payload))
        return self._time_passes() if number in self.silent else encode(answer.ID, answer.pack())

    def _answer(self, asked: object) -> object:
        if isinstance(asked, wire.GetMap):
            state = CalibrationState.IN_FORCE if self.kept else CalibrationState.NONE
            return wire.MapInfo(asked.req_id, 0, state, (0,) * 16, 0, len(self.kept), zlib.crc32(self.kept))
        if isinstance(asked, wire.ReadMap):
            data = self.kept[asked.offset : asked.offset + PART_BYTES].ljust(PART_BYTES, b"\xff")
            data = bytes([data[0] ^ self.reads_wrong]) + data[1:]
            return wire.MapData(asked.req_id, 0, asked.offset, tuple(data))
        error = wire.Error.OK
        if isinstance(asked, wire.BeginMap):
            self.coming, self.begun = bytearray(asked.size_bytes), True
        elif isinstance(asked, wire.WriteMap):
            error = wire.Error.OK if self.begun else wire.Error.NOT_BEGUN
            data = bytes(asked.data)[: len(self.coming) - asked.offset]
            self.coming[asked.offset : asked.offset + len(data)] = data
        elif isinstance(asked, wire.EndMap):
            if self.begun and zlib.crc32(self.coming) == asked.crc32:
                self.kept, self.begun = bytes(self.coming), False
            if zlib.crc32(self.kept) == asked.crc32:
                return self._answer(wire.GetMap(asked.req_id, 0))
            error = wire.Error.NOT_BEGUN
        return wire.Reply(asked.req_id, asked.ID, error)  # type: ignore[attr-defined]


@pytest.fixture
def board(scripted_board, hello, time_passes) -> Iterator[tuple[Upload, biotac.Hand]]:
    upload = Upload(hello, time_passes)
    with biotac.open(scripted_board(upload).path) as hand:
        yield upload, hand


def test_a_lost_reply_is_asked_for_again_at_every_step(board: tuple[Upload, biotac.Hand]) -> None:
    upload, hand = board
    blob = make_map(1, blocks=2)
    steps = 3 + -(-len(blob) // PART_BYTES)  # begin, parts, end, and the question for the map
    for step in range(steps):
        upload.commands.clear()
        upload.silent = {step}
        upload.kept = b""
        hand.board.set_map(0, blob)
        assert upload.kept == blob
        assert upload.commands[step] == upload.commands[step + 1]


def test_a_board_that_restarts_in_the_middle_is_told_all_of_it_again(board: tuple[Upload, biotac.Hand]) -> None:
    upload, hand = board
    blob = make_map(1, blocks=2)
    last = 1 + -(-len(blob) // PART_BYTES)
    for step in (1, 2, last):  # a part, another one, the end
        upload.commands.clear()
        upload.forgets = {step}
        upload.kept = b""
        hand.board.set_map(0, blob)
        assert (upload.kept, upload.commands.count(wire.BeginMap)) == (blob, 2)
    upload.commands.clear()
    upload.forgets = set(range(100))
    with pytest.raises(biotac.CommandRefusedError, match="NOT_BEGUN"):
        hand.board.set_map(0, blob)
    assert upload.commands.count(wire.BeginMap) == 3


def test_a_map_that_comes_back_otherwise_is_an_error(board: tuple[Upload, biotac.Hand]) -> None:
    upload, hand = board
    upload.reads_wrong = True
    with pytest.raises(biotac.PortError, match="did not arrive intact in 3 tries"):
        hand.board.set_map(0, make_map(1, blocks=2))


def test_a_board_that_rebooted_gets_its_maps_again(tmp_path: Path) -> None:
    """The real firmware: a process that dies, and another one of the same serial number behind the same name."""
    path = tmp_path / "ttyBOARD"
    boards: list[ServedBoard] = []

    def boot(pauses: int) -> None:
        if not boards or pauses == 2:
            # At the pace of life: unpaced, the tape could be over before the board has the map and is to stream.
            boards.append(ServedBoard(load_source("press.toml", fingers=2, seconds=600), pace=1.0, hold=True))
            boards[-1].release()
            point(path, boards[-1].path)

    clock = Clock()
    clock.while_away = boot
    boot(0)
    with Hand(SerialLink(str(path)), reconnect=True, host_clock=clock) as hand:
        blob = make_map(1, blocks=BIG)
        hand.board.set_map(1, make_map(2))
        hand.board.set_map(1, blob)
        hand.board.set_map(0, blob)
        hand.board.clear_map(0)
        batches = hand.batches()
        next(batches)
        boards[0].close()
        point(path, "")
        assert any(isinstance(m, biotac.Gap) for batch in batches for m in batch.messages)
        assert hand.board.maps() == {1: blob}
    boards[1].close()


# ---- where maps are kept -----------------------------------------------------------------------------


def test_a_saved_map_holds_after_the_next_boot(tmp_path: Path) -> None:
    flash = tmp_path / "flash"
    with boot(flash) as hand:
        own, anyones = make_map(1, serial=port_serial(hand, 0), blocks=BIG), make_map(2)
        hand.board.set_map(0, own)
        hand.board.set_map(1, anyones)
        hand.board.save_settings()
        hand.board.clear_map(1)  # not saved
    with boot(flash) as hand:
        assert hand.board.maps() == {0: own, 1: anyones}
        hand.board.clear_map(1)
        hand.board.save_settings()
    with boot(flash, ["BTOTHER", "BTANOTHER"]) as hand:
        assert hand.board.map_state(0) == CalibrationState.OTHER_SENSOR
        assert hand.board.get_map(0) == own
        assert (hand.board.get_map(1), hand.board.map_state(1)) == (None, CalibrationState.NONE)
        assert hand.board.maps() == {}


def test_a_computer_with_sensors_of_its_own_keeps_maps_until_it_is_closed(tmp_path: Path, monkeypatch) -> None:
    bus = fake_spidev.Bus(load_source("press.toml", fingers=2, seconds=1), tmp_path, frozenset())
    bus.install(monkeypatch)
    with biotac.open("spidev:0.0,0.1") as hand:
        maps = {f: make_map(f, serial=port_serial(hand, f), blocks=BIG) for f in range(2)}
        for finger, blob in maps.items():
            hand.board.set_map(finger, blob)
        hand.board.set_map(1, maps[1])
        assert hand.board.maps() == maps
    with biotac.open("spidev:0.0,0.1") as hand:
        assert hand.board.maps() == {}


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """A recording of two fingers, the second with a map."""
    path = tmp_path / "two.mcap"
    with biotac.open("sim:press.toml?fingers=2&seconds=1") as hand:
        hand.board.set_map(1, make_map(5, serial=port_serial(hand, 1), blocks=BIG))
        hand.record(path)
        hand.read(0.5)
    return path


def test_a_recording_has_the_maps_and_answers_with_them(recorded: Path) -> None:
    maps = Recording(recorded).maps
    assert list(maps) == [1]
    assert from_blob(maps[1]).made_s == 5
    with biotac.open(f"replay:{recorded}") as hand:
        assert hand.board.maps() == maps
        assert (hand.board.get_map(0), hand.board.map_state(0)) == (None, CalibrationState.NONE)
        assert hand.board.map_state(1) == CalibrationState.IN_FORCE
        with pytest.raises(biotac.CommandRefusedError, match="is a recording: BeginMap"):
            hand.board.set_map(0, maps[1])


def test_a_recording_made_of_one_has_them_too(recorded: Path, tmp_path: Path) -> None:
    again = tmp_path / "again.mcap"
    assert main(["check", str(recorded)]) == 0
    assert main(["export", "--recompute", str(recorded), str(again)]) == 0
    old, new = Recording(recorded), Recording(again)
    assert new.maps == old.maps
    assert new.wire.tobytes() == old.wire.tobytes()
    assert {int(f) for f in new.wire["finger"][(new.wire["flags"] & biotac.FrameFlags.MAPPED) != 0]} == {1}
    # With another map in force it says so, and is right by that one.
    recompute(old, tmp_path / "other.mcap", {}, maps={1: make_map(8)})
    assert Recording(tmp_path / "other.mcap").maps == {1: make_map(8)}
    assert main(["check", str(tmp_path / "other.mcap")]) == 0


def test_a_recording_with_a_damaged_map_or_calibration_is_refused(recorded: Path, tmp_path: Path) -> None:
    for key, what in (("maps", base64.b64encode(bytes(5)).decode()), ("maps", "!"), ("calibrations", {"format": "x"})):
        damaged = Recording(recorded).metadata | {key: json.dumps({"0": what})}
        with pytest.raises(biotac.RecordingError, match="damaged metadata"):
            Recording(written(tmp_path / "damaged.mcap", damaged, []))


# ---- files and the command line --------------------------------------------------------------------


def test_a_file_is_read_back_and_one_that_was_changed_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "thumb.json"
    blob = make_map(7, serial="BT7")
    path.write_text(map_file.dumps(blob, {"rmse_n": 0.2}))
    assert map_file.load(path) == blob
    tree = json.loads(path.read_text())
    assert (tree["serial"], tree["made_s"], tree["provenance"]) == ("BT7", 7, {"rmse_n": 0.2})
    worse = bytes([9]) + blob[1:]
    edited = {key: value for key, value in tree.items() if key != "crc32"} | {"crc32": "edited"}
    wrong = {
        '"crc32": .* it is damaged; take an intact copy, or, if you edited it, write "crc32": "edited"': [
            tree | {"serial": "BT8"},
            tree | {"map": "B" + tree["map"][1:]},
            {key: value for key, value in tree.items() if key != "crc32"},
        ],
        "serial is 'BT8', but the map says 'BT7'": [edited | {"serial": "BT8"}],
        "the file was edited or cut off": [edited | {"map": base64.b64encode(blob[:-3]).decode()}],
        r"would refuse this wrench map of \d+ bytes \(OUT_OF_RANGE\)": [map_file.to_dict(worse) | {"crc32": "edited"}],
        "its map is not base64": [edited | {"map": "?"}],
        'expected "biotac-wrench-map/1"': [[], tree | {"format": "biotac-wrench-map/2"}],
    }
    for message, every in wrong.items():
        for changed in every:
            path.write_text(json.dumps(changed))
            with pytest.raises(biotac.InputError, match=message):
                map_file.load(path)
    path.write_text(json.dumps(edited | {"provenance": {"note": "mine"}}))
    assert map_file.load(path) == blob


def test_the_verb_puts_shows_gets_and_clears(port: str, recorded: Path, tmp_path: Path, capsys) -> None:
    own, other, back = (tmp_path / f"{name}.json" for name in ("mine", "other", "back"))
    blob = make_map(1_763_731_310)
    own.write_text(map_file.dumps(blob))
    assert main(["calibrate", "put", port, str(own), "--finger", "1", "--save"]) == 0
    output = capsys.readouterr().out
    assert "finger 1: wrench map in force, saved; force and torque, 3 block(s), 572 bytes, for any sensor" in output
    assert main(["calibrate", "show", port]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert shown[0] == "finger 0: none, the board's settings apply"
    assert shown[1].startswith("finger 1: wrench map in force; force and torque") and "made 2025-11-21" in shown[1]
    assert main(["info", port]) == 0
    assert "wrench map made 2025-11-21" in capsys.readouterr().out
    assert main(["info", port, "--json"]) == 0
    assert list(json.loads(capsys.readouterr().out)["maps"]) == ["1"]
    assert main(["calibrate", "get", port, str(back), "--finger", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["map_crc32"] == f"{zlib.crc32(blob):08x}"
    assert map_file.load(back) == blob
    assert main(["calibrate", "clear", port, "--finger", "1"]) == 0
    assert "the board's settings apply, until the next reboot" in capsys.readouterr().out
    assert main(["calibrate", "show", port, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["1"]["map"] == {"state": "NONE"}
    other.write_text(map_file.dumps(make_map(1, serial="BTOTHER")))
    assert main(["calibrate", "put", port, str(other), "--finger", "0", "--force"]) == 0
    assert "for any sensor" in capsys.readouterr().out
    assert main(["calibrate", "show", str(recorded)]) == 0
    assert "finger 1: wrench map in force; force and torque, 12 block(s)" in capsys.readouterr().out


def test_torsion_goes_wherever_results_go(tmp_path: Path) -> None:
    coefficients = np.random.default_rng(4).integers(-(2**12), 2**12, (19, 7))
    turning = BoardBlock(_map.Kind.SIGNAL, _map.Gate.ONE, (8,) * 7, coefficients)
    blob = BoardMap(7, (turning,)).blob
    path = tmp_path / "turned.mcap"
    with biotac.open("sim:press.toml?seconds=6") as hand:
        hand.board.set_map(0, blob)
        hand.record(path)
        hand.read_batch(100)
    assert map_file.title(blob).startswith("force, torque and torsion, 1 block(s), 324 bytes")
    recording = Recording(path)
    sent = recording.wire["torsion_mnmm"]
    mapped = (recording.wire["flags"] & biotac.FrameFlags.MAPPED) != 0
    assert mapped.sum() > 100 and len(np.unique(sent[mapped])) > 10
    np.testing.assert_array_equal(sent != wire.INVALID_I32, mapped)
    np.testing.assert_array_equal(recording.frames["torsion_nmm"], np.where(mapped, sent / 1e3, np.nan))
    np.testing.assert_array_equal(tables(recording)[0].arrays["torsion_nmm"], np.where(mapped, sent / 1e3, np.nan))
    for keep_tare in (True, False):
        again = tmp_path / f"again{keep_tare}.mcap"
        recompute(recording, again, {}, keep_tare=keep_tare)
        np.testing.assert_array_equal(Recording(again).wire["torsion_mnmm"], sent)
    recompute(recording, tmp_path / "plain.mcap", {}, keep_tare=True, maps={0: make_map(4, axes=6)})
    assert (Recording(tmp_path / "plain.mcap").wire["torsion_mnmm"] == wire.INVALID_I32).all()
