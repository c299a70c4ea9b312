"""How a hand ends: forgotten, with the program, in a fork, in a cancelled task. Nothing leaks, nothing is lost."""

import asyncio
import gc
import os
import pickle
import signal
import subprocess
import sys
import threading
import weakref
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from types import SimpleNamespace

import pytest
from live_board import Firmware, Live, frame, until

import biotac
from biotac.board.connection import Connection, State
from biotac.hand.hand import Hand
from biotac.link.serial_port import SerialLink
from biotac.wire import messages_gen as wire

WAIT_S = 600.0


def held() -> tuple[int, int]:
    """Threads and descriptors of this process."""
    return threading.active_count(), len(os.listdir("/proc/self/fd"))


@pytest.mark.skipif(not Path("/proc/self/fd").exists(), reason="counts descriptors where /proc has them")
def test_a_running_hand_that_nobody_but_its_own_callback_knows_is_gone_and_its_recording_whole(tmp_path) -> None:
    def cell(path: Path) -> int:
        hand, seen = biotac.open("sim:press.toml?seconds=1000"), 0
        hand.record(path)
        hand.on_batch(lambda batch: hand.stats)
        hand.stream()
        for _, batch in zip(range(3), hand.batches(), strict=False):
            seen += len(batch.wire)
        alive.append(weakref.ref(hand))
        return seen

    alive: list[weakref.ref[Hand]] = []
    before = held()
    for k in range(3):
        seen = cell(tmp_path / f"{k}.mcap")
        until(lambda: gc.collect() >= 0 and alive[-1]() is None)  # not while the hand's callback runs
        recording = biotac.Recording(tmp_path / f"{k}.mcap")
        assert not recording.cut_off and len(recording.frames) >= seen
    until(lambda: held() <= before)  # remains of other tests may go meanwhile


def test_a_finger_and_an_iteration_keep_their_hand() -> None:
    hand = biotac.open("sim:press.toml?seconds=1000")
    hand.stream()
    finger, alive = hand["index"], weakref.ref(hand)
    del hand
    gc.collect()
    batches = alive().batches()
    next(batches)
    del finger
    gc.collect()
    assert alive() is not None and len(next(b for b in batches if len(b.wire)).wire)
    del batches
    gc.collect()
    assert alive() is None


class Noted(SerialLink):
    closed = 0

    def close(self) -> None:
        super().close()
        self.closed += 1


def test_two_threads_that_close_a_hand_close_it_once(scripted_board, hello) -> None:
    board = scripted_board(firmware := Firmware(hello))
    live = Live(board, firmware, link := Noted(board.path))
    hand = live.hand
    running, resume = threading.Event(), threading.Event()
    hand.on_batch(lambda batch: (running.set(), resume.wait(WAIT_S)))
    hand.stream()
    live.send(frame(1))
    assert running.wait(WAIT_S)
    with ThreadPoolExecutor(2) as closing:
        both = [closing.submit(hand.close) for _ in range(2)]
        until(lambda: not hand.streaming)
        while not both[1].running():
            pass
        resume.set()
        for one in both:
            one.result(WAIT_S)
    assert link.closed == 1


def test_a_hand_collected_on_its_own_thread_ends_too(scripted_board, hello) -> None:
    firmware = Firmware(hello)
    board = scripted_board(firmware)
    link, ended = Noted(board.path), threading.Event()
    hands = [Hand(link)]

    def forgets(batch: biotac.Batch) -> None:
        if hands and len(batch.wire):
            hands.clear()
            gc.collect()
            ended.set()

    hands[0].on_batch(forgets)
    hands[0].stream()
    board.send(frame(1))
    assert ended.wait(WAIT_S)
    firmware.wait_for(wire.Stop, 2)
    until(lambda: link.closed)


# ---- the end of a program ------------------------------------------------------------------------

ENDS = {
    "just ends": ("", 0),
    "sys.exit": ("sys.exit(3)", 3),
    "an error": ("raise ZeroDivisionError", 1),
    "SystemExit in a callback": ("hand.on_batch(lambda b: sys.exit(1)); time.sleep(0.1)", 0),
}
RECORDS = """
import sys, time
import biotac
hand = biotac.open("sim:press.toml?seconds=1000", pace=1.0)
hand.record(sys.argv[1])
seen = 0
{run}
for batch in hand.batches():
    seen += len(batch.wire)
    if seen >= 120:
        break
print(seen, flush=True)
{end}
"""


@pytest.mark.parametrize("run", [pytest.param("", marks=pytest.mark.nightly), "hand.stream()"])
@pytest.mark.parametrize(
    "end", [pytest.param(end, marks=() if end in ("just ends", "an error") else pytest.mark.nightly) for end in ENDS]
)
def test_a_program_that_ends_without_close_loses_nothing_that_came(end: str, run: str, tmp_path: Path) -> None:
    text, code = ENDS[end]
    program = [sys.executable, "-c", RECORDS.format(run=run, end=text), str(tmp_path / "a.mcap")]
    done = subprocess.run(program, capture_output=True, text=True)
    assert done.returncode == code, done.stderr
    recording = biotac.Recording(tmp_path / "a.mcap")
    assert recording.problems == []
    assert len(recording.frames) >= int(done.stdout)


# ---- other processes -----------------------------------------------------------------------------

