"""Never an old force as a new one: every way of reading, through every way for a stream to stop.

A simulated board in real time, behind a proxy; the reader is a separate program, which can be stopped. Reader and
proxy share a clock: the time at which a value passed the proxy gives the least age that it had when shown,
whatever the library says.
"""

from __future__ import annotations

import json
import math
import os
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from itertools import groupby, pairwise
from operator import itemgetter
from pathlib import Path
from typing import Any

import pytest
from board_behind_proxy import BoardBehindProxy
from served_board import free_port

import biotac
from biotac.board.gap import JUMP_US

PROGRAM = Path(__file__).resolve().parents[1] / "support" / "liveness_program.py"
ROS = Path(__file__).resolve().parents[2] / "host" / "ros2" / "biotac_ros2"
MAX_AGE_S = 0.25
# The two clocks differ by the quickest message's delay; on a busy computer by the bound of Hand.clock.
TOLERANCE_S = 0.1
STEADY_FRAMES = 120
# All is over within a second on a quiet computer; a busy one may take longer, but shows nothing old meanwhile.
PATIENCE = float(os.environ.get("BIOTAC_PATIENCE", "60"))
HELD = """
name = "held"
fingers = FINGERS
step = [
    {do = "rest", seconds = 1.0},
    {do = "press", seconds = 0.5, at = "E17", force_n = 4.0},
    {do = "hold", seconds = 600.0},
]
"""
LOOSE = """
[[fault]]
at_s = 5.0
seconds = 1.2
finger = 1
kind = "stuck_low"
"""


class Program:
    """The reader, and all that it printed. ``patience``: how many times a second it waits for an answer."""

    def __init__(
        self, way: str, board: BoardBehindProxy | Served, *, reconnect: bool, folder: Path, patience: float = 1.0
    ) -> None:
        words = [way, str(board.path), "yes" if reconnect else "no", str(folder), str(patience)]
        pipe, paths = subprocess.PIPE, [str(ROS), os.environ.get("PYTHONPATH", "")]
        env = os.environ | {"PYTHONPATH": os.pathsep.join(paths), "ROS_LOG_DIR": str(folder)}
        env["ROS_DOMAIN_ID"] = str(os.getpid() % 100 + 1)  # nodes beside this one do not hear it
        self._errors = folder / "stderr"
        with self._errors.open("w") as errors:
            self._process = subprocess.Popen(
                [sys.executable, str(PROGRAM), *words], stdin=pipe, stdout=pipe, stderr=errors, text=True, env=env
            )
        self.events: list[dict[str, Any]] = []
        self._thread = threading.Thread(target=self._listen, daemon=True)
        self._thread.start()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            self.events.append(json.loads(line))

    def reported(self, kind: str) -> list[dict[str, Any]]:
        return [event for event in list(self.events) if kind in event]

    def wait_for_rows(self) -> None:
        """Until the program has told as many new values as make the clock settle."""
        end_s, before = time.monotonic() + 300, len(self.events)
        while sum(bool(event.get("shown") or event.get("t_us")) for event in self.events[before:]) < STEADY_FRAMES:
            assert time.monotonic() < end_s
            time.sleep(0.01)

    def told_us(self) -> int:
        """Board time of the latest row that the program told; -1 before the first."""
        return max((event.get("shown") or event.get("t_us") or -1 for event in list(self.events)), default=-1)

    def gaps(self) -> list[biotac.Gap]:
        """Those that the program told, without pauses: a busy computer may have them."""
        gaps = [biotac.Gap(**report["gap"]) for report in self.reported("gap")]
        return [gap for gap in gaps if gap.reason != "paused"]

    def pause(self, seconds: float) -> None:
        self._process.send_signal(signal.SIGSTOP)
        time.sleep(seconds)
        self._process.send_signal(signal.SIGCONT)

    def has_ended(self) -> bool:
        return self._process.poll() is not None

    def end(self) -> None:
        assert self._process.stdin is not None and self._process.stdout is not None
        self._process.stdin.close()
        assert self._process.wait(300) == 0, self._errors.read_text()
        self._thread.join()
        self._process.stdout.close()


