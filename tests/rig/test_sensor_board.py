"""The host's side of the sensor board, against a board that is a few lines of Python: no slot twice, none left out."""

import threading
import time
import zlib
from dataclasses import replace
from itertools import count
from typing import Any

import numpy as np
import pytest

from biotac.cli.main import main
from biotac.errors import CommandRefusedError, DeviceLostError, NotAGatewayError, PortError
from biotac.hand.opening import open as open_hand
from biotac.link.serial_port import SerialLink
from biotac.sim.fault_gen import EmuFault
from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode
from biotac_rig import emu_gen as emu
from biotac_rig.sensor_board import SensorBoard


class FakeSensorBoard:
    """Takes a tape as firmware/sensor_board does; ``serve`` slots of it are played between two questions."""

    def __init__(self, hello: Any, *, room: int = 100_000, serve: int = 0, deaf_to: int = -1) -> None:
        self.hello = hello
        self.board = int(wire.BoardKind.PICO_SENSOR)
        self.room, self.serve, self.deaf_to = room, serve, deaf_to
        self.rows: list[tuple[int, ...]] = []
        self.served = 0
        self.plugged: dict[int, emu.EmuPlug] = {}
        self.faults: dict[int, int] = {}
        self.parts = 0
        self.play: emu.EmuPlay | None = None
        self.keeping = self.kept = 0

    def answer(self, message_id: int, payload: bytes) -> bytes:
        if message_id == wire.HelloRequest.ID:
            return self.hello(payload, board=self.board)
        if message_id == emu.EmuPlug.ID:
            plug = emu.EmuPlug.unpack(payload)
            self.plugged[plug.finger] = plug
        elif message_id == emu.EmuTape.ID:
            self.parts += 1
            if self.parts == self.deaf_to:
                return b""
            self._add(emu.EmuTape.unpack(payload))
        elif message_id == emu.EmuSetFault.ID:
            fault = emu.EmuSetFault.unpack(payload)
            if fault.finger > 4:
                return encode(wire.Reply.ID, wire.Reply(payload[0], message_id, wire.Error.NO_SUCH_FINGER).pack())
            self.faults[fault.finger] = fault.fault
        elif message_id == emu.EmuPlay.ID:
            self.play = emu.EmuPlay.unpack(payload)
        elif message_id == emu.EmuKeep.ID:
            keep = emu.EmuKeep.unpack(payload)
            if keep.slots and (keep.slots, keep.crc32) != (
                len(self.rows),
                zlib.crc32(np.array(self.rows, "<u2").tobytes()),
            ):
                return encode(wire.Reply.ID, wire.Reply(payload[0], message_id, wire.Error.NOT_WHOLE).pack())
            self.keeping = keep.slots
        elif message_id == emu.EmuGetStatus.ID:
            self.kept = self.keeping
            self.served = min(len(self.rows), self.served + self.serve)
        else:
            return encode(wire.Reply.ID, wire.Reply(payload[0], message_id, wire.Error.UNKNOWN_COMMAND).pack())
        room = self.room - (len(self.rows) - self.served)
        facts = (0x1F, len(self.rows), min(room, 0xFFFF), self.served, 0, 0, 0, 0, 0, 0, self.kept, 0, 0, 0)
        return encode(emu.EmuStatus.ID, emu.EmuStatus(payload[0], *facts).pack())

    def _add(self, part: emu.EmuTape) -> None:
        samples = np.frombuffer(bytes(part.samples), "<u2")[: part.slots * part.fingers]
        fits = part.slots <= self.room - (len(self.rows) - self.served)
        if part.first_slot == len(self.rows) and fits:
            self.rows += [tuple(row) for row in samples.reshape(part.slots, part.fingers).tolist()]


def rows_of(source: Any) -> list[tuple[int, ...]]:
    return [tuple(row) for frame in source.samples.transpose(0, 2, 1).tolist() for row in frame]


@pytest.mark.parametrize(
    ("fingers", "facts"),
    [(1, {}), (5, {"room": 3 * 44, "serve": 50}), (5, {"deaf_to": 5})],
    ids=["roomy", "full", "a part lost"],
)
def test_the_whole_tape_is_there_in_order(scripted_board, hello, facts: dict[str, int], fingers: int) -> None:
    fake = FakeSensorBoard(hello, **facts)
    source = load_source("press.toml", fingers=fingers, seconds=0.2)
    board = SensorBoard(SerialLink(scripted_board(fake.answer).path))
    board.plug(source)
    assert [plug.present for _, plug in sorted(fake.plugged.items())] == [f < fingers for f in range(5)]
    status = board.feed()
    board.close()
    assert status.slots_taken == len(fake.rows)
    assert fake.rows == rows_of(source)


def test_a_full_board_is_left_alone_until_the_gateway_has_power(scripted_board, hello) -> None:
    fake = FakeSensorBoard(hello, room=200)
    board = SensorBoard(SerialLink(scripted_board(fake.answer).path))
    board.plug(load_source("press.toml", fingers=5, seconds=0.2))
    assert 200 - 22 < board.feed(until_full=True).slots_taken <= 200
    board.close()


