"""What a Hand is composed of, each part without a Hand; and what a user sees of it by tab completion."""

from __future__ import annotations

import os
import threading
import time

import numpy as np
import pytest
from live_board import Clock, Firmware, frame, point

import biotac
from biotac.hand.board import Board
from biotac.hand.callbacks import Callbacks
from biotac.hand.commands import Commands
from biotac.hand.handshake import handshake
from biotac.hand.pull import take
from biotac.hand.reader import Reader
from biotac.hand.reconnect import Reconnection
from biotac.hand.streams import Streams
from biotac.hand.views import Latest
from biotac.link.serial_port import SerialLink
from biotac.wire import messages_gen as wire
from biotac.wire.batches import Batch, StreamDecoder
from biotac.wire.framing import encode

HAND = """
batches calibration calibration_state calibrations check clear_calibration clear_faults clear_map clock close
connected ended faults finger_settings fingers frames get_map grasp hold info link map_state maps on_bands on_batch
on_event on_gap on_slip on_status on_tare on_touch ping point port read read_batch reboot_bootloader record release run
save_settings sensor_info sensor_status set_calibration set_map set_setting set_tare setting settings start stats
status stop streaming subscribe sync tare want warnings
"""
FINGER = """
age_s counts finger flags force_n force_sigma_n frame name pdc poc_mm poc_sigma_mm pressure_force_n t_us tac tdc
torque_nmm torsion_nmm touched
"""
BATCH = "arrived_s fingers first_t_us frames idle last_t_us messages pac seq t_us wire"
WAIT_S = 20.0  # only a failing test waits so long


def names(thing: object) -> list[str]:
    return [name for name in dir(thing) if not name.startswith("_")]


def batch_of(*frames: bytes) -> Batch:
    return StreamDecoder().feed(b"".join(frames))


def test_tab_completion_shows_what_a_user_may_use_and_no_plumbing() -> None:
    with biotac.open("sim:press.toml?seconds=0.2") as hand:
        batch = hand.read_batch(0.1)
        assert names(hand) == HAND.split()
        assert names(hand["index"]) == FINGER.split()
        assert names(batch) == BATCH.split()


def test_everything_of_a_hand_says_what_it_does() -> None:
    silent = [name for name in names(biotac.Hand) if not (getattr(biotac.Hand, name).__doc__ or "").strip()]
    silent += [name for name in names(biotac.FingerView) if not (getattr(biotac.FingerView, name).__doc__ or "")]
    assert silent == []


def test_a_board_alone_is_asked_and_answers(scripted_board, hello) -> None:
    firmware = Firmware(hello, boot_id=7)
    board = Board(SerialLink(scripted_board(firmware).path))
    came: list[Batch] = []
    board.deliver = came.append
    assert board.info.boot_id == 7
    assert board.ask(wire.SetSetting(0, 3, 4), wire.SettingValue).value == 4
    assert [type(m) for b in came for m in b.messages][-1] is wire.SettingValue
    req_ids = [m.req_id for m in firmware.told]
    assert len(set(req_ids)) == len(req_ids) and 0 not in req_ids
    board.close()
    with pytest.raises(biotac.DeviceLostError, match="was closed"):
        board.send(wire.Ping(0))


class WatchedLink(SerialLink):
    """Counts reads by another thread than the one that wrote last."""

    def __init__(self, path: str) -> None:
        super().__init__(path)
        self.fd = None  # so that ``read`` is called
        self.strangers = 0
        self._writer = 0

    def write(self, data: bytes) -> None:
        self._writer = threading.get_ident()
        time.sleep(0.02)  # whoever does not write gets to read first
        super().write(data)

    def read(self, timeout_s: float) -> bytes:
        self.strangers += threading.get_ident() != self._writer
        return super().read(timeout_s)


def test_a_board_alone_is_read_by_the_thread_that_asks(scripted_board, hello) -> None:
    """Another that waits for its turn took the answer, and read on: every command took as long as a read may."""
    board = Board(link := WatchedLink(scripted_board(Firmware(hello)).path))
    told: dict[int, list[int]] = {3: [], 4: []}

    def ask(setting: int) -> None:
        for value in range(20):
            told[setting].append(board.ask(wire.SetSetting(0, setting, value), wire.SettingValue).value)

    threads = [threading.Thread(target=ask, args=(setting,), daemon=True) for setting in told]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(WAIT_S)
    assert told == {3: [*range(20)], 4: [*range(20)]}
    assert link.strangers == 0
    board.close()


def test_an_answer_that_another_thread_reads_is_the_askers(scripted_board, hello) -> None:
    """One who never lets the link go: in ``batches``, while somebody else commands."""
    board = Board(SerialLink(scripted_board(Firmware(hello)).path))
    told: list[int] = []
    asker = threading.Thread(target=lambda: told.append(board.ask(wire.SetSetting(0, 3, 4), wire.SettingValue).value))
    end_s = time.monotonic() + WAIT_S
    with board._reading:
        asker.start()
        while asker.is_alive() and time.monotonic() < end_s:
            board.read(0.01)
        assert told == [4]
    board.close()


def test_what_a_board_is_to_be_told_again_comes_in_the_order_it_was_told_last(scripted_board, hello) -> None:
    firmware = Firmware(hello)
    board = Board(SerialLink(scripted_board(firmware).path))
    for setting, value in ((1, 10), (2, 20), (1, 11)):
        board.tell(wire.SetSetting(0, setting, value), lasting=("setting", setting))
    board.tell(wire.Ping(0))
    firmware.told.clear()
    board.tell_again()
    assert [(m.setting, m.value) for m in firmware.told] == [(2, 20), (1, 11)]
    board.close()


