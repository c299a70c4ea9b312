"""Sources in trouble: missing messages, wrong clocks, two senders, other rates; all is counted and reported."""

import json
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import websocket
from robot_messages import ALL, HAND, START_NS, Robot
from rosbags.rosbag1 import Writer

import biotac
from biotac.errors import InputError, PortError
from biotac.extras.rounds.foxglove import Foxglove
from biotac.extras.rounds.message import Counts, Message
from biotac.extras.rounds.stamps import MessageStamps
from biotac.extras.rounds.words import RoundMaker
from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire
from biotac.wire import slots
from biotac.wire.batches import Batch

ROWS = load_source("press.toml", fingers=2, seconds=12.0).samples.astype(int)
NS = START_NS + 10_000_000 * np.arange(len(ROWS))
E = slots.ELECTRODE_SLOT


def played(port: str) -> tuple[Batch, list[str]]:
    with biotac.open(port) as hand:
        hand.stream("results", "events")
        return hand.read_batch(5000.0), list(hand.link.notes)


def edited(robot: Robot, edit: Callable[[int, Any], Any]) -> Robot:
    """``edit`` changes each message in place, given the message's number."""
    message, count = robot.message, iter(range(10**6))

    def make(*words: Any) -> Any:
        made = message(*words)
        edit(next(count), made)
        return made

    robot.message = make  # type: ignore[method-assign]
    return robot


@pytest.mark.parametrize("share", [pytest.param(0.05, marks=pytest.mark.nightly), 0.3])
@pytest.mark.parametrize("robot", [pytest.param(Robot(HAND), marks=pytest.mark.nightly), Robot(pac=True)])
def test_messages_that_never_came_change_no_sample_and_are_counted(tmp_path: Path, robot: Robot, share: float) -> None:
    kept = np.random.default_rng(0).random(len(ROWS)) >= share
    kept[:100] = kept[-1] = True
    batch, notes = played(robot.write(tmp_path / "a.bag", ROWS[kept, :1], stamps_ns=NS[kept]))
    np.testing.assert_array_equal(batch.pac["pac"], ROWS[kept][:, 0, slots.PAC_SLOT])
    first_s = (np.flatnonzero(~kept)[0] - 1) / 100
    assert notes == [f"{(~kept).sum()} messages were missing, the first after {first_s:.2f} s"]


@pytest.mark.parametrize(
    "at",
    [range(700, 1200, 50), *(pytest.param(at, marks=pytest.mark.nightly) for at in (range(500, 504), range(100, 109)))],
)
def test_a_few_damaged_words_condemn_no_finger(tmp_path: Path, at: range) -> None:
    rows = ROWS[:, :1].copy()
    rows[at, 0, E[3]] = 5000
    batch, notes = played(Robot(pac=True).write(tmp_path / "a.bag", rows))
    assert notes == [] and not (batch.frames["flags"] & wire.FrameFlags.SENSOR_FAULT).any()


def test_what_is_stuck_at_the_end_is_not_missing_at_the_begin(tmp_path: Path) -> None:
    rows = ROWS[:, :1].copy()
    rows[500:, 0, E[3]] = rows[:20, 0, E[3]] = 2222
    batch, _ = played(Robot(pac=True).write(tmp_path / "a.bag", rows))
    assert (batch.frames["counts"][:400, 3] != wire.INVALID_COUNT).all()


def test_two_senders_of_one_topic_are_refused(tmp_path: Path) -> None:
    robot = Robot(HAND)
    with Writer(tmp_path / "a.bag") as bag:
        both = [bag.add_connection("/t", HAND, typestore=robot.store, callerid=name) for name in "ab"]
        for k, ns in enumerate(NS[:100].tolist()):
            bag.write(both[k % 2], ns, robot.bytes_of(robot.message(ns, [ROWS[k, k % 2]])))
    with pytest.raises(InputError, match="two publishers take turns on /t"):
        biotac.open(f"bag:{tmp_path / 'a.bag'}")

    def swap(k: int, message: Any) -> None:
        message.bt_data[0].bt_serial = f"BT2P00000000000{k % 2}"

    with pytest.raises(PortError, match=r"finger 0 is BT2P00000000000. and BT2P00000000000. in turns"):
        biotac.open(edited(Robot(HAND), swap).write(tmp_path / "b.bag", ROWS[:100, :1]))


class Wire:
    """A bridge's socket, from which these advertisements come."""

    def __init__(self, *adverts: bytes) -> None:
        self.adverts = iter(adverts)
        self.send = self.settimeout = lambda given: None
        self.close = lambda: None

    def recv_data(self) -> tuple[int, bytes]:
        return websocket.ABNF.OPCODE_TEXT, next(self.adverts)


def advert(*topics: str) -> bytes:
    kind = {"encoding": "ros1", "schemaName": "sr_robot_msgs/BiotacAll", "schema": Robot().definition}
    channels = [{"id": k, "topic": topic, **kind} for k, topic in enumerate(topics)]
    return json.dumps({"op": "advertise", "channels": channels}).encode()


def test_two_hands_of_a_bridge_have_to_be_named(monkeypatch: pytest.MonkeyPatch) -> None:
    def said(topic: str, *adverts: bytes) -> list[object]:
        monkeypatch.setattr(websocket, "create_connection", lambda *where, **how: Wire(*adverts))
        return list(islice(Foxglove(f"foxglove://robot:1{topic}", "robot:1", topic), len(adverts)))

    with pytest.raises(PortError, match=r"it has /lh and /rh; name one: foxglove://robot:1/lh"):
        said("", advert("/rh", "/lh"))
    assert said("", advert("/rh"), advert("/lh")) == [None, "/lh came after /rh, and is not read"]
    assert said("/rh", advert("/rh", "/lh")) == [None]


