"""Every command on every rig: the reply, the refusals, and the effect on the stream."""

import time
from typing import Any

import numpy as np
import pytest
from capture import Capture

import biotac
from biotac import FaultFlags, FrameFlags, Setting, TareReason, TareState
from biotac.wire import map_gen as _map
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode

TARE_Q4 = (3000 * 16,) * 19
NO_FINGER = 5
ANY_SENSOR = (0,) * 16
COMMANDS = {
    wire.HelloRequest: ((0x600D,), wire.Hello),
    wire.Start: ((int(wire.StreamFlags.FRAMES), 1, 0), wire.Reply),
    wire.Stop: ((), wire.Reply),
    wire.Ping: ((), wire.Reply),
    wire.TakeLink: ((1000,), wire.Reply),
    wire.Subscribe: ((1, int(wire.QuantityFlags.POC)), wire.Reply),
    wire.GetPoint: ((0,), wire.Point),
    wire.TareNow: ((0,), wire.Reply),
    wire.Hold: ((1,), wire.Reply),
    wire.Release: ((1,), wire.Reply),
    wire.TareSet: ((0, TARE_Q4, wire.INVALID_COUNT, 0), wire.Reply),
    wire.GetStatus: ((), wire.Status),
    wire.GetSensorStatus: ((0,), wire.SensorStatus),
    wire.GetSensorInfo: ((0,), wire.SensorInfo),
    wire.GetSetting: ((int(Setting.IDLE_PERIOD_MS),), wire.SettingValue),
    wire.SetSetting: ((int(Setting.IDLE_PERIOD_MS), 100), wire.SettingValue),
    wire.GetCalibration: ((0,), wire.CalibrationMessage),
    wire.SetCalibration: ((0, ANY_SENSOR, 0, tuple(biotac.Calibration().settings().values())), wire.CalibrationMessage),
    wire.ClearCalibration: ((0,), wire.Reply),
    wire.GetMap: ((0,), wire.MapInfo),
    wire.ReadMap: ((0, 0), wire.Reply),  # refused: there is none
    wire.BeginMap: ((0, 24, 0), wire.Reply),
    wire.WriteMap: ((0, 0, (0,) * 128), wire.Reply),
    wire.EndMap: ((0, 1), wire.Reply),  # refused: another upload was begun
    wire.ClearMap: ((0,), wire.Reply),
    wire.SaveSettings: ((), wire.Reply),
    wire.ClearFaults: ((0, (0,) * 5), wire.Reply),
    wire.GetBoardFacts: ((), wire.BoardFacts),
    wire.SetBusRate: ((0,), wire.BoardFacts),
    wire.RebootBootloader: ((1,), wire.Reply),  # not the magic number: refused, and it stays
}
REFUSED = [
    (wire.GetPoint, (NO_FINGER,), wire.Error.NO_SUCH_FINGER),
    (wire.GetSensorInfo, (NO_FINGER,), wire.Error.NO_SUCH_FINGER),
    (wire.GetSensorStatus, (NO_FINGER,), wire.Error.NO_SUCH_FINGER),
    (wire.GetCalibration, (NO_FINGER,), wire.Error.NO_SUCH_FINGER),
    (wire.TareNow, (NO_FINGER,), wire.Error.NO_SUCH_FINGER),
    (wire.TareSet, (0, (0xFFF1,) * 19, 0, 0), wire.Error.OUT_OF_RANGE),
    (wire.GetSetting, (0,), wire.Error.UNKNOWN_SETTING),
    (wire.SetSetting, (int(Setting.IDLE_PERIOD_MS), 1), wire.Error.OUT_OF_RANGE),
    (wire.SetCalibration, (0, ANY_SENSOR, 0, (0,) * 7 + (-1,)), wire.Error.OUT_OF_RANGE),
    (wire.Start, (0x80, 1, 0), wire.Error.OUT_OF_RANGE),
    (wire.RebootBootloader, (1,), wire.Error.OUT_OF_RANGE),
    (wire.GetMap, (NO_FINGER,), wire.Error.NO_SUCH_FINGER),
    (wire.ReadMap, (NO_FINGER, 0), wire.Error.NO_SUCH_FINGER),
    (wire.ReadMap, (0, 0), wire.Error.OUT_OF_RANGE),
    (wire.BeginMap, (NO_FINGER, 24, 0), wire.Error.NO_SUCH_FINGER),
    (wire.BeginMap, (0, 0, 0), wire.Error.OUT_OF_RANGE),
    (wire.BeginMap, (0, _map.MAX_BYTES + 1, 0), wire.Error.OUT_OF_RANGE),
    (wire.WriteMap, (0, 0, (0,) * 128), wire.Error.NOT_BEGUN),
    (wire.EndMap, (0, 0), wire.Error.NOT_BEGUN),
    (wire.ClearMap, (NO_FINGER,), wire.Error.NO_SUCH_FINGER),
]
FOR_MAPS = (wire.BeginMap, wire.WriteMap, wire.EndMap, wire.ClearMap)