def test_a_handshake_alone_finds_the_hello_of_its_own_question(scripted_board, hello) -> None:
    link = SerialLink(scripted_board(Firmware(hello, boot_id=9)).path)
    told = handshake(link, lambda request: link.write(encode(request.ID, request.pack())), timeout_s=WAIT_S)
    assert told.boot_id == 9
    link.close()


def test_commands_need_a_board_and_no_more(scripted_board, hello) -> None:
    firmware = Firmware(hello)
    board = Board(SerialLink(scripted_board(firmware).path))
    Commands(board).set_tare(2, np.full(19, 100.0), pdc_counts=2.5)
    (told,) = firmware.of(wire.TareSet)
    assert (told.finger, told.tare_q4, told.pdc_tare_q4) == (2, (1600,) * 19, 40)
    board.close()


def test_streams_are_pulled_from_a_board_without_a_hand(scripted_board, hello) -> None:
    scripted = scripted_board(Firmware(hello))
    clock = Clock()
    board, latest = Board(SerialLink(scripted.path), host_clock=clock), Latest(clock, {"palm": 1})
    streams = Streams(board, latest)
    batches = streams.batches()
    threading.Timer(0, lambda: os.write(scripted._master, frame(4, finger=1))).start()
    batch = next(b for b in batches if len(b.wire))
    assert batch.seq.tolist() == [4] and latest["palm"].t_us == 40_000
    assert streams.streaming and streams.stats.frames == 1
    streams.close()
    board.close()


def test_a_lost_board_without_reconnection_is_an_error_and_with_it_is_found(scripted_board, hello, tmp_path) -> None:
    path, clock = tmp_path / "ttyBOARD", Clock()
    firmwares: list[Firmware] = []

    def plug(boot_id: int) -> object:
        firmwares.append(Firmware(hello, boot_id=boot_id))
        scripted = scripted_board(firmwares[-1])
        point(path, scripted.path)
        return scripted

    def unplug(scripted) -> None:
        point(path, "")
        scripted.hang_up()

    scripted = plug(1)
    board = Board(SerialLink(str(path)), host_clock=clock)
    unplug(scripted)
    with pytest.raises(biotac.DeviceLostError):
        board.read(WAIT_S)
    board.close()

    scripted = plug(1)
    board = Board(SerialLink(str(path)), host_clock=clock)
    resumed: list[bool] = []
    Reconnection(board, last_t_us=lambda: 70_000, resume=resumed.append)
    board.tell(wire.SetSetting(0, 5, 6), lasting=("setting", 5))
    clock.while_away = lambda pauses: plug(2) and None
    unplug(scripted)
    assert board.read(WAIT_S)
    assert (resumed, board.connected, board.info.boot_id) == ([True], True, 2)
    assert [(m.setting, m.value) for m in firmwares[-1].of(wire.SetSetting)] == [(5, 6)]
    gap = board.incoming.gap
    assert gap is not None and (gap.reason, gap.last_t_us) == ("rebooted", 70_000)
    board.close()


def test_the_latest_of_a_finger_needs_no_board() -> None:
    clock = Clock()
    latest = Latest(clock)
    latest.update(batch_of(frame(3, finger=4, force_z_n=1.5)), clock.now_s)
    clock.now_s += 2.0
    assert (latest["thumb"].force_n[2], latest[4].age_s, latest["index"].t_us) == (1.5, 2.0, -1)


def test_callbacks_alone_get_batches_and_messages_in_their_order() -> None:
    callbacks, seen = Callbacks(), []
    touch = wire.Touch(3, 30_000, 2, 1, 500)
    callbacks.put(batch_of(frame(0)))  # nobody wants it
    end = callbacks.add(Batch, lambda batch: seen.append(len(batch.wire)))
    callbacks.add(wire.Touch, lambda message: seen.append(message.finger))
    callbacks.put(batch_of(frame(1), frame(2), encode(touch.ID, touch.pack())))
    assert callbacks.dispatch() and not callbacks.dispatch()
    end()
    callbacks.put(batch_of(frame(3)))
    assert callbacks.dispatch()
    assert seen == [2, 2]


def test_a_reader_alone_reads_until_it_is_closed_and_tells_why_it_died() -> None:
    class Source:
        def __init__(self, dies: bool) -> None:
            self.dies, self.reads, self.error = dies, threading.Event(), None

        def read(self, at_most_s: float) -> None:
            if self.dies:
                raise ValueError("not my day")
            self.reads.set()

        def may_relieve(self) -> bool:
            return False

        def fail(self, error: BaseException) -> None:
            self.error = error

    closing, source = threading.Event(), Source(dies=False)
    reader = Reader(source, Callbacks(), closing, "test")
    reader.start()
    assert source.reads.wait(WAIT_S) and not reader.is_here()
    closing.set()
    reader.join()
    assert source.error is None
    closing, source = threading.Event(), Source(dies=True)
    reader = Reader(source, Callbacks(), closing, "test")
    reader.start()
    reader._threads[0].join()
    closing.set()
    reader.join()
    assert str(source.error) == "not my day"


def test_a_time_of_the_boards_clock_is_cut_out_of_any_batches() -> None:
    come = iter([batch_of(frame(5), frame(6)), batch_of(frame(7), frame(8), frame(9)), batch_of(frame(10))])
    batch, later = take(come, 0.03, silence_s=3.0)
    assert (batch.seq.tolist(), later.seq.tolist()) == ([5, 6, 7], [8, 9])
    assert take(come, 1.0, silence_s=3.0)[0].seq.tolist() == [10]