@pytest.mark.parametrize("hz", [30, pytest.param(1000, marks=pytest.mark.nightly)])
def test_a_rate_that_changes_is_refused_with_its_time(tmp_path: Path, hz: int) -> None:
    ns = NS.copy()
    ns[600:] = ns[599] + (np.arange(1, 601) * 1e9 / hz).astype(int)
    with pytest.raises(InputError, match=rf"100 messages a second at first, {hz} from 6.0 s on"):
        biotac.open(Robot(HAND).write(tmp_path / "a.bag", ROWS[:, :1], stamps_ns=ns))


def test_fingers_are_in_order_of_positions(tmp_path: Path) -> None:
    def late(k: int, message: Any) -> None:
        message.bt_data[0].bt_position, message.bt_data[1].bt_position = 5, 2
        message.bt_data = message.bt_data[: 1 + (k >= 600)]

    batch, notes = played(edited(Robot(HAND), late).write(tmp_path / "a.bag", ROWS))
    assert notes == ["position 2 is index", "position 5 is middle"]
    for finger, column in ((0, ROWS[600:, 1]), (1, ROWS[:, 0])):
        own = batch.frames[batch.frames["finger"] == finger]
        np.testing.assert_array_equal(np.sort(own, order="seq")["counts"], column[:, E])


def test_a_wrong_finger_is_refused_alone_and_counted_before_the_first_round(tmp_path: Path) -> None:
    def cut(k: int, message: Any) -> None:
        if k >= 600:
            message.tactiles[0].electrodes = message.tactiles[0].electrodes[:18]

    port = edited(Robot(pac=True), cut).write(tmp_path / "a.bag", ROWS)
    why = "600 messages were refused in part, the first after 5.99 s: finger 0 has 18 electrodes, expected 19"
    with biotac.open(port) as hand:
        assert [why in note for note in hand.link.notes] == [True]
    batch, _ = played(port)
    assert np.bincount(batch.frames["finger"]).tolist() == [600, 1200]


@pytest.mark.parametrize(
    ("stamps", "rows", "lost"),
    [
        pytest.param({300: 5.0}, 1199, "a message was refused", marks=pytest.mark.nightly),
        pytest.param({300: -5.0}, 1199, "a message was refused", marks=pytest.mark.nightly),
        ({0: 5.0}, 1199, "a message was refused"),
        ({k: -1.0 for k in range(300, 1200)}, 1196, "4 messages were refused"),
    ],
)
def test_a_wrong_stamp_costs_its_message_and_a_clock_set_back_four(
    tmp_path: Path, stamps: dict[int, float], rows: int, lost: str
) -> None:
    robot, off = Robot(HAND), dict(stamps)

    def shift(k: int, message: Any) -> None:
        message.header.stamp.sec += int(off.get(k, 0))

    batch, notes = played(edited(robot, shift).write(tmp_path / "a.bag", ROWS[:, :1]))
    assert len(batch.frames) == rows and any(note.startswith(lost) for note in notes)
    assert not any(isinstance(message, biotac.Gap) for message in batch.messages)


def test_stamps_or_logged_times_are_chosen_once(tmp_path: Path) -> None:
    def some(k: int, message: Any) -> None:
        if k < 2 or 300 <= k < 304:
            message.header.stamp.sec = message.header.stamp.nanosec = 0

    with Writer(tmp_path / "a.bag") as bag:
        robot = edited(Robot(), some)
        connection = bag.add_connection("/t", ALL, typestore=robot.store)
        for k, ns in enumerate(NS.tolist()):
            bag.write(connection, ns + 10**15, robot.bytes_of(robot.message(ns, [ROWS[k, 0]], ())))
    batch, notes = played(f"bag:{tmp_path / 'a.bag'}")
    t_us = np.delete(np.arange(1200) * 10_000, [0, 1, 300, 301, 302, 303]) - 20_000
    np.testing.assert_array_equal(batch.frames["t_us"], t_us)
    assert any("6 messages were refused" in note and "its stamp is 0" in note for note in notes)


def test_a_late_finger_is_judged_by_what_follows_and_a_silent_channel_may_begin(tmp_path: Path) -> None:
    def begin(k: int, message: Any) -> None:
        own = message.tactiles[1]
        if k < 610:
            own.pac, own.pac0, own.pac1, own.pdc = np.zeros(22, np.int16), 0, 0, 0
            own.electrodes = own.electrodes * (np.arange(19) < 5) if k >= 600 else own.electrodes * 0
            own.tac = own.tdc = 0

    batch, notes = played(edited(Robot(pac=True), begin).write(tmp_path / "a.bag", ROWS))
    own = batch.frames[batch.frames["finger"] == 1]
    assert notes == [] and len(own) == 600 and not (own["flags"] & wire.FrameFlags.SENSOR_FAULT).any()
    np.testing.assert_array_equal(own["pdc"], [*[wire.INVALID_COUNT] * 10, *ROWS[610:, 1, slots.PDC_SLOT]])


def test_a_live_rate_that_changes_is_told_once_and_makes_no_more_rounds_than_half_a_period_apart() -> None:
    ns = np.cumsum([10_000_000] * 300 + [1_000_000] * 1000)
    messages = [Message(int(t), (Counts(ROWS[0, 0, E]), None, None, None, None)) for t in ns]
    rounds = RoundMaker("live", messages[:50])
    stamps = MessageStamps("live", rounds.rate, True, int(ns[0]), live=True)
    made = [own.stamp_ns for m in messages for own in stamps.feed(m) if rounds.add(own) is not None]
    assert len(made) >= 300 + 100 and min(np.diff(made)[310:]) >= 5_000_000
    assert [note[:50] for note in stamps.notes] == ["100 messages a second at first, 1000 later: what c"]