FORKS = """
import os, sys
import biotac
hand = biotac.open("sim:press.toml?seconds=1000", pace=1.0)
hand.record(sys.argv[1])
hand.stream()
hand.read(0.3)
view = hand["index"]
if os.fork() == 0:
    refused = []
    for use in (hand.ping, lambda: hand.read(1.0), lambda: view.force_n, hand.stream, hand.stop, hand.status,
                lambda: hand.on_batch(print), lambda: list(hand.batches()), hand.check):
        try:
            use()
        except biotac.DeviceLostError as error:
            refused.append("belongs to the process that opened it" in str(error))
    print("child", refused.count(True), hand.connected, flush=True)
    try:
        hand.close()
    except biotac.DeviceLostError:
        print("close tells, too", flush=True)
    {leave}
os.wait()
frames = hand.read(0.5)
print("parent", len(frames), hand.stats.frames_lost, hand.stats.crc_errors, hand.streaming, flush=True)
hand.status()
hand.close()
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
@pytest.mark.parametrize("leave", ["os._exit(0)", "del hand, view; sys.exit(0)"])
def test_a_fork_is_told_and_the_parent_reads_on(leave: str, tmp_path: Path) -> None:
    program = [sys.executable, "-W", "ignore", "-c", FORKS.format(leave=leave), str(tmp_path / "a.mcap")]
    done = subprocess.run(program, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout.splitlines() == ["child 9 False", "close tells, too", "parent 50 0 0 True"]
    recording = biotac.Recording(tmp_path / "a.mcap")
    assert recording.problems == [] and len(recording.frames) >= 80


@pytest.mark.skipif(not hasattr(os, "fork"), reason="this system has no fork")
def test_a_fork_waits_for_no_lock_of_a_thread_that_it_lacks() -> None:
    connection = Connection(SimpleNamespace(port="x"), reconnects=False)
    held, forked = threading.Event(), threading.Event()

    def hold() -> None:
        with connection.changed:
            held.set()
            forked.wait()

    holder = threading.Thread(target=hold)
    holder.start()
    held.wait()
    child = os.fork()
    if child == 0:
        signal.alarm(30)  # ends a child that waits
        os._exit(connection.state is not State.CLOSED)
    forked.set()
    holder.join()
    assert os.waitpid(child, 0)[1] == 0 and connection.state is State.OPEN


def test_a_hand_cannot_be_sent_to_another_process() -> None:
    with biotac.open("sim:press.toml?seconds=1") as hand:
        for thing in (hand, hand["index"], biotac.aio.open("sim:press.toml")):
            with pytest.raises(TypeError, match="belongs to this process and cannot be sent to another; open"):
                pickle.dumps(thing)


SPAWNS = """
import multiprocessing, sys
import biotac

def work(queue):
    with biotac.open("sim:press.toml?seconds=2") as hand:
        hand.stream()
        queue.put(hand.read(1.0)["force_n"])

if __name__ == "__main__":
    processes = multiprocessing.get_context("spawn")
    with biotac.open("sim:press.toml?seconds=2") as hand:
        mine = hand.read(1.0)["force_n"]
        queue = processes.Queue()
        worker = processes.Process(target=work, args=(queue,))
        worker.start()
        theirs = queue.get(timeout=120)
        worker.join()
        print(worker.exitcode, mine.tobytes() == theirs.tobytes(), len(hand.read(0.5)))
        refused = processes.Process(target=print, args=(hand,))
        try:
            refused.start()
        except TypeError as error:
            print("belongs to this process" in str(error))
"""


def test_a_spawned_process_has_hands_of_its_own_and_gets_none(tmp_path: Path) -> None:
    """As on Windows and macOS, where multiprocessing knows nothing else."""
    program = tmp_path / "spawns.py"
    program.write_text(SPAWNS)
    done = subprocess.run([sys.executable, str(program)], capture_output=True, text=True)
    assert (done.returncode, done.stderr, done.stdout.splitlines()) == (0, "", ["0 True 50", "True"])


# ---- asyncio -------------------------------------------------------------------------------------


def test_a_time_out_around_open_leaves_nothing_open() -> None:
    opening, resume = threading.Event(), threading.Event()
    opened: list[biotac.Hand] = []

    def slowly() -> biotac.Hand:
        opening.set()
        assert resume.wait(WAIT_S)
        opened.append(biotac.open("sim:press.toml?seconds=1000"))
        return opened[0]

    async def main() -> None:
        async def use() -> None:
            async with biotac.hand.aio.AsyncHand(slowly):
                raise AssertionError("it was given up")

        task = asyncio.create_task(use())
        await asyncio.to_thread(opening.wait)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task
        resume.set()

    with ThreadPoolExecutor(1) as pool:
        pool.submit(asyncio.run, main()).result()
    assert opened[0].closed


def test_a_cancelled_iteration_and_command_leave_the_hand_usable() -> None:
    async def main() -> int:
        async with biotac.aio.open("sim:press.toml?seconds=1000") as hand:

            async def forever() -> None:
                async for _ in hand.batches():
                    pass

            task = asyncio.create_task(forever())
            while hand.stats.frames < 10:
                await asyncio.sleep(0.001)
            task.cancel()
            command = asyncio.create_task(hand.ask(lambda h: h.status()))
            await asyncio.sleep(0)
            command.cancel()
            for one in (task, command):
                with pytest.raises(asyncio.CancelledError):
                    await one
            before = hand.stats.frames
            async for _ in hand.batches():  # the board waits for nobody else: the iteration's queue is gone
                if hand.stats.frames > before + 100:
                    return (await hand.ask(lambda h: h.status())).fingers_present

        return 0

    with ThreadPoolExecutor(1) as pool:
        assert pool.submit(asyncio.run, main()).result() == 1
