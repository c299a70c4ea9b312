"""A program that reads a hand in one of the ways there are, and says what it sees as JSON lines.

python liveness_program.py WAY PORT RECONNECT [FOLDER]; it ends with the end of stdin.
"""

from __future__ import annotations

import asyncio
import json
import math
import sys
import threading
import time
from typing import Any

import biotac

LOOK_S = 0.01
over = threading.Event()


def say(**what: Any) -> None:
    """One observation, at the time of this computer that all processes share."""
    print(json.dumps({"at_s": time.monotonic()} | what), flush=True)


def say_batch(batch: biotac.Batch) -> None:
    """What a reader of batches has in hand: how old it is by its own account, and of when it is."""
    for message in batch.messages:
        if isinstance(message, biotac.Gap):
            say(gap=message.as_text())
    if len(batch.t_us):
        at_s, age_s = time.monotonic(), batch.age_s
        say(at_s=at_s, t_us=int(batch.t_us[-1]), age_s=None if math.isnan(age_s) else age_s)


def pull(hand: biotac.Hand) -> None:
    while not over.is_set():
        say_batch(hand.read_batch(0.02))


def views(hand: biotac.Hand) -> None:
    hand.stream()
    finger = hand[hand.fingers[0]]
    gaps = 0
    while not over.wait(LOOK_S):
        at_s = time.monotonic()
        frame, stats = finger.frame, hand.stats
        if stats.gaps != gaps:
            gaps = stats.gaps
            say(counted=gaps)
        say(at_s=at_s, shown=None if math.isnan(frame.force_n[2]) else frame.t_us, stale=finger.stale)


def callbacks(hand: biotac.Hand) -> None:
    hand.on_batch(say_batch)
    hand.on_gap(lambda gap: say(on_gap=gap.reason))
    hand.stream()
    while not over.wait(LOOK_S):
        hand.check()


def record(hand: biotac.Hand) -> None:
    recorder = hand.record(f"{sys.argv[4]}/live.mcap")
    hand.stream()
    while not over.wait(LOOK_S):
        hand.check()
    recorder.close()
    say(paths=[str(path) for path in recorder.paths], frames=recorder.frames)


def lsl(hand: biotac.Hand) -> None:
    from biotac.bridges.lsl import Outlet

    with Outlet(hand) as outlet:
        push, lsl_now = outlet._outlets[hand.fingers[0], ""].push_chunk, outlet._lsl.local_clock

        def pushed(values: Any, stamps_s: list[float]) -> None:
            say(stamp_age_s=lsl_now() - stamps_s[-1])
            push(values, stamps_s)

        outlet._outlets[hand.fingers[0], ""].push_chunk = pushed  # type: ignore[method-assign]
        for batch in hand.batches():
            outlet.push(batch)
            say_batch(batch)
            if over.is_set():
                return


async def aio(port: str, reconnect: bool) -> None:
    async with biotac.aio.open(port, reconnect=reconnect) as hand:
        async for batch in hand.batches():
            say_batch(batch)
            if over.is_set():
                return


WAYS = {"pull": pull, "views": views, "callbacks": callbacks, "record": record, "lsl": lsl}


def main() -> None:
    """Read until stdin ends or the hand says that it is over."""
    way, port, reconnect = sys.argv[1], sys.argv[2], sys.argv[3] == "yes"
    threading.Thread(target=lambda: (sys.stdin.read(), over.set()), daemon=True).start()
    try:
        if way == "aio":
            asyncio.run(aio(port, reconnect))
        else:
            with biotac.open(port, reconnect=reconnect) as hand:
                say(opened=True)
                WAYS[way](hand)
    except biotac.DeviceLostError as error:
        say(lost=str(error))


main()
