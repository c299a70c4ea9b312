"""Troubles that a hand must not keep quiet about: a lost board, a full disk, names that do not exist."""

import threading

import numpy as np
import pytest
from live_board import WAIT_S, Firmware, Live, frame, until

import biotac
from biotac.board.board import REPLY_TRIES
from biotac.link.serial_port import SerialLink
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


def test_names_of_fingers_work_in_every_command(live: Live, scripted_board, hello) -> None:
    hand, firmware = live.hand, live.firmware
    hand.tare("middle")
    hand.set_tare("ring", [2000.0] * 19)
    hand.board.clear_calibration("little")
    hand.board.clear_map("thumb")
    hand.tare(np.uint8(3))
    hand.hold("index", np.uint8(2))
    kinds = wire.TareNow, wire.TareSet, wire.ClearCalibration, wire.ClearMap
    assert [m.finger for m in firmware.received(kinds)] == [1, 2, 3, 4, 3]
    hand = Live(scripted_board(firmware := Firmware(hello, fingers_present=0b1)), firmware).hand
    for refused in (hand.tare, hand.hold, hand.release, lambda name: hand.grasp("index", name).__enter__()):
        for name in ("pinky", "thumb"):
            with pytest.raises(KeyError, match=name):
                refused(name)
    hand.close()
    assert firmware.received(wire.Hold) == []


def test_a_port_is_not_closed_in_the_middle_of_a_command(scripted_board, hello) -> None:
    """Otherwise the serial port's own TypeErrors come up, of a file descriptor that is gone."""
    slow, writes, closed, seen = threading.Event(), threading.Event(), threading.Event(), []

    class Slow(SerialLink):
        def write(self, data: bytes) -> None:
            if slow.is_set():
                writes.set()
                seen.append(closed.wait(0.3))
            super().write(data)

        def close(self) -> None:
            closed.set()
            super().close()

    board = scripted_board(firmware := Firmware(hello))
    hand = Live(board, firmware, Slow(board.path)).hand
    slow.set()
    thread = threading.Thread(target=lambda: hand.board.send(wire.Ping(0)))
    thread.start()
    assert writes.wait(WAIT_S)
    hand.close()
    thread.join()
    assert set(seen) == {False} and closed.is_set() and "closed" in repr(hand)
    with pytest.raises(biotac.DeviceLostError, match="was closed"):
        hand.board.send(wire.Ping(0))


def test_a_silent_reply_is_asked_for_again_and_then_an_error(live: Live) -> None:
    live.firmware.mute = {wire.Ping}
    live.hand.link.patience = 0.001
    with pytest.raises(biotac.DeviceLostError, match="did not answer Ping"):
        live.hand.ping()
    live.firmware.wait_for(wire.Ping, REPLY_TRIES)  # the last may still be on its way
    assert len(pings := live.firmware.received(wire.Ping)) == REPLY_TRIES and len({m.req_id for m in pings}) == 1


def test_a_recording_is_whole_while_callbacks_hang(tmp_path) -> None:
    resume = threading.Event()
    with biotac.open("sim:press.toml?fingers=2&seconds=3", pace=1) as hand:
        hand.record(tmp_path / "a.mcap")
        hand.on_batch(lambda batch: resume.wait(WAIT_S))
        hand.stream()
        until(lambda: hand.ended)
        resume.set()
    recording = biotac.Recording(tmp_path / "a.mcap")
    # All that came: on a busy computer the board itself has no room for some.
    assert (len(recording.frames), recording.frames_lost) == (hand.stats.frames, hand.stats.frames_lost)
    assert len(recording.frames) + recording.frames_lost == 600


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
