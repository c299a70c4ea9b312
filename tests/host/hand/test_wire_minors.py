"""This library with boards of every wire minor since 1.0, and hosts of those with this firmware.

The old side is made of tests/data/wire/minors.json: which messages and settings each minor added or changed, taken from
link.toml of the commit that it names, and no code of ours.
"""

from __future__ import annotations

import json
import os
import select
import struct
import threading
import time
import zlib
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from cobs import cobs

import biotac
from biotac.keep import Calibration
from biotac.sim.loading import load_source
from biotac.sim.process import SimBoard
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode

MINORS = json.loads((Path(__file__).parents[2] / "data/wire/minors.json").read_text())
CODE = {"u8": "B", "u16": "H", "u32": "I", "i16": "h", "i32": "i"}
CALIBRATION = Calibration(2, (1000, 2000, 3000), (400, 500), 600, made_s=5)
each_minor = pytest.mark.parametrize("minor", [int(minor) for minor in MINORS])


class Frames:
    """A byte stream's frames, whatever lengths their messages have."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, chunk: bytes) -> list[tuple[int, bytes]]:
        *pieces, self._rest = (self._rest + chunk).split(b"\0")
        plain = [cobs.decode(piece) for piece in pieces if piece]
        assert all(zlib.crc32(its[:-4]).to_bytes(4, "little") == its[-4:] for its in plain)
        return [(its[0], its[1:-4]) for its in plain]


class Old:
    """A side of wire 1.``minor``: messages to and from bytes as it knew them."""

    def __init__(self, minor: int) -> None:
        self.minor = minor
        self.layouts: dict[str, tuple[int, list[tuple[str, str, int]]]] = {}
        self.settings: dict[str, int] = {}
        for k in range(minor + 1):
            for name, (message_id, *fields) in MINORS[str(k)]["messages"].items():
                self.layouts[name] = (message_id, fields)
            self.settings |= MINORS[str(k)]["settings"]
        self.names = {message_id: name for name, (message_id, _) in self.layouts.items()}

    def bytes_of(self, name: str) -> int:
        return self._struct(name).size

    def _struct(self, name: str) -> struct.Struct:
        return struct.Struct("<" + "".join(f"{n}{CODE[kind]}" for _, kind, n in self.layouts[name][1]))

    def frame(self, name: str, **values: Any) -> bytes:
        """A frame on the wire; what is not given is 0."""
        flat: list[int] = []
        for field, _, n in self.layouts[name][1]:
            value = values.get(field, 0)
            flat += list(value) if isinstance(value, (tuple, list)) else [value] * n
        return encode(self.layouts[name][0], self._struct(name).pack(*flat))

    def read(self, name: str, payload: bytes) -> dict[str, Any]:
        """Fields of a payload, which may be longer: hosts of all minors read what they know."""
        values = list(self._struct(name).unpack_from(payload))
        return {
            field: values.pop(0) if n == 1 else [values.pop(0) for _ in range(n)]
            for field, _, n in self.layouts[name][1]
        }


class OldBoard(Old):
    """What firmware of that minor answers; a stream is five FRAMEs."""

    def __init__(self, minor: int) -> None:
        super().__init__(minor)
        self.send: Callable[[bytes], object] = lambda data: None
        self.calibration: dict[str, Any] = {"state": 0}
        self.set: dict[int, int] = {}

    def __call__(self, message_id: int, payload: bytes) -> bytes:
        name = self.names.get(message_id)
        if name is None:
            return self.refuse(payload[0], message_id, wire.Error.UNKNOWN_COMMAND)
        if len(payload) != self.bytes_of(name):
            return self.refuse(0, message_id, wire.Error.BAD_LENGTH)
        its = self.read(name, payload)
        answer = getattr(self, name.lower(), None)
        if answer is not None:
            return answer(**its)
        if name.startswith("GET_"):
            return self.frame(name.removeprefix("GET_"), req_id=its["req_id"], finger=its.get("finger", 0))
        return self.refuse(its["req_id"], message_id, wire.Error.OK)

    def refuse(self, req_id: int, command: int, error: int) -> bytes:
        return self.frame("REPLY", req_id=req_id, command=command, error=int(error))

    def hello_request(self, req_id: int, nonce: int) -> bytes:
        facts = {"wire_major": 1, "wire_minor": self.minor, "slot_hz": 4400, "fingers_present": 1, "firmware_minor": 1}
        return self.frame("HELLO", req_id=req_id, nonce=nonce, board=1, boot_id=7, schema_hash=0x12345678, **facts)

    def get_setting(self, req_id: int, setting: int) -> bytes:
        if setting not in self.settings.values():
            return self.refuse(req_id, wire.GetSetting.ID, wire.Error.UNKNOWN_SETTING)
        return self.frame("SETTING", req_id=req_id, setting=setting, value=self.set.get(setting, 100 + setting))

    def set_setting(self, req_id: int, setting: int, value: int) -> bytes:
        self.set[setting] = value
        return self.get_setting(req_id, setting)

    def set_calibration(self, req_id: int, **its: Any) -> bytes:
        self.calibration = its | {"state": int(wire.CalibrationState.IN_FORCE)}
        return self.get_calibration(req_id, its["finger"])

    def get_calibration(self, req_id: int, finger: int) -> bytes:
        its = self.calibration if finger == 0 else {"state": 0}
        return self.frame("CALIBRATION", **{**its, "req_id": req_id, "finger": finger})

    def get_map(self, req_id: int, finger: int) -> bytes:
        return self.frame("MAP_INFO", req_id=req_id, finger=finger)

    def start(self, req_id: int, **its: Any) -> bytes:
        frames = []
        for k in range(5):
            frames.append(self.frame("FRAME", seq=k, t_us=10_000 * k, counts=list(range(2000, 2019)), pdc=700 + k,
                                   poc_um=(1000, 2000, 4000), force_100un=(10_000, -5000, 20_000),
                                   tare_q4=[32_000] * 19, pdc_tare_q4=11_200, tare_state=1))  # fmt: skip
        threading.Timer(0.05, self.send, [b"".join(frames)]).start()
        return self.refuse(req_id, wire.Start.ID, wire.Error.OK)


@pytest.fixture
def board(scripted_board) -> Callable[[int], tuple[OldBoard, str]]:
    def make(minor: int) -> tuple[OldBoard, str]:
        old = OldBoard(minor)
        far_end = scripted_board(old, frames=Frames())
        old.send = lambda data: os.write(far_end._master, data)
        return old, far_end.path

    return make


def one_line_with(cure: str, error: BaseException) -> None:
    assert cure in str(error) and "\n" not in str(error)


# ---- an old board ------------------------------------------------------------------------------------


@each_minor
def test_an_old_board_is_told_of_and_streams(minor: int, board, tmp_path: Path) -> None:
    _, path = board(minor)
    with biotac.open(path) as hand:
        assert hand.info.wire_minor == minor
        (warning,) = hand.warnings
        assert warning.code == "schema_differs" and warning.text.endswith("biotac flash") and "\n" not in warning.text
        hand.record(tmp_path / "a.mcap")
        rows = hand.read(0.03)
    assert rows["counts"].tolist() == [list(range(2000, 2019))] * 3 and rows["pdc"].tolist() == [700, 701, 702]
    assert rows["force_n"][2].tolist() == [1.0, -0.5, 2.0] and rows["poc_mm"][0].tolist() == [1.0, 2.0, 4.0]
    assert set(rows["tare"].ravel()) == {2000.0} and set(rows["pdc_tare"]) == {700.0}
    # What its FRAMEs did not have yet is invalid, never 0.
    for field, since in (("poc_sigma_mm", 1), ("force_sigma_n", 1), ("pdc_filtered", 4), ("torsion_nmm", 4)):
        assert np.isnan(rows[field]).all() == (minor < since), field
    recording = biotac.Recording(tmp_path / "a.mcap")
    assert recording.problems == [] and recording.info.wire_minor == minor
    assert biotac.load(tmp_path / "a.mcap")[:3].tobytes() == rows.tobytes()


@each_minor
def test_an_old_boards_settings_are_its_own_and_the_rest_as_before_them(minor: int, board) -> None:
    old, path = board(minor)
    with biotac.open(path) as hand:
        for setting, value in hand.settings().items():
            known = setting.name.lower() in old.settings
            assert value == (100 + setting if known else wire.SETTINGS[setting].before)
        hand.set_setting(biotac.Setting.STATUS_PERIOD_MS, 250)
        assert old.set == {int(biotac.Setting.STATUS_PERIOD_MS): 250}
        with pytest.raises(biotac.CommandRefusedError) as refused:
            hand.set_setting(biotac.Setting.FORCE_MODEL, 0)
    one_line_with("update the firmware: biotac flash", refused.value)


@each_minor
def test_an_old_board_keeps_calibrations_as_far_as_it_knows_them(minor: int, board) -> None:
    _, path = board(minor)
    with biotac.open(path) as hand:
        if minor < 3:
            assert hand.calibrations() == {}
            with pytest.raises(biotac.CommandRefusedError) as refused:
                hand.set_calibration(0, CALIBRATION)
            one_line_with("update the firmware: biotac flash", refused.value)
            return
        hand.set_calibration(0, CALIBRATION)
        assert hand.calibrations() == {0: CALIBRATION}


@each_minor
def test_what_an_old_board_cannot_do_is_said_in_one_line(minor: int, board) -> None:
    _, path = board(minor)
    since = {"subscribe": 1, "point": 1, "save_settings": 2, "get_map": 4, "hold": 5, "on_event": 5, "on_bands": 5}
    calls = {
        "subscribe": lambda hand: hand.subscribe(biotac.QuantityFlags.FORCE),
        "point": lambda hand: hand.point(0),
        "save_settings": lambda hand: hand.save_settings(),
        "get_map": lambda hand: hand.get_map(0),
        "hold": lambda hand: hand.hold(0),
        "on_event": lambda hand: hand.on_event(print),
        "on_bands": lambda hand: hand.on_bands(print),
    }
    with biotac.open(path) as hand:
        assert hand.maps() == {} and hand.status().t_us == 0
        for name, call in calls.items():
            if minor >= since[name]:
                call(hand)
                continue
            with pytest.raises((biotac.CommandRefusedError, biotac.WireVersionError)) as refused:
                call(hand)
            one_line_with("biotac flash", refused.value)


def test_a_board_that_wants_longer_commands_is_understood(scripted_board, hello) -> None:
    """As this library with a board to come: the refusal has no number of ours, and is still this command's."""

    def answer(message_id: int, payload: bytes) -> bytes:
        if message_id == wire.HelloRequest.ID:
            return hello(payload, wire_minor=wire.WIRE_MINOR + 1, schema_hash=1)
        error = wire.Error.BAD_LENGTH if message_id == wire.SetCalibration.ID else wire.Error.OK
        return encode(wire.Reply.ID, wire.Reply(0 if error else payload[0], message_id, error).pack())

    with biotac.open(scripted_board(answer).path) as hand, pytest.raises(biotac.CommandRefusedError) as refused:
        hand.set_calibration(0, CALIBRATION)
    one_line_with("update this library: pip install -U biotac-gateway", refused.value)


