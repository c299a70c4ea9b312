"""A user's program that uses the public names; test_program.py has mypy and pyright look at it."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

import biotac


def touched(touch: biotac.Touch) -> None:
    index: int = touch.finger
    print(index, touch.t_us)


def tared(tare: biotac.Tare) -> None:
    reason = biotac.TareReason(tare.reason)
    print(reason.name)


def counted(status: biotac.Status) -> None:
    dropped: int = status.messages_dropped
    print(dropped)


def arrived(batch: biotac.Batch) -> None:
    seq: NDArray[np.int64] = batch.seq
    forces = batch.frames["force_n"]
    print(seq, forces)


def main(port: str | None = None) -> float:
    with biotac.open(port, reconnect=True, fingers={"index": 0, "thumb": 4}) as hand:
        unsubscribe = hand.on_batch(arrived)
        hand.on_touch(touched)
        hand.on_tare(tared)
        hand.on_status(counted)
        hand.want("force", "touch", rest=False)
        hand.tare("index")
        hand.subscribe(biotac.QuantityFlags.FORCE, fingers=["index", 4])
        with hand.grasp("index", "thumb"):
            hand.run(queue=True)
            frames = hand.read(0.1, fresh=True)
        names: list[str] = list(hand)
        finger: biotac.FingerView = hand[frames["finger"][0]]
        force_n: NDArray[np.float64] = finger.force_n
        frame: biotac.Frame = finger.frame
        same: bool = frame == finger.frame
        solve = biotac.per_frame(np.full(19, 2000.0), {biotac.Setting.FORCE_GAIN_Z_NN: 1_000_000})
        result = solve(frame.counts)
        status: biotac.Status = hand.status()
        stats: biotac.LinkStats = hand.stats
        unsubscribe()
    print(names, force_n, same, result["force_n"], status.uptime_s, stats.frames_lost)
    return finger.age_s


async def looped(port: str) -> int:
    frames = 0
    async with biotac.aio.open(port) as hand:
        async for batch in hand.batches():
            frames += len(batch.wire)
        status: biotac.Status = await hand.ask(lambda h: h.status())
    return frames + status.slots_late
