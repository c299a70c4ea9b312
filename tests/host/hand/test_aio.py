"""biotac.aio: batches in an event loop that stays free; and the examples of host/docs, run as they stand."""

import asyncio
import re
import subprocess
import sys
from collections.abc import Coroutine
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import pytest

import biotac


def run(main: Coroutine[Any, Any, Any]) -> Any:
    """In another thread: the browser's tests leave a loop running in this one."""
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(asyncio.run, main).result()


GUIDES = Path(__file__).resolve().parents[3] / "host/docs/guides"
PROGRAMS = re.findall(r"```python\n(.*?)```", (GUIDES / "live_reading.md").read_text(encoding="utf-8"), flags=re.DOTALL)
# However late this computer lets the third one look, it shows a press, and leaves with it.
SHOWN = '{frame.flags}")\n'
LEAVES = f"{SHOWN}        if biotac.FrameFlags.CONTACT in frame.flags:\n            break\n"
PROGRAMS[2] = PROGRAMS[2].replace("&seconds=2", "&seconds=1000").replace(SHOWN, LEAVES)
PROGRAMS.append((GUIDES / "examples/hold.py").read_text(encoding="utf-8"))
SAY = (
    "at the end left was at rest",
    "right: 100 frames from ",
    " ms old, CONTACT|",
    "finger 0: possible touch at ",
    ", 0 lost",
    "holds 1.0 N of weight with ",
)


def test_all_of_a_simulated_source_arrives_and_the_loop_goes_on() -> None:
    async def main() -> tuple[int, int, bool]:
        turns, frames, over = 0, 0, False

        async def others() -> None:
            nonlocal turns
            while not over:
                turns += 1
                await asyncio.sleep(0)

        other = asyncio.create_task(others())
        async with biotac.aio.open("sim:press.toml?fingers=5&seconds=20") as hand:
            async for batch in hand.batches():
                frames += len(batch.wire)
                await asyncio.sleep(0)
            lost = hand.stats.frames_lost + hand.stats.batches_skipped
            touched = hand["index"].t_us > 0
        over = True
        await other
        assert turns > 10
        return frames, lost, touched

    assert run(main()) == (5 * 2000, 0, True)


def test_two_loops_over_one_hand_each_get_all() -> None:
    async def main() -> list[int]:
        async with biotac.aio.open("sim:press.toml?seconds=1000") as hand:

            async def first(count: int) -> int:
                seen = []
                async for frame in hand.frames():
                    seen.append(frame.seq)
                    if len(seen) == count:
                        break
                return seen[-1] - seen[0] + 1

            return await asyncio.gather(first(200), first(300))

    assert run(main()) == [200, 300]


def test_commands_are_awaited_and_errors_come_up() -> None:
    async def main() -> int:
        async with biotac.aio.open("sim:drift.toml?seconds=5") as hand:
            with pytest.raises(biotac.CommandRefusedError, match="NO_SUCH_FINGER"):
                await hand.ask(lambda h: h.sensor_status(5))
            return await hand.ask(lambda h: h.board.setting(biotac.Setting.POC_WEIGHTS))

    assert run(main()) == 1
    with pytest.raises(biotac.DeviceLostError, match="not open yet"):
        _ = biotac.aio.open("sim:drift.toml").hand


def test_a_lost_board_ends_the_iteration_in_words() -> None:
    async def main() -> None:
        async with biotac.aio.open("sim:drift.toml?seconds=1000") as hand:
            with pytest.raises(biotac.DeviceLostError):
                async for _ in hand.batches():
                    hand.hand.link.board.close()

    run(main())


def test_every_example_is_run_somewhere() -> None:
    """grip_in_c.py in tests/lab; tip_and_sides.py by the figures; textures.py by hand: the recordings are not ours."""
    names = {path.name for path in (GUIDES / "examples").glob("*.py")}
    assert names == {"grip_in_c.py", "hold.py", "textures.py", "tip_and_sides.py"}


@pytest.mark.parametrize(("program", "output"), list(zip(PROGRAMS, SAY, strict=True)), ids=SAY)
def test_an_example_runs_and_says_what_it_should(program: str, output: str, tmp_path: Path) -> None:
    (tmp_path / "program.py").write_text(program, encoding="utf-8")
    done = subprocess.run([sys.executable, "program.py"], cwd=tmp_path, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    assert output in done.stdout
