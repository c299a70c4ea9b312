"""The simulated board is in this process: many at once give the bytes of each alone, and leave nothing behind."""

import asyncio
import gc
import os
import re
import subprocess
import sys
import threading
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

import biotac
from biotac.sim import SimFinger, SimTouch, world
from biotac.sim.board import SimBoard
from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode

ROOT = Path(__file__).resolve().parents[3]
PORT = "sim:press.toml?fingers=5&seconds=2"


def frames_of(port: str) -> bytes:
    with biotac.open(port) as hand:
        return hand.read(10).tobytes()


ALONE = frames_of(PORT)


def test_a_hand_in_each_of_four_threads_has_what_it_has_alone() -> None:
    with ThreadPoolExecutor(4) as threads:
        assert set(threads.map(frames_of, [PORT] * 4)) == {ALONE}


def test_an_asyncio_program_has_what_it_has_alone() -> None:
    async def read() -> bytes:
        async with biotac.aio.open(PORT) as hand:
            rows: np.ndarray = await hand.ask(lambda h: h.read(10))
            return rows.tobytes()

    async def both() -> list[bytes]:
        return list(await asyncio.gather(read(), read()))

    with ThreadPoolExecutor(1) as thread:  # the browser of the page's tests leaves a loop running in this one
        assert thread.submit(asyncio.run, both()).result() == [ALONE] * 2


def course(w: biotac.sim.LockStep, step: int) -> bytes:
    now = w.step(index=SimTouch(0.01 * step), thumb=SimTouch(0.02 * step))
    return b"".join(now[name].frame.force_n.tobytes() + bytes(now[name].frame.counts) for name in ("index", "thumb"))


def test_two_boards_stepped_in_turn_have_what_each_has_alone() -> None:
    def fingers(seed: int) -> dict[str, SimFinger]:
        return {"index": SimFinger(seed), "thumb": SimFinger(seed + 1)}

    alone = []
    for seed in (1, 5):
        with world(fingers(seed)) as w:
            alone.append([course(w, step) for step in range(100)])
    with world(fingers(1)) as one, world(fingers(5)) as other:
        both = [(course(one, step), course(other, step)) for step in range(100)]
    assert [list(part) for part in zip(*both, strict=True)] == alone


def kibibytes() -> int:
    return int(next(line for line in Path("/proc/self/status").read_text().splitlines() if "VmRSS" in line).split()[1])


@pytest.mark.skipif(not Path("/proc/self").exists(), reason="only Linux counts in /proc")
def test_a_thousand_boards_leave_nothing_behind() -> None:
    source = load_source("press.toml", seconds=1)

    def boards(count: int) -> tuple[int, int, int]:
        for k in range(count):
            board = SimBoard(source, pace=float(k % 2))
            board.release()
            board.read(0.001)
            board.close()
        gc.collect()
        return len(os.listdir("/proc/self/fd")), threading.active_count(), kibibytes()

    before = boards(50)
    after = boards(1000)
    assert after[:2] == before[:2]
    assert after[2] - before[2] < 4096  # a board has some 400 KiB


FORK = """
import os, sys, biotac
hand = biotac.open("sim:press.toml?pace=1")
hand.stream()
hand.read(0.1)
child = os.fork()
if child == 0:
    try:
        hand.read(0.1)
    except biotac.DeviceLostError as error:
        print(error)
    sys.exit()  # with all that an interpreter's end does
assert os.waitpid(child, 0)[1] == 0
print(len(hand.read(0.1)))
"""


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork on this system")
def test_a_fork_is_told_in_one_sentence_and_its_parent_reads_on() -> None:
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", FORK], capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    sentence, rows = done.stdout.splitlines()
    assert "belongs to the process that opened it" in sentence and int(rows) == 10


END = """
import biotac
hand = biotac.open("sim:press.toml?pace=1")
hand.stream()
hand.read(0.1)
print(len(hand.read(0.1)))
"""


def test_a_program_that_ends_without_close_ends() -> None:
    done = subprocess.run([sys.executable, "-c", END], capture_output=True, text=True, timeout=120)
    assert (done.returncode, done.stdout, done.stderr) == (0, "10\n", "")


def test_the_firmware_has_no_state_of_its_own(tmp_path: Path) -> None:
    """Data that is written and no part of a struct would be shared by all boards of a program."""
    rooms = [f"-I{folder}" for folder in map(ROOT.joinpath, ("firmware/core", "firmware/port", "firmware/sensor"))]
    for source in (ROOT / f"firmware/app/{name}.c" for name in ("gateway", "kept_tares", "start", "uart")):
        subprocess.run(["gcc", "-c", *rooms, source, "-o", tmp_path / f"{source.stem}.o"], check=True)
    objects, built = list(tmp_path.glob("*.o")), list((ROOT / "build").glob("cp*/CMakeFiles"))
    if not built:
        pytest.skip("no objects in build/cp*: the package was not built here")
    for room in ("biotac_core", "biotac_sensor", "biotac_emu"):
        objects += (built[0] / f"{room}.dir").rglob("*.o")
    nm = ["nm", "-A", "--format=sysv", *map(str, objects)]
    listed = subprocess.run(nm, capture_output=True, text=True, check=True).stdout
    assert len(objects) > 60
    written = re.compile(r"\|(\*COM\*|\.t?bss\S*|\.t?data(?!\.rel\.ro)\S*)\s*$")  # sections that a program may write
    assert [line for line in listed.splitlines() if written.search(line)] == []


def test_more_than_the_boards_inbox_holds_is_heard() -> None:
    with biotac.open("sim:press.toml") as hand:
        before = hand.status().rx_frames
        hand.link.write(encode(wire.Ping.ID, wire.Ping(0).pack()) * 10_000)
        assert hand.status().rx_frames >= before + 10_000