# ---- an old host -------------------------------------------------------------------------------------


class OldHost(Old):
    """A host of that minor on a port: what it says, and what it makes of the answers."""

    def __init__(self, minor: int, path: str) -> None:
        super().__init__(minor)
        self._fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
        self._frames = Frames()
        self._heard: deque[tuple[int, bytes]] = deque()  # one read may bring several

    def close(self) -> None:
        os.close(self._fd)

    def ask(self, command: str, **values: Any) -> tuple[str, dict[str, Any]]:
        """The first answer with the command's number, or a refusal without one; what is streamed has none."""
        os.write(self._fd, self.frame(command, **{"req_id": 9, **values}))
        return self.hear(lambda name, its: its.get("req_id") in (0, 9))

    def stream(self, seconds: int = 0) -> list[dict[str, Any]]:
        """FRAMEs of a moment."""
        frames: list[dict[str, Any]] = []
        self.ask("START", fingers=1, streams=1, keepalive_ms=0)
        while len(frames) < 5:
            frames.append(self.hear(lambda name, its: name == "FRAME")[1])
        return frames

    def hear(self, wanted: Callable[[str, dict[str, Any]], bool]) -> tuple[str, dict[str, Any]]:
        give_up_s = time.monotonic() + 60
        while time.monotonic() < give_up_s:
            if not self._heard:
                if select.select([self._fd], [], [], 1.0)[0]:
                    self._heard.extend(self._frames.feed(os.read(self._fd, 4096)))
                continue
            message_id, payload = self._heard.popleft()
            name = self.names.get(message_id)  # ids that it does not know mean nothing to it
            if name is not None and wanted(name, its := self.read(name, payload)):
                return name, its
        raise AssertionError("no answer")


