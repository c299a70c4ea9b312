"""A board that goes away and comes back: found again, told what it was told, its absence marked. No time passes."""

from __future__ import annotations

import os
from collections.abc import Iterator
from types import SimpleNamespace

import pytest
from live_board import Clock, Firmware, frame, point

import biotac
import biotac.recording
from biotac.hand.hand import Hand
from biotac.link.serial_port import SerialLink
from biotac.recording.facts import Facts
from biotac.wire import messages_gen as wire

WAIT_S = 600.0
OURS, OTHER = (7,) * 12, (8,) * 12


@pytest.fixture
def world(scripted_board, hello, tmp_path) -> Iterator[SimpleNamespace]:
    """A port that is a symbolic link, boards that can be behind it, and a hand that was opened on it."""
    world = SimpleNamespace(path=tmp_path / "ttyBOARD", clock=Clock(), hand=None)

    def plug(**facts: object) -> SimpleNamespace:
        firmware = Firmware(hello, **({"board_serial": OURS} | facts))
        board = scripted_board(firmware)
        point(world.path, board.path)
        return SimpleNamespace(board=board, firmware=firmware)

    def unplug(there: SimpleNamespace) -> None:
        point(world.path, "")
        # As the kernel does: whoever reads the port gets an error from now on.
        there.board.hang_up()

    def opened(reconnect: bool = True) -> Hand:
        world.hand = Hand(SerialLink(str(world.path)), reconnect=reconnect, host_clock=world.clock)
        return world.hand

    world.plug, world.unplug, world.opened = plug, unplug, opened
    yield world
    if world.hand is not None:
        world.hand.close()


def send(there: SimpleNamespace, *frames: bytes) -> None:
    os.write(there.board._master, b"".join(frames))


def until(hand: Hand, so) -> None:
    assert hand._board.wait_for(so, WAIT_S)


def test_without_reconnect_a_pulled_cable_is_an_error(world) -> None:
    there = world.plug()
    hand = world.opened(reconnect=False)
    hand.run(queue=True)
    world.unplug(there)
    with pytest.raises(biotac.DeviceLostError, match="went away while it was open"):
        for _ in hand.batches():
            pass


@pytest.mark.parametrize("threads", [True, False])
@pytest.mark.parametrize(("boot_id", "reason"), [(1, "unplugged"), (2, "rebooted")])
def test_a_board_that_comes_back_is_told_all_again_and_the_gap_is_marked(world, threads, boot_id, reason) -> None:
    there = world.plug(boot_id=1)
    hand = world.opened()
    hand.set_setting(wire.Setting.POC_WEIGHTS, 2)
    hand.set_setting(wire.Setting.IDLE_PERIOD_MS, 50)
    hand.set_setting(wire.Setting.POC_WEIGHTS, 0)
    hand.want("force", "pac", rest=False)
    if threads:
        hand.run(queue=True)
    else:
        hand.start()
    send(there, frame(10), frame(11))
    batches = hand.batches()
    assert next(b for b in batches if len(b.wire)).seq[-1] >= 10
    back = []

    def return_at_third(pauses: int) -> None:
        if pauses == 3:
            back.append(world.plug(boot_id=boot_id))
            # What the board sends once it is told to stream.
            firmware = back[0].firmware
            answer = firmware.__class__.__call__

            def and_stream(message_id: int, payload: bytes) -> bytes:
                more = frame(50) if message_id == wire.Start.ID else b""
                return answer(firmware, message_id, payload) + more

            back[0].board._answer = and_stream

    world.clock.while_away = return_at_third
    send(there, b"\x01half a fra")
    world.unplug(there)
    gap = next(m for b in batches for m in b.messages if isinstance(m, biotac.Gap))
    told = back[0].firmware
    assert (gap.reason, gap.last_t_us, gap.next_t_us, gap.boot_id) == (reason, 110_000, 500_000, boot_id)
    assert gap.back_at_ns - gap.lost_at_ns == 3 * 250_000_000
    assert world.clock.pauses == 3
    settings = [(m.setting, m.value) for m in told.of(wire.SetSetting)]
    assert settings == [(wire.Setting.IDLE_PERIOD_MS, 50), (wire.Setting.POC_WEIGHTS, 0)]
    assert [m.quantities for m in told.of(wire.Subscribe)] == [wire.QuantityFlags.FORCE]
    assert [(m.streams, m.keepalive_ms) for m in told.of(wire.Start)] == [(0b111, 1000 if threads else 0)]
    assert hand.stats.gaps == 1
    assert hand.connected
    assert hand[0].t_us == 500_000


def test_a_stranger_on_the_same_port_is_left_alone(world) -> None:
    there = world.plug(boot_id=1)
    hand = world.opened()
    hand.run(queue=True)
    strangers = []

    def others(pauses: int) -> None:
        if pauses == 1:
            strangers.append(world.plug(board_serial=OTHER))
        if pauses == 3:
            world.plug(boot_id=1).firmware  # noqa: B018

    world.clock.while_away = others
    world.unplug(there)
    until(hand, lambda: hand.connected and world.clock.pauses == 3)
    assert {type(m) for m in strangers[0].firmware.told} == {wire.Stop, wire.HelloRequest}


