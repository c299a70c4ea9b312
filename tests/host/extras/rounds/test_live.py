"""foxglove:// against foxglove-sdk's own server: five fingers at 100 Hz, and a robot that stops, changes and fails."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import numpy as np
import pytest
from live_board import WAIT_S
from live_board import until as wait_until

import biotac
from biotac.errors import CommandRefusedError, DeviceLostError, PortError
from biotac.wire import messages_gen as wire

SUPPORT = Path(__file__).parents[3] / "support"
SECONDS = float(os.environ.get("BIOTAC_LIVE_SECONDS", "4"))  # by hand 600


class Bridge:
    def __init__(self, kind: str, fingers: int, seconds: float, port: int) -> None:
        words = [sys.executable, str(SUPPORT / "robot_messages.py"), str(port), str(seconds), kind, str(fingers)]
        pipe, env = subprocess.PIPE, os.environ | {"PYTHONPATH": str(SUPPORT)}
        self.process = subprocess.Popen(words, stdin=pipe, stdout=pipe, text=True, env=env)
        self.port = f"foxglove://127.0.0.1:{port}/rh/tactile"
        assert self.process.stdout is not None and self.process.stdout.readline() == "ready\n"

    def send(self, command: str) -> None:
        assert self.process.stdin is not None
        self.process.stdin.write(f"{command}\n")
        self.process.stdin.flush()

    def end(self) -> None:
        self.process.kill()
        self.process.communicate()


@pytest.fixture
def bridge() -> Iterator[Callable[..., Bridge]]:
    made: list[Bridge] = []
    with socket.create_server(("127.0.0.1", 0)) as free:
        number = free.getsockname()[1]

    def make(kind: str = "ros1", fingers: int = 1, seconds: float = SECONDS + 300.0) -> Bridge:
        made.append(Bridge(kind, fingers, seconds, number))
        return made[-1]

    yield make
    for one in made:
        one.end()


@contextmanager
def viewed(port: str, folder: Path) -> Iterator[None]:
    """The live page meanwhile, in a separate process; a failing test ends that too."""
    words = [sys.executable, "-m", "biotac", "view", port, "--port", "0", "--no-browser"]
    with subprocess.Popen(words, cwd=folder, stdout=subprocess.PIPE, text=True) as page:
        try:
            assert page.stdout is not None and "http://" in page.stdout.readline()
            yield
            assert page.poll() is None
        finally:
            page.terminate()


def until(hand: biotac.Hand, wanted: Callable[[biotac.Batch], bool]) -> biotac.Batch:
    end_s = time.monotonic() + WAIT_S
    for batch in hand.batches():
        if wanted(batch):
            return batch
        assert time.monotonic() < end_s, hand.link.notes
    raise AssertionError("it ended")


def tared(hand: biotac.Hand) -> bool:
    """Whether the board took a tare now; it refuses while the finger moves."""
    with suppress(CommandRefusedError):
        hand.tare(0)
        return True
    return False


@pytest.mark.parametrize("kind", ["ros1", pytest.param("ros2", marks=pytest.mark.nightly)])
def test_nothing_is_lost_with_page_recording_and_commands_at_once(bridge, tmp_path: Path, kind: str) -> None:
    robot = bridge(kind, 5)
    seen: list[np.ndarray] = []
    gaps: list[biotac.Gap] = []
    with viewed(robot.port, tmp_path), biotac.open(robot.port) as hand, hand.record(tmp_path / "a.mcap"):
        assert hand.fingers == [0, 1, 2, 3, 4] and hand.info.board == wire.BoardKind.MESSAGES
        hand.stream("results", "events")
        came_ms, zero_ns, count = [], hand.link.zero_ns, 0
        for batch in hand.batches():
            now_ns = time.time_ns()
            seen.append(batch.frames)
            gaps += [m for m in batch.messages if isinstance(m, biotac.Gap)]
            came_ms += ((now_ns - zero_ns) / 1e6 - batch.frames["t_us"] / 1e3).tolist()
            count += len(batch.frames)
            if count >= 500 * SECONDS:
                break
        until(hand, lambda batch: tared(hand))
        with hand.grasp():
            until(hand, lambda batch: bool((batch.frames["flags"] & wire.FrameFlags.HELD).any()))
        stats = hand.stats
    frames = np.concatenate(seen)
    assert (stats.frames_lost, stats.crc_errors) == (0, 0)
    assert {gap.reason for gap in gaps} <= {"paused"}  # by a busy computer; the gap counts the rows left out
    for finger in range(5):
        own = frames[frames["finger"] == finger]
        goes_on = np.diff(own["t_us"]) == 10_000
        assert (np.diff(own["seq"])[goes_on] == 1).all()
        assert set(own["t_us"][1:][~goes_on].tolist()) <= {gap.next_t_us for gap in gaps}
    recording = biotac.Recording(tmp_path / "a.mcap")
    assert len(recording.frames) >= len(frames)
    assert recording.problems == [gap.line() for gap in recording.gaps if gap.reason == "paused"]
    print(f"{kind}: {len(frames)} frames; stamp to Python {np.percentile(came_ms, [50, 99]).round(1)} ms (median, p99)")


def test_a_topic_that_stops_changes_and_comes_back(bridge) -> None:
    robot = bridge()
    with biotac.open(robot.port) as hand:
        hand.stream("results")
        until(hand, lambda b: len(b.frames) > 0)
        robot.send("stop")
        wait_until(lambda: not hand.status().fingers_present)
        robot.send("go")
        until(hand, lambda b: len(b.frames) > 0 and hand.status().fingers_present == 1)
        assert hand.stats.frames_lost == 0
        robot.send("change")  # to the message without pac[]
        batch = until(hand, lambda b: len(b.pac) > 0 and (b.pac["pac"] == wire.INVALID_COUNT).all())
        assert (batch.frames["counts"] != wire.INVALID_COUNT).all()


STANDS_STILL = """
import os, subprocess, sys, time, biotac
with biotac.open(sys.argv[1]) as hand:
    hand.stream("results")
    begun_s = time.monotonic()
    stop = f"sleep 2; kill -STOP {os.getpid()}; sleep 2; kill -CONT {os.getpid()}"
    subprocess.Popen(["sh", "-c", stop], start_new_session=True)
    longest_us, last_us = 0, {}
    for batch in hand.batches():
        for finger, t_us in zip(batch.wire["finger"].tolist(), batch.t_us.tolist()):
            longest_us = max(longest_us, t_us - last_us.get(finger, t_us))
            last_us[finger] = t_us
        if time.monotonic() > begun_s + 7.0:
            break
    print(hand.stats.frames_lost, longest_us < 1_000_000)
