"""A recording as a board: the same stream, answers, pace and parts; refusal of the impossible."""

import json
import os
import subprocess
import sys
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from record_all import blocks_of, record_all, written

import biotac
from biotac.cli.main import main
from biotac.recording.replay.link import open_replay
from biotac.wire import messages_gen as wire
from biotac.wire.batches import StreamDecoder
from biotac.wire.decoder import packed, pairs
from biotac.wire.framing import encode

SECONDS = 4


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> tuple[Path, biotac.Recording]:
    path = record_all(f"sim:press.toml?fingers=2&seconds={SECONDS}", tmp_path_factory.mktemp("replay") / "a.mcap")
    return path, biotac.Recording(path)


class FakeClock:
    """Time passes only in sleep."""

    def __init__(self) -> None:
        self.now = 1000.0

    def monotonic_s(self) -> float:
        return self.now

    def wake(self) -> None:
        pass

    def sleep(self, seconds: float) -> None:
        assert seconds >= 0
        self.now += max(seconds, 1e-6)


def test_a_replay_is_the_live_stream_bit_for_bit(recorded) -> None:
    path, recording = recorded
    with biotac.open(f"replay:{path}") as hand:
        batch = hand.read_batch(100)
        assert hand.ended
        assert hand.stats.frames_lost == hand.stats.crc_errors == hand.stats.disordered == 0
    assert batch.frames.tobytes() == recording.frames.tobytes()
    assert batch.wire.tobytes() == recording.wire.tobytes()
    assert batch.pac.tobytes() == recording.pac.tobytes()
    assert [m for m in batch.messages if isinstance(m, wire.Tare)] == [
        m for m in recording.messages if isinstance(m, wire.Tare)
    ]