REQ_ID = 249  # the hand numbers commands from 1, and does not come so far


def replies_to(hand: biotac.Hand, message_id: int, payload: bytes, *, times: int = 1) -> list[Any]:
    """All messages in answer to one, sent so many times, and to the PING behind it, except the PING's reply."""
    capture = Capture()
    hand.add(capture)
    hand.link.write(times * encode(message_id, payload))
    hand.ping()
    hand.remove(capture)
    seen = [m for m in capture.messages if isinstance(m, wire.Reply) or getattr(m, "req_id", 0) == REQ_ID]
    assert seen.pop().command == wire.Ping.ID
    return seen


@pytest.mark.daily
def test_every_command_has_one_reply_of_its_own_kind(board) -> None:
    hand = board("press.toml")
    hand.read(0.5)  # tared, so that TARE_NOW may be obeyed
    hand.stop()
    of_a_gateway = range(0x80, 0xC0)  # from there on they are the sensor board's
    assert {m.ID for m in COMMANDS} == {m for m in wire.MESSAGES if m in of_a_gateway}
    for kind, (values, reply) in COMMANDS.items():
        answers = replies_to(hand, kind.ID, kind(REQ_ID, *values).pack())
        assert [type(a) for a in answers] == [reply], kind
        if kind is wire.Start:
            hand.stop()


def test_what_cannot_be_done_is_refused_with_its_reason(board) -> None:
    hand = board("press.toml")
    for kind, values, error in REFUSED:
        if hand.info.map_bytes == 0 and kind in FOR_MAPS and error != wire.Error.NO_SUCH_FINGER:
            error = wire.Error.NOT_HERE
        (answer,) = replies_to(hand, kind.ID, kind(REQ_ID, *values).pack())
        assert (type(answer), answer.command, answer.error) == (wire.Reply, kind.ID, error), (kind, values)


def test_a_command_from_the_future_and_one_of_wrong_length_are_answered_in_words(board) -> None:
    hand = board("press.toml")
    (unknown,) = replies_to(hand, 0xEE, bytes([REQ_ID, 1, 2]))
    assert (unknown.command, unknown.error) == (0xEE, wire.Error.UNKNOWN_COMMAND)
    (short,) = replies_to(hand, wire.GetSetting.ID, bytes([REQ_ID]))
    assert (short.command, short.error) == (wire.GetSetting.ID, wire.Error.BAD_LENGTH)
    assert short.req_id == 0  # its place in a message of another length is anybody's guess