"""


@pytest.mark.nightly
def test_a_program_that_stands_still_loses_no_message(bridge) -> None:
    """No hole while the topic stood still. A busy computer may stop it in other ways, which are told; not each time."""
    port = bridge().port

    def is_whole() -> bool:
        done = subprocess.run([sys.executable, "-c", STANDS_STILL, port], capture_output=True, text=True)
        assert (done.stdout.split()[0], done.stderr) == ("0", "")
        return done.stdout == "0 True\n"

    assert any(is_whole() for _ in range(5))


def test_a_bridge_that_is_killed_is_lost_or_found_again(bridge) -> None:
    robot = bridge()
    with biotac.open(robot.port) as lost, biotac.open(robot.port, reconnect=True) as hand:
        for one in (lost, hand):
            one.stream("results")
            until(one, lambda b: len(b.frames) > 0)
        robot.end()
        with pytest.raises(DeviceLostError, match="foxglove"):
            for _ in range(100):
                lost.read(0.2)
        bridge()
        gap = until(hand, lambda b: any(isinstance(m, biotac.Gap) for m in b.messages))
        assert len(gap.frames)
    with pytest.raises(PortError, match="no foxglove_bridge answers"):
        biotac.open("foxglove://127.0.0.1:9/rh/tactile")


def test_a_topic_that_is_not_there_is_said_with_what_is(bridge) -> None:
    robot = bridge()
    with pytest.raises(PortError, match=r"no topic /lh, but /rh/tactile \(sr_robot_msgs/BiotacAll\)"):
        biotac.open(robot.port.replace("/rh/tactile", "/lh"))