@pytest.fixture
def board(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[BoardBehindProxy]:
    """The simulated board; where a test names it "pico", the Pico's image in the emulator."""
    (tmp_path / "held.toml").write_text(HELD.replace("FINGERS", "1"))
    board = BoardBehindProxy(str(tmp_path / "held.toml"), tmp_path, getattr(request, "param", "sim"))
    yield board
    board.close()


WAYS = ["pull", "views", "callbacks", "aio", "record", "lsl"]
# Each opens the hand itself, without reconnect; the page looks for a lost board by opening it anew.
OPENERS = ["page", "ros"]
ON_PICO = ["pull", "views"]
PAUSES_S = [0.5, 1.6, 5.0, 30.0]
BY_DAY = {("pull", 1.6), ("callbacks", 1.6), ("record", 1.6), ("views", 0.5)}


def running(program: Program, board: BoardBehindProxy) -> int:
    """Wait until the program streams, and the clock has settled; later values are to be judged.

    A process keeps time from the beginning. An emulator's time stands still while the emulator's code is compiled.
    """
    board.wait_for(lambda: len(board.passed) >= STEADY_FRAMES)
    if board.kind == "sim":
        return 0
    program.wait_for_rows()
    return len(program.events)


def goes_on(program: Program, board: BoardBehindProxy) -> None:
    """Until more rows have passed and the program has told them, or has ended, however late this computer lets it."""
    before = len(board.passed)
    board.wait_for(lambda: program.has_ended() or len(board.passed) >= before + STEADY_FRAMES)
    last_us = board.passed[-1][0]
    board.wait_for(lambda: program.has_ended() or program.told_us() >= last_us)


def no_old_value_was_shown_as_new(program: Program, board: BoardBehindProxy | Served, begin: int = 0) -> None:
    """A view shows nothing older than allowed; batches tell their true age: at least the time since the frame passed.

    However late this computer lets board and proxy run, a frame is no younger than that. A view's age is by a clock
    judged up to a second ago, and may be off by the largest uncertainty of that clock.
    """
    uncertain_s = TOLERANCE_S
    for event in program.events[begin:]:
        told_s = event.get("uncertain_s", math.inf)
        uncertain_s = max(uncertain_s, told_s if math.isfinite(told_s) else 0.0)
        if event.get("shown") is not None:
            assert event["at_s"] - board.passed_s[event["shown"]] <= MAX_AGE_S + uncertain_s, event
        if event.get("age_s") is not None:
            assert event["age_s"] >= event["at_s"] - board.passed_s[event["t_us"]] - TOLERANCE_S, event


@pytest.mark.parametrize(
    ("board", "way", "pause_s", "reconnect"),
    [
        pytest.param("sim", way, pause_s, reconnect, marks=() if by_day else pytest.mark.nightly)
        for way in [*WAYS, *OPENERS]
        for pause_s in PAUSES_S
        for reconnect in ([False] if way in OPENERS else [False, True])
        for by_day in [(way, pause_s) in BY_DAY and not reconnect]
    ]
    + [pytest.param("pico", way, pause_s, False, marks=pytest.mark.nightly) for way in ON_PICO for pause_s in PAUSES_S],
    indirect=["board"],
)
def test_a_program_that_was_stopped_goes_on_and_is_told(
    board: BoardBehindProxy, tmp_path: Path, way: str, pause_s: float, reconnect: bool
) -> None:
    # A question may be under way in the pause, with the answer behind all that came meanwhile: on a busy computer for
    # more than a second, after which a board counts as gone.
    program = Program(way, board, reconnect=reconnect, folder=tmp_path, patience=PATIENCE)
    begin = running(program, board)
    program.pause(pause_s)
    resumed_s = time.monotonic()
    goes_on(program, board)
    program.end()
    assert not program.reported("lost")
    stamps_us = [t_us for t_us, _ in board.passed]
    at = max(range(1, len(stamps_us)), key=lambda k: stamps_us[k] - stamps_us[k - 1])
    last_us, next_us = stamps_us[at - 1], stamps_us[at]
    assert board.passed_s[next_us] <= resumed_s + 1.0 * PATIENCE
    no_old_value_was_shown_as_new(program, board, begin)
    if way == "record":
        (path,) = program.reported("paths")[0]["paths"]
        recording = biotac.Recording(path)
        gaps = recording.gaps
        assert program.reported("frames")[0]["frames"] == len(recording.frames)
    elif way == "views":
        assert program.reported("counted") or next_us - last_us <= JUMP_US
        return
    elif way == "page":
        assert program.reported("marked") or next_us - last_us <= JUMP_US
        return
    else:
        gaps = [biotac.Gap(**report["gap"]) for report in program.reported("gap")]
    if way == "callbacks":
        assert len(program.reported("on_gap")) == len(gaps)
    if next_us - last_us <= JUMP_US:  # on a busy computer the board may have stopped, too, and been started at once
        assert pause_s < 1.0 and all(gap.reason == "paused" for gap in gaps)
        return
    # The longest; a busy computer may have stopped it at other times, too.
    (longest,) = (gap for gap in gaps if (gap.last_t_us, gap.next_t_us) == (last_us, next_us))
    assert longest.reason == "paused" or (longest.reason == "lost" and pause_s < 1)
    for gap in gaps:
        assert (gap.last_t_us, gap.next_t_us) in set(pairwise(stamps_us)) and gap.reason in ("paused", "lost")
        assert gap.frames_missed == round((gap.next_t_us - gap.last_t_us) / 10_000) - 1


def stops(board: BoardBehindProxy, cause: str) -> None:
    """Let the stream stop for this cause."""
    if cause == "reset":
        board.boot()
    elif cause == "silent":
        board.silent = True
    elif cause == "taken":
        board.stop_stream()
    else:
        board.unplug()


CAUSES = {
    "reset": "restarted|did not answer",
    "silent": "stream stays silent",
    "taken": "took the stream",
    "unplugged": "went away",
}
FATAL_BY_DAY = {*(("pull", cause) for cause in CAUSES), ("views", "unplugged")}


@pytest.mark.parametrize(
    ("board", "way", "cause"),
    [
        pytest.param("sim", way, cause, marks=() if (way, cause) in FATAL_BY_DAY else pytest.mark.nightly)
        for way in [*WAYS, *OPENERS]
        for cause in CAUSES
    ]
    + [pytest.param("pico", way, cause, marks=pytest.mark.nightly) for way in ON_PICO for cause in CAUSES],
    indirect=["board"],
)
def test_a_stream_that_cannot_go_on_is_an_error(board: BoardBehindProxy, tmp_path: Path, way: str, cause: str) -> None:
    program = Program(way, board, reconnect=False, folder=tmp_path)
    begin = running(program, board)
    starts = known = board.starts
    taken_again = 0  # once at most, before a row came that could bring the gap
    stops(board, cause)
    stopped_s = time.monotonic()

    def is_lost() -> bool:
        nonlocal known, stopped_s, taken_again
        if cause == "taken" and board.starts > known:  # this computer was busy for a second, and so it had paused
            known, stopped_s, taken_again = board.starts, time.monotonic(), 1
            board.stop_stream()
        return bool(program.reported("lost"))

    board.wait_for(is_lost)
    program.end()
    (lost,) = program.reported("lost")
    assert re.search(CAUSES[cause], lost["lost"])
    if cause == "taken":  # a link that another program took is not taken back, unless it says that this one paused
        reported = len([*program.reported("gap"), *program.reported("counted")])
        assert way == "record" or board.starts <= starts + max(reported, taken_again)
    elif cause == "silent" and way != "page":  # which opens the board again
        assert board.starts == starts + 1
    # A board that answers but is silent is started once more before it is given up.
    assert lost["at_s"] <= stopped_s + (4.0 if cause == "silent" else 1.0) * PATIENCE
    no_old_value_was_shown_as_new(program, board, begin)


@pytest.mark.parametrize(
    ("board", "way", "cause"),
    [
        pytest.param("sim", way, cause, marks=() if way == "views" and cause != "silent" else pytest.mark.nightly)
        for way in WAYS
        for cause in ("reset", "unplugged", "silent")
    ]
    + [
        pytest.param("pico", way, cause, marks=pytest.mark.nightly)
        for way in ON_PICO
        for cause in ("reset", "unplugged", "silent")
    ],
    indirect=["board"],
)
def test_with_reconnect_it_comes_back_with_a_gap(board: BoardBehindProxy, tmp_path: Path, way: str, cause: str) -> None:
    program = Program(way, board, reconnect=True, folder=tmp_path)
    running(program, board)
    stops(board, cause)
    if cause == "unplugged":
        time.sleep(0.5)
        board.plug()
    elif cause == "silent":
        board.wait_for(lambda: board.starts >= 2)
        board.silent = False
    goes_on(program, board)
    board.wait_for(lambda: bool(program.gaps() or program.reported("counted")) or program.has_ended())
    if way == "views":
        board.wait_for(lambda: program.events[-1].get("shown") is not None)
    program.end()
    assert not program.reported("lost")
    if way == "views":
        assert program.reported("counted")
        return
    wanted = {"reset": "rebooted"}.get(cause, "silence" if cause == "silent" else cause)
    assert [gap.reason for gap in program.gaps()] == [wanted]
    if way == "record":
        kept = [gap for path in program.reported("paths")[0]["paths"] for gap in biotac.Recording(path).gaps]
        assert [gap for gap in kept if gap.reason != "paused"] == program.gaps()


@pytest.mark.parametrize("way", [pytest.param(w, marks=() if w == "pull" else pytest.mark.nightly) for w in WAYS])
def test_a_finger_that_falls_silent_is_stale_and_its_gap_is_told(tmp_path: Path, way: str) -> None:
    (tmp_path / "loose.toml").write_text(HELD.replace("FINGERS", "2").replace("600.0", "300.0") + LOOSE)
    board = BoardBehindProxy(str(tmp_path / "loose.toml"), tmp_path)
    program = Program(way, board, reconnect=False, folder=tmp_path, patience=PATIENCE)

    def hole() -> tuple[int, int, int]:
        """The other finger's rows in the longest one, and its ends; where a computer stops, both have no rows."""
        runs = [[*rows] for _, rows in groupby(board.passed, key=itemgetter(1))]
        holes = (
            (len(rows), before[-1][0], after[0][0])
            for before, rows, after in zip(runs, runs[1:], runs[2:], strict=False)
            if rows[0][1] == 0
        )
        return max(holes, default=(0, 0, 0))

    board.wait_for(lambda: hole()[0] > 100)
    goes_on(program, board)
    program.end()
    board.close()
    assert not program.reported("lost")
    no_old_value_was_shown_as_new(program, board)
    if way == "views":
        assert program.reported("counted") and program.events[-1]["shown"] is not None
        return
    (gap,) = [gap for gap in program.gaps() if gap.reason == "finger"]
    if way == "record":
        assert gap in biotac.Recording(program.reported("paths")[0]["paths"][0]).gaps
    assert (gap.reason, gap.fingers, (gap.last_t_us, gap.next_t_us)) == ("finger", 0b10, hole()[1:])


def test_a_hold_that_lapsed_in_a_pause_is_told_and_not_renewed(board: BoardBehindProxy) -> None:
    with biotac.open(str(board.path)) as hand:
        hand.stream()
        hand.hold("index")
        gaps: list[biotac.Gap] = []
        hand.on_gap(gaps.append)
        board.wait_for(lambda: bool(hand["index"].flags & biotac.FrameFlags.HELD))
        link, write = hand.link, hand.link.write
        link.patience = 6.0  # a question that is not heard is asked again after 2 s
        link.write = lambda data: None  # type: ignore[method-assign]  # the board hears nothing, as if this stood still
        time.sleep(2.5)
        link.write = write  # type: ignore[method-assign]
        board.wait_for(lambda: any(gap.holds_lapsed == 1 for gap in gaps))
        board.wait_for(lambda: not hand["index"].stale)
        assert not hand["index"].flags & biotac.FrameFlags.HELD


class Served:
    """The board, shared on this computer by another program."""

    def __init__(self, board: BoardBehindProxy) -> None:
        endpoint = f"tcp/127.0.0.1:{free_port()}"
        words = ["share", str(board.path), "--zenoh", "left", "--listen", endpoint]
        self._process = subprocess.Popen([sys.executable, "-m", "biotac", *words], stdout=subprocess.PIPE, text=True)
        assert self._process.stdout is not None
        self._process.stdout.readline()  # it is shared
        self.path = f"zenoh:left?connect={endpoint}"
        self.passed, self.passed_s, self.wait_for = board.passed, board.passed_s, board.wait_for

    def close(self) -> None:
        assert self._process.stdout is not None
        self._process.terminate()
        self._process.wait(60)
        self._process.stdout.close()


@pytest.fixture
def served(board: BoardBehindProxy) -> Iterator[Served]:
    served = Served(board)
    yield served
    served.close()


@pytest.mark.nightly
@pytest.mark.parametrize("way", ["pull", "views"])
@pytest.mark.parametrize("pause_s", PAUSES_S)
def test_a_reader_of_a_shared_board_that_was_stopped(served: Served, tmp_path: Path, way: str, pause_s: float) -> None:
    """The network keeps the rows of the break, or drops them, or ends the session: a late row is known as old."""
    program = Program(way, served, reconnect=True, folder=tmp_path)
    program.wait_for_rows()
    program.pause(pause_s)
    resumed_s = time.monotonic()
    program.wait_for_rows()
    rows = [row for row in program.events if (row.get("shown") or row.get("t_us")) and row["at_s"] > resumed_s]
    program.end()
    no_old_value_was_shown_as_new(program, served)
    assert not program.reported("lost") and rows