def hurt(message: Any) -> list[bytes]:
    """Damage that a message may take on the way, one a piece; the last is half a message, without an end."""
    whole = encode(message.ID, message.pack())
    flipped = [whole[:at] + bytes([whole[at] ^ 1 << at % 8]) + whole[at + 1 :] for at in range(1, len(whole) - 1)]
    short, doubled = whole[:2] + whole[3:], whole[:3] + whole[2:]
    return [*flipped, short, doubled, b"\x01" * 2000 + b"\0", bytes(range(255, -1, -1)), whole[: len(whole) // 2]]


def test_what_is_damaged_on_its_way_is_counted_and_never_obeyed(board) -> None:
    hand = board("press.toml")
    before = hand.status()
    pieces = hurt(wire.SetSetting(REQ_ID, int(Setting.IDLE_PERIOD_MS), 250))
    for piece in pieces:
        hand.link.write(piece)
    hand.link.write(b"\0")  # as every program begins
    hand.ping()
    after = hand.status()
    assert after.rx_errors - before.rx_errors >= len(pieces)
    assert after.rx_frames - before.rx_frames == 2  # PING and GET_STATUS
    assert after.faults & FaultFlags.LINK_DAMAGED
    assert hand.board.setting(Setting.IDLE_PERIOD_MS) == 100


def test_a_command_that_comes_twice_is_answered_twice_and_done_once(rig, board) -> None:
    hand = board("press.toml")
    start = wire.Start(REQ_ID, int(wire.StreamFlags.FRAMES), 1, 0)
    set_it = wire.SetSetting(REQ_ID, int(Setting.IDLE_PERIOD_MS), 250)
    for message in (
        set_it,
        wire.Hold(REQ_ID, 1),
        wire.Release(REQ_ID, 1),
        wire.ClearFaults(REQ_ID, 0, (0,) * 5),
        start,
        wire.Stop(REQ_ID),
    ):
        first, again = replies_to(hand, message.ID, message.pack(), times=2)
        assert first == again and getattr(first, "error", wire.Error.OK) == wire.Error.OK
    assert (hand.board.setting(Setting.IDLE_PERIOD_MS), hand.status().streams) == (250, 0)
    hand.stream("force", "poc", "torque", "pressure")
    hand.link.write(2 * encode(start.ID, start.pack()))
    frames = hand.read(0.3)
    assert len(np.unique(frames["seq"])) == len(frames)
    assert len(frames) == 30 or (rig.facts.get("jitter") and len(frames) == 31)
    assert (hand.stats.disordered, hand.stats.frames_lost) == (0, 0)


def test_a_stream_whose_host_says_nothing_any_more_stops(board) -> None:
    hand = board("press.toml?seconds=3")
    frames, silent_s = 0, 0.0

    def count(batch: biotac.Batch) -> None:
        nonlocal frames, silent_s
        frames, silent_s = frames + len(batch.wire), 0.0

    hand.on_batch(count)
    hand.board.command(wire.Start(9, int(wire.StreamFlags.FRAMES), 1, 200))
    hand.link.release()
    while silent_s < hand.link.patience and not hand.link.ended:  # an emulator is slow to begin
        time.sleep(0.01)
        silent_s += 0.01
    assert hand.status().streams == 0  # the reply comes after every frame
    hand.close()
    assert 18 <= frames <= 22  # 200 ms of 10 ms rounds, and those under way


def test_a_press_brings_its_tare_and_contact_events(board) -> None:
    batch = board("press.toml?fingers=2").read_batch(20)
    assert {m.finger for m in batch.messages if isinstance(m, wire.SensorStatus)} == {0, 1}  # with each STATUS
    for finger in range(2):
        frames = batch.frames[batch.frames["finger"] == finger]
        tares = [m for m in batch.messages if isinstance(m, wire.Tare) and m.finger == finger]
        assert tares[0].reason == TareReason.START and tares[0].tare_state == TareState.REST
        first = frames[frames["seq"] == tares[0].seq]
        assert len(first) == 1 and first["flags"][0] & FrameFlags.TARE_CHANGED
        touched = (frames["flags"] & FrameFlags.CONTACT) != 0
        assert np.count_nonzero(np.diff(touched.astype(int)) == 1) == np.count_nonzero(
            np.diff(touched.astype(int)) == -1
        )
        assert touched.any() and not touched[frames["seq"] < first["seq"][0]].any()