def test_a_silent_board_that_answers_again_streams_again(world) -> None:
    there = world.plug(boot_id=1)
    hand = world.opened()
    hand.run(queue=True)
    send(there, frame(5))
    until(hand, lambda: hand[0].t_us == 50_000)
    hand.ping()  # all that it was asked is answered: no late answer breaks the silence
    world.clock.now_s += hand._streams._keepalive.silence_s() + 0.5
    there.firmware.wait_for(wire.Start, 2)
    send(there, frame(300))
    until(hand, lambda: hand[0].t_us == 3_000_000)
    gaps = [m for b in iter(hand._streams._pulled.take, None) for m in b.messages if isinstance(m, biotac.Gap)]
    assert [(g.reason, g.last_t_us, g.next_t_us) for g in gaps] == [("silence", 50_000, 3_000_000)]


def test_while_it_is_away_commands_say_so(world) -> None:
    there = world.plug(boot_id=1)
    hand = world.opened()
    hand.run()
    refusals = []

    def ask(pauses: int) -> None:
        if pauses == 1:
            import threading

            def command() -> None:
                with pytest.raises(biotac.DeviceLostError, match="is away and being looked for"):
                    hand.ping()
                refusals.append(True)

            thread = threading.Thread(target=command)
            thread.start()
            thread.join()
            world.plug(boot_id=1)

    world.clock.while_away = ask
    world.unplug(there)
    until(hand, lambda: hand.connected and world.clock.pauses > 0)
    assert refusals == [True]
    hand.ping()


def test_a_recording_goes_on_and_holds_the_gap(world, tmp_path) -> None:
    there = world.plug(boot_id=1)
    hand = world.opened()
    recorder = biotac.recording.Recorder(tmp_path / "a.mcap", Facts(hand.info, [], {}), hand.port)
    hand._recorded.to(recorder)
    hand.run()
    send(there, frame(10), frame(11), b"\x05half")
    until(hand, lambda: hand[0].t_us == 110_000)
    back = []
    world.clock.while_away = lambda pauses: back.append(world.plug(boot_id=1))
    world.unplug(there)
    until(hand, lambda: bool(back) and hand.connected)
    send(back[0], frame(40), frame(41))
    until(hand, lambda: hand[0].t_us == 410_000)
    hand.close()
    recording = biotac.recording.Recording(tmp_path / "a.mcap")
    (gap,) = recording.gaps
    assert gap == biotac.Gap("unplugged", 110_000, 400_000, gap.lost_at_ns, gap.back_at_ns, 1)
    assert gap.words() in recording.problems
    with pytest.warns(biotac.RecordingWarning, match=r"has 1 gap\(s\)"):
        assert biotac.load(tmp_path / "a.mcap")["seq"].tolist() == [10, 11, 40, 41]


def test_close_ends_the_search(world) -> None:
    there = world.plug()
    hand = world.opened()
    hand.run()
    world.clock.while_away = lambda pauses: hand._board.closing.set()
    world.unplug(there)
    hand._streams._reader.join()
    hand.close()


def test_the_simulated_board_reboots_and_is_found_again(tmp_path) -> None:
    """The real firmware: a process that dies, and another one of the same serial number behind the same name."""
    from biotac.sim.loading import load_source
    from biotac.sim.ports import start_board

    path = tmp_path / "ttyBOARD"
    boards = []

    def boot(pauses: int) -> None:
        if not boards or pauses == 2:
            # At the pace of life: unpaced, its tape could be over before it is to stream.
            boards.append(start_board("posix", load_source("press.toml", seconds=600), pace=1.0))
            boards[-1].release()
            point(path, boards[-1].path)

    clock = Clock()
    clock.while_away = boot
    boot(0)
    with Hand(SerialLink(str(path)), reconnect=True, host_clock=clock) as hand:
        hand.set_setting(wire.Setting.IDLE_PERIOD_MS, 70)
        hand.subscribe(wire.QuantityFlags.FORCE | wire.QuantityFlags.REST_FRAMES)
        batches = hand.batches()
        recorder = hand.record(tmp_path / "press.mcap")
        assert len(next(batch.wire for batch in batches if len(batch.wire)))
        boards[0].close()
        point(path, "")
        for batch in batches:
            gaps = [m for m in batch.messages if isinstance(m, biotac.Gap)]
            if gaps:
                break
        assert gaps[0].reason == "rebooted"
        assert batch.t_us[0] == gaps[0].next_t_us
        assert hand.stats.disordered == 0  # numbers that begin anew are no step back
        assert hand.setting(wire.Setting.IDLE_PERIOD_MS) == 70
        assert (batch.frames["flags"] & biotac.FrameFlags.NOT_ASKED != 0).all()
    boards[1].close()
    before, after = (biotac.recording.Recording(path) for path in recorder.paths)
    assert [path.name for path in recorder.paths] == ["press.mcap", "press.2.mcap"]
    assert before.info.boot_id != after.info.boot_id == gaps[0].boot_id
    assert before.disordered == after.disordered == before.frames_lost == after.frames_lost == 0
    assert after.metadata["continues"] == "press.mcap"
    assert after.gaps == gaps and not before.gaps
    assert after.settings[wire.Setting.IDLE_PERIOD_MS] == 70
    assert after.begin_us == gaps[0].next_t_us
