"""Troubles that a hand must not keep quiet about: a lost board, a full disk, names that do not exist."""

from __future__ import annotations

import threading

import numpy as np
import pytest
from live_board import WAIT_S, Live, frame, until

import biotac
from biotac.board import board as board_module
from biotac.recording.writer import Writer
from biotac.wire import messages_gen as wire


def lose(live: Live) -> None:
    live.hand.stream()
    live.send(frame(1, force_z_n=2.5))
    until(lambda: live.hand[0].t_us == 10_000)
    live.board.hang_up()
    until(lambda: not live.hand.connected)


def test_a_lost_board_is_an_error_at_the_end_of_the_block(live: Live) -> None:
    with pytest.raises(biotac.DeviceLostError, match="went away while it was open"), live.hand:
        lose(live)


@pytest.mark.parametrize(
    "use",
    [
        lambda hand, view: hand.ping(),
        lambda hand, view: view.force_n,
        lambda hand, view: view.frame,
        lambda hand, view: view.next_frame(),
        lambda hand, view: hand.read(1.0),
        lambda hand, view: hand.check(),
        lambda hand, view: hand.streaming,
        lambda hand, view: hand.stats,
        lambda hand, view: hand.stream(),
        lambda hand, view: hand.on_batch(print),
    ],
)
def test_a_lost_board_is_an_error_at_the_next_call(live: Live, use) -> None:
    with live.hand as hand:
        view = hand[0]
        lose(live)
        until(lambda: hand._board.connection.failure)
        with pytest.raises(biotac.DeviceLostError, match="went away while it was open"):
            use(hand, view)
    # Told once, the end of the block has nothing to add.


def test_an_error_of_the_block_itself_is_not_hidden_by_the_boards(live: Live) -> None:
    with pytest.raises(ZeroDivisionError), live.hand:
        lose(live)
        _ = 1 // 0


@pytest.mark.parametrize("key", ["force_gain_z_nn", "FORCE_GAIN_Z_NN", 9999])
def test_settings_that_there_are_not_are_refused(key) -> None:
    counts, tare = np.full(19, 2000, np.uint16), np.full(19, 2100.0)
    for compute in (biotac.compute, lambda _, tare, settings: biotac.per_frame(tare, settings)):
        with pytest.raises(ValueError, match=rf"settings contain '?{key}'?, expected members of biotac.Setting"):
            compute(counts, tare, {key: 1})


def test_names_of_fingers_work_in_every_command(live: Live) -> None:
    hand, firmware = live.hand, live.firmware
    hand.tare("middle")
    hand.set_tare("ring", [2000.0] * 19)
    hand.board.clear_calibration("little")
    hand.board.clear_map("thumb")
    hand.tare(np.uint8(3))
    hand.hold("index", np.uint8(2))
    kinds = wire.TareNow, wire.TareSet, wire.ClearCalibration, wire.ClearMap
    assert [m.finger for m in firmware.received(kinds)] == [1, 2, 3, 4, 3]
    hand._reader.present = 0b1
    for refused in (hand.tare, hand.hold, hand.release, lambda name: hand.grasp("index", name).__enter__()):
        for name in ("pinky", "thumb"):
            with pytest.raises(KeyError, match=name):
                refused(name)
    assert len(firmware.received(wire.Hold)) == 1


def test_a_port_is_not_closed_in_the_middle_of_a_command(live: Live, monkeypatch) -> None:
    """Otherwise the serial port's own TypeErrors come up, of a file descriptor that is gone."""
    writes, closed, seen = threading.Event(), threading.Event(), []
    write, close = live.hand.link.write, live.hand.link.close

    def slow_write(data: bytes) -> None:
        writes.set()
        seen.append(closed.wait(0.3))
        write(data)

    monkeypatch.setattr(live.hand.link, "write", slow_write)
    monkeypatch.setattr(live.hand.link, "close", lambda: (closed.set(), close()))
    thread = threading.Thread(target=lambda: live.hand.board.send(wire.Ping(0)))
    thread.start()
    assert writes.wait(WAIT_S)
    live.hand.close()
    thread.join()
    assert seen == [False] and closed.is_set()
    with pytest.raises(biotac.DeviceLostError, match="was closed"):
        live.hand.board.send(wire.Ping(0))


def test_a_silent_reply_is_asked_for_again_and_then_an_error(live: Live, monkeypatch) -> None:
    live.firmware.mute = {wire.Ping}
    monkeypatch.setattr(board_module, "REPLY_TIMEOUT_S", 0.001)
    with pytest.raises(biotac.DeviceLostError, match="did not answer Ping"):
        live.hand.ping()
    assert len({m.req_id for m in live.firmware.received(wire.Ping)}) == 1
    assert len(live.firmware.received(wire.Ping)) == board_module.REPLY_TRIES


@pytest.mark.parametrize("pace", [0, 1])
def test_a_full_disk_is_told_and_neither_reading_nor_the_board_wait_for_it(tmp_path, monkeypatch, pace) -> None:
    def full(self: Writer) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("biotac.hand.record.LIMIT_BYTES", 1000)
    with biotac.open("sim:press.toml?seconds=1000", pace=pace) as hand:
        recorder = hand.record(tmp_path / "a.mcap")
        monkeypatch.setattr(Writer, "flush", full)
        with pytest.raises(OSError, match="No space left"):
            hand.read(900.0)
        assert len(hand.read(0.1)) == 10
        monkeypatch.undo()
        recorder.close()


def test_a_recording_is_whole_while_callbacks_hang(live: Live, tmp_path) -> None:
    resume = threading.Event()
    live.firmware.facts["fingers_present"] = live.hand._reader.hello.fingers_present
    with biotac.open("sim:press.toml?fingers=2&seconds=3", pace=1) as hand:
        hand.record(tmp_path / "a.mcap")
        hand.on_batch(lambda batch: resume.wait(WAIT_S))
        hand.stream()
        until(lambda: hand.ended)
        resume.set()
    recording = biotac.Recording(tmp_path / "a.mcap")
    assert (recording.problems, len(recording.frames)) == ([], 600)


def test_commands_of_many_threads_do_not_mix() -> None:
    with biotac.open("sim:drift.toml?seconds=60", pace=1) as hand:
        hand.stream()
        asked = list(wire.Setting)
        alone = {s: hand.board.setting(s) for s in asked}
        answers: list[tuple[wire.Setting, int]] = []
        threads = [
            threading.Thread(target=lambda: answers.extend((s, hand.board.setting(s)) for s in asked)) for _ in range(4)
        ]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
    assert len(answers) == 4 * len(asked) and all(alone[setting] == value for setting, value in answers)