@pytest.fixture
def old_host(tmp_path: Path):
    """Makes hosts on one running board of this firmware."""
    board = SimBoard(load_source("press.toml", fingers=1, seconds=30.0), pace=1.0, hold=False)
    hosts: list[OldHost] = []

    def make(minor: int) -> OldHost:
        hosts.append(OldHost(minor, board.path))
        return hosts[-1]

    yield make
    for host in hosts:
        host.close()
    board.close()


@each_minor
def test_an_old_host_meets_this_firmware(minor: int, old_host) -> None:
    """It is told of the newer wire, reads FRAMEs, settings and calibrations as far as it knows, and is understood."""
    host = old_host(minor)
    os.write(host._fd, b"\0")
    name, its = host.ask("HELLO_REQUEST", nonce=77)
    assert (name, its["nonce"], its["wire_major"], its["wire_minor"]) == ("HELLO", 77, 1, wire.WIRE_MINOR)
    for setting in host.settings.values():
        name, its = host.ask("GET_SETTING", setting=setting)
        assert name == "SETTING" and host.ask("SET_SETTING", setting=setting, value=its["value"]) == (name, its)
    if minor >= 3:
        name, its = host.ask("GET_CALIBRATION", finger=0)
        assert (name, its["state"]) == ("CALIBRATION", wire.CalibrationState.NONE)
        value = [CALIBRATION.wire_values()[k] for k in range(len(its["value"]))]
        name, its = host.ask("SET_CALIBRATION", finger=0, serial=0, made_s=5, value=value)
        assert (name, its["state"], its["value"]) == ("CALIBRATION", wire.CalibrationState.IN_FORCE, value)
    if minor >= 4:
        name, its = host.ask("GET_MAP", finger=0)
        assert (name, its["state"]) == ("MAP_INFO", wire.CalibrationState.NONE)
    frames = host.stream()
    assert [its["seq"] for its in frames] == list(range(frames[0]["seq"], frames[0]["seq"] + 5))
    assert all(1000 < count < 4095 for its in frames for count in its["counts"])
    assert host.ask("STOP")[0] == "REPLY"


@each_minor
def test_no_command_of_an_old_host_is_unknown(minor: int, old_host) -> None:
    """Or of another length: with nonsense in them they are refused for what they ask, or obeyed."""
    host = old_host(minor)
    for command, (message_id, _) in host.layouts.items():
        if message_id < 0x80 or command in ("HELLO_REQUEST", "START", "REBOOT_BOOTLOADER"):
            continue
        name, its = host.ask(command, **dict.fromkeys(("finger", "setting"), 200))
        if name == "REPLY":
            assert its["error"] not in (wire.Error.UNKNOWN_COMMAND, wire.Error.BAD_LENGTH), command