def test_it_answers_as_its_board_did(recorded, capsys) -> None:
    path, _ = recorded
    with biotac.open("sim:press.toml?fingers=2&seconds=1") as board, biotac.open(f"replay:{path}") as replay:
        assert replay.fingers == board.fingers == [0, 1]
        assert replay.board.settings() == board.board.settings()
        assert replay.sensor_info(1).serial == board.sensor_info(1).serial
        replay.ping()
        assert replay.status().fingers_present == 0b11
        assert replay.sensor_status(0).finger == 0
    assert main(["info", f"replay:{path}", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["board"] == "simulator"


@pytest.mark.parametrize(
    ("command", "name"),
    [
        (lambda hand: hand.tare(0), "TareNow"),
        (lambda hand: hand.board.set_setting(wire.Setting.POC_WEIGHTS, 2), "SetSetting"),
        (lambda hand: hand.hold(0), "Hold"),
    ],
)
def test_what_would_change_a_board_is_refused_in_words(recorded, command, name: str) -> None:
    path, recording = recorded
    with biotac.open(f"replay:{path}") as hand:
        with pytest.raises(biotac.CommandRefusedError, match=f"is a recording: {name}.*biotac export --recompute"):
            command(hand)
        assert len(hand.read(100)) == len(recording.frames)  # and it still plays


def test_a_part_of_it_is_the_same_rows(recorded) -> None:
    path, recording = recorded
    elapsed = recording.frames["t_us"] - recording.begin_us
    expected = recording.frames[(elapsed >= 1_250_000) & (elapsed < 2_500_000)]
    with biotac.open(f"replay:{path}?from=1.25&to=2.5") as hand:
        frames = hand.read(100)
    assert len(frames) == 250 and np.array_equal(frames["seq"], expected["seq"])
    assert np.array_equal(frames["counts"], expected["counts"])
    assert hand.stats.frames_lost == 0


def test_a_status_from_before_the_part_is_no_wrap_of_the_clock(tmp_path) -> None:
    """GET_STATUS, which a hand asks for all the time, was answered with the recording's first, minutes old."""
    path = record_all("sim:press.toml?seconds=20", tmp_path / "a.mcap")
    with biotac.open(f"replay:{path}?from=15") as hand:
        rows = hand.read(0.1)
        hand.status()
        rows = np.concatenate([rows, hand.read(4)])
    assert (np.diff(rows["t_us"]) == 10_000).all() and rows["seq"][0] == 1500


@pytest.mark.parametrize(
    ("query", "error"),
    [
        *((part, biotac.InputError) for part in ("from=-1", "from=99", "from=3&to=2", "from=nan")),
        *((option, biotac.PortError) for option in ("from=x", "loop=1", "pace=-1")),
    ],
)
def test_parts_and_options_that_are_none_are_refused(recorded, query: str, error: type[Exception]) -> None:
    seen = r"0 <= from < to, and from within its 3\.99 s" if error is biotac.InputError else "replay:"
    with pytest.raises(error, match=seen):
        biotac.open(f"replay:{recorded[0]}?{query}")


@pytest.mark.parametrize("pace", [0.5, 4.0])
def test_pace_is_kept_on_the_clock(recorded, pace: float) -> None:
    """Each frame arrives at the device's time, on a clock that only sleeping moves."""
    path, _ = recorded
    clock = FakeClock()
    link = open_replay(f"replay:{path}", pace, clock=clock)
    decoder = StreamDecoder()
    link.write(encode(wire.Start.ID, wire.Start(1, int(wire.StreamFlags.FRAMES), 0x1F, 0).pack()))
    arrivals: list[tuple[float, int]] = []
    while not link.ended:
        batch = decoder.feed(link.read(0.2))
        if len(batch.frames):
            arrivals.append((clock.now, int(batch.frames["t_us"][-1])))
    assert len(arrivals) >= 100 * SECONDS - 1  # round by round, not in blocks
    start_s, first_us = arrivals[0]
    for now_s, t_us in arrivals:
        assert now_s - start_s == pytest.approx((t_us - first_us) / 1e6 / pace, abs=1e-4)
    assert all(later[0] > sooner[0] for sooner, later in pairwise(arrivals))


def test_only_what_start_asks_for_is_played(recorded) -> None:
    path, recording = recorded
    with biotac.open(f"replay:{path}") as hand:
        hand.stream("force", fingers=[1])
        batch = hand.read_batch(100)
    assert len(batch.pac) == 0
    assert set(batch.frames["finger"]) == {1} and len(batch.frames) == len(recording.frames) // 2


def test_a_restart_within_the_recording_is_no_loss(tmp_path) -> None:
    path = tmp_path / "twice.mcap"
    with biotac.open("sim:press.toml?seconds=3") as hand:
        hand.record(path)
        hand.read(1.0)
        hand.stop()
        hand.read(100)
    recording = biotac.Recording(path)
    assert recording.frames_lost == 0
    with biotac.open(f"replay:{path}") as hand:
        assert hand.read_batch(100).frames.tobytes() == recording.frames.tobytes()
        assert hand.stats.frames_lost == 0


def test_a_damaged_frame_is_counted_and_its_replay_has_a_loss(recorded, tmp_path) -> None:
    _, recording = recorded
    blocks = blocks_of(recording)
    lost = pairs(blocks[1])
    lost.remove(next(pair for pair in lost[31:] if pair[0] == wire.FrameMessage.ID))
    blocks[1] = packed(lost)
    times = zip(blocks, recording.arrived_ns, strict=True)
    damaged = written(tmp_path / "damaged.mcap", recording.metadata, times, {1: {"bad_crc": 1}})
    (found,) = biotac.Recording(damaged).rejected
    second_s = (recording.arrived_ns[1] - recording.arrived_ns[0]) / 1e9
    assert found == {"at_s": second_s, "bad_crc": 1}
    with biotac.open(f"replay:{damaged}") as hand:
        assert len(hand.read(100)) == len(recording.frames) - 1
        assert hand.stats.frames_lost == biotac.Recording(damaged).frames_lost == 1


def test_on_a_pty_it_is_a_board_for_any_serial_program(recorded, tmp_path) -> None:
    path, recording = recorded
    link = tmp_path / "board"
    program = [sys.executable, "-m", "biotac", "sim", str(path), "--pace", "50", "--link", str(link)]
    with subprocess.Popen([*program, "--json"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None and process.stderr is not None
        port = json.loads(process.stdout.readline())["port"]
        assert os.path.realpath(link) == os.path.realpath(port)
        frames = []
        with biotac.open(str(link)) as hand:
            with pytest.raises(biotac.CommandRefusedError, match="NOT_HERE"):
                hand.tare(0)
            for batch in hand.batches():
                frames.append(batch.frames)
                if sum(map(len, frames)) == len(recording.frames):
                    break
        assert "has ended" in process.stderr.readline()  # it says so once the last frame is written
        process.terminate()
        assert process.wait() == 0
    assert np.concatenate(frames).tobytes() == recording.frames.tobytes()
    assert not link.is_symlink()
