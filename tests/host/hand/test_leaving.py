"""A loop or a read left in whatever way loses nothing, and the hand is free afterwards."""

import asyncio
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import biotac
from biotac.sim import SimFinger, world


def follows(before: int, rows: np.ndarray) -> bool:
    return rows["seq"].tolist() == list(range(before + 1, before + 1 + len(rows)))


def in_thread(hand: biotac.Hand) -> np.ndarray:
    with ThreadPoolExecutor(1) as pool:
        return pool.submit(hand.read, 0.2).result()


@pytest.mark.parametrize("pace", [0, 20])
def test_what_follows_a_loop_that_was_left_is_read_next(pace: float) -> None:
    with biotac.open("sim:press.toml?seconds=1000", pace=pace) as hand:
        for leave in (29, 60, 95):
            for frame in hand.frames():
                if frame.seq >= leave:
                    break
            rows = hand.read(seconds=0.2)
            assert follows(frame.seq, rows), (frame.seq, rows["seq"])
        assert (hand.stats.frames_lost, hand.stats.frames_skipped) == (0, 0)


@pytest.mark.parametrize("order", [(0, 1, 2), (2, 1, 0), (1, 2, 0)])
def test_generators_are_closed_in_any_order(order: tuple[int, ...]) -> None:
    with biotac.open("sim:press.toml?seconds=1000") as hand:
        made = [hand.frames(), hand.batches(), hand.frames()]
        for generator in made:
            next(generator)
        with pytest.raises(biotac.InputError, match=r"'MainThread' is reading.*close its generator"):
            in_thread(hand)
        for k in order:
            made[k].close()
        assert (np.diff(in_thread(hand)["seq"].astype(int)) > 0).all()


def test_an_ask_that_timed_out_ends_and_loses_nothing() -> None:
    async def main() -> None:
        async with biotac.aio.open("sim:press.toml?seconds=1000", pace=1) as hand:
            first = await hand.ask(lambda h: h.read(0.1))
            with pytest.raises(asyncio.TimeoutError):
                await asyncio.wait_for(hand.ask(lambda h: h.read(300)), 0.3)
            rows = await hand.ask(lambda h: h.read(0.1))
            status = await hand.ask(lambda h: h.status())  # the board's time: the read of 300 s has not gone on
            assert int(status.t_us) - int(first["t_us"][-1]) < 150e6
            assert follows(int(first["seq"][-1]), rows)

    with ThreadPoolExecutor(1) as thread:  # the browser of the page's tests leaves a loop running in this one
        thread.submit(asyncio.run, main()).result()


def test_an_unplug_after_stop_stands_still_for_nobody(monkeypatch: pytest.MonkeyPatch) -> None:
    """The world waits for the hand until it is connected again, and no longer for a stream that nobody wants."""
    waits, really_sleep = [], time.sleep
    with world({"index": SimFinger(1)}) as hands:

        def sleep(seconds: float) -> None:
            if threading.current_thread() is threading.main_thread():
                waits.append(hands.hand.connected)
            really_sleep(seconds)

        monkeypatch.setattr(time, "sleep", sleep)
        hands.run(0.5)
        hands.hand.stop()
        hands.unplug(0.2)
        hands.run(0.5)
        found = len(waits) - waits[::-1].index(False) if False in waits else len(waits)
        assert len(waits[found:]) <= 1  # it was found between a look and a wait
        assert not hands.hand.streaming