def test_a_fault_of_no_finger_is_refused(scripted_board, hello) -> None:
    fake = FakeSensorBoard(hello)
    board = SensorBoard(SerialLink(scripted_board(fake.answer).path))
    with pytest.raises(CommandRefusedError, match="NO_SUCH_FINGER"):
        board.fault(5, EmuFault.NONE)
    board.close()


def test_a_gateway_is_no_sensor_board_nor_the_other_way_round(scripted_board, hello) -> None:
    fake = FakeSensorBoard(hello)
    path = scripted_board(fake.answer).path
    with pytest.raises(NotAGatewayError, match="biotac sim SOURCE --sensor-port"):
        open_hand(path)
    fake.board = int(wire.BoardKind.PICO)
    with pytest.raises(PortError, match="is PICO, not a sensor board"):
        SensorBoard(SerialLink(path))


def test_the_verb_plays_a_source_and_says_how_it_went(scripted_board, hello, capsys) -> None:
    fake = FakeSensorBoard(hello, room=500, serve=500)
    words = ["sim", "press.toml", "--sensor-port", scripted_board(fake.answer).path, "--fingers", "2"]
    assert main([*words, "--seconds", "0.2", "--fault", "1=unplugged"]) == 0
    assert capsys.readouterr().out.startswith("880 of 880 slots served")
    assert fake.faults == {1: int(EmuFault.UNPLUGGED)}
    assert main([*words, "--fault", "2=loose"]) == 2
    assert "no fault 'loose', expected one of" in capsys.readouterr().err


def test_a_tape_is_kept_and_forgotten(scripted_board, hello, capsys) -> None:
    fake = FakeSensorBoard(hello, room=900)
    port = scripted_board(fake.answer).path

    def run(*words: str, code: int = 0) -> str:
        assert main(["sim", "--sensor-port", port, *words]) == code
        output = capsys.readouterr()
        return output.err if code else output.out

    assert "0.20 s stored in its flash" in run("press.toml", "--fingers", "2", "--seconds", "0.2", "--keep")
    assert fake.kept == 880
    run("--forget")
    assert fake.keeping == 0
    error = run("press.toml", "--fingers", "2", "--seconds", "0.3", "--keep", code=2)
    assert "0.3 s of 2 fingers do not fit the board: expected up to 0.2" in error
    assert "--keep needs a SOURCE" in run("--keep", code=2)


def test_a_tape_that_the_board_has_not_whole_is_not_kept(scripted_board, hello) -> None:
    fake = FakeSensorBoard(hello)
    board = SensorBoard(SerialLink(scripted_board(fake.answer).path))
    board.plug(load_source("press.toml", fingers=1, seconds=0.1))
    board.feed()
    fake.rows[7] = (1,)
    with pytest.raises(CommandRefusedError, match="NOT_WHOLE"):
        board.keep()
    board.close()


def test_the_tape_can_be_held_and_keep_to_the_clock(scripted_board, hello) -> None:
    fake = FakeSensorBoard(hello)
    board = SensorBoard(SerialLink(scripted_board(fake.answer).path))
    board.play(hold_slot=44)
    assert fake.play is not None and (fake.play.hold_slot, fake.play.by_time) == (44, 0)
    board.play(by_time=True)
    assert (fake.play.hold_slot, fake.play.by_time) == (0xFFFFFFFF, 1)
    board.close()


def test_a_lost_part_of_rounds_put_one_by_one_is_sent_again(scripted_board, hello) -> None:
    fake = FakeSensorBoard(hello, deaf_to=9)
    source = load_source("press.toml", fingers=5, seconds=0.4)
    board = SensorBoard(SerialLink(scripted_board(fake.answer).path))
    board.plug(replace(source, samples=source.samples[:0]))  # nothing ahead
    for k, words in enumerate(source.samples, 1):
        board.put(words[None])
        if k % 20 == 0:
            board.send_lost()
    assert board.status().slots_taken == len(fake.rows) and fake.rows == rows_of(source)
    fake.rows.clear()  # a restart
    for words in source.samples:
        board.put(words[None])
    with pytest.raises(DeviceLostError, match="has 0 slots of its tape"):
        board.send_lost()
    board.close()


def test_a_simulated_board_that_hangs_is_given_up(scripted_board, hello, monkeypatch) -> None:
    board = SensorBoard(SerialLink(scripted_board(FakeSensorBoard(hello).answer).path))
    board.listen()
    board.plug(load_source("press.toml", fingers=1, seconds=0.1))
    seconds, this = count(0.0, 30.0), threading.current_thread()  # pass with each look
    monkeypatch.setattr(time, "monotonic", lambda: next(seconds) if threading.current_thread() is this else 0.0)
    with pytest.raises(DeviceLostError, match="computed nothing for"):
        board.wait_still()
    board.close()
