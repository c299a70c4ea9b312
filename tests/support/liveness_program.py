"""A program that reads a hand in one of the ways there are, and prints each value as a JSON line.

python liveness_program.py WAY PORT RECONNECT FOLDER PATIENCE; it ends with the end of stdin.
"""

import asyncio
import json
import math
import os
import sys
import threading
import time
from contextlib import closing, suppress
from dataclasses import asdict
from pathlib import Path
from typing import Any
from urllib.request import urlopen

import biotac
from biotac.link.serial_port import SerialLink

LOOK_S = 0.01
over = threading.Event()


def report(**facts: Any) -> None:
    """One observation, at the time of this computer that all processes share; whole, whichever thread tells it."""
    os.write(1, (json.dumps({"at_s": time.monotonic()} | facts) + "\n").encode())


def report_gaps(batch: biotac.Batch) -> None:
    """The gaps that a batch tells."""
    for message in batch.messages:
        if isinstance(message, biotac.Gap):
            report(gap=asdict(message))


def report_batch(batch: biotac.Batch) -> None:
    """A batch in a reader's hand: how old it is by its own account, and of which time it is."""
    report_gaps(batch)
    if len(batch.t_us):
        at_s, age_s = time.monotonic(), batch.age_s
        report(at_s=at_s, t_us=int(batch.t_us[-1]), age_s=None if math.isnan(age_s) else age_s)


def pull(hand: biotac.Hand) -> None:
    while not over.is_set():
        report_batch(hand.read_batch(0.02))


def views(hand: biotac.Hand) -> None:
    hand.stream()
    finger = hand[hand.fingers[-1]]
    gaps = 0
    while not over.wait(LOOK_S):
        at_s = time.monotonic()
        frame, stats = finger.frame, hand.stats
        if stats.gaps != gaps:
            gaps = stats.gaps
            report(counted=gaps)
        shown = None if math.isnan(frame.force_n[2]) else frame.t_us
        report(at_s=at_s, shown=shown, stale=finger.stale, uncertain_s=hand.clock.now().uncertainty_s)


def callbacks(hand: biotac.Hand) -> None:
    hand.on_batch(report_batch)
    hand.on_gap(lambda gap: report(on_gap=gap.reason))
    hand.stream()
    while not over.wait(LOOK_S):
        hand.check()


def record(hand: biotac.Hand) -> None:
    recorder = hand.record(f"{sys.argv[4]}/live.mcap")
    hand.on_batch(report_batch)  # after the recorder has it
    hand.stream()
    while not over.wait(LOOK_S):
        hand.check()
    recorder.close()
    report(paths=[str(path) for path in recorder.paths], frames=recorder.frames)


def lsl(hand: biotac.Hand) -> None:
    import pylsl

    from biotac.extras.lsl import Outlet

    class Told(pylsl.StreamOutlet):  # type: ignore[misc]
        def __init__(self, info: Any) -> None:
            super().__init__(info)
            self.is_first = info.name().endswith(f" finger{hand.fingers[0]}")

        def push_chunk(self, values: Any, stamps_s: list[float]) -> None:
            if self.is_first:
                report(stamp_age_s=pylsl.local_clock() - stamps_s[-1])
            super().push_chunk(values, stamps_s)

    pylsl.StreamOutlet = Told
    with Outlet(hand) as outlet:
        for batch in hand.batches():
            outlet.push(batch)
            report_batch(batch)
            if over.is_set():
                return


async def aio(port: str, reconnect: bool) -> None:
    async with biotac.aio.open(port, reconnect=reconnect) as hand:
        async for batch in hand.batches():
            report_batch(batch)
            if over.is_set():
                return


def page(port: str) -> None:
    """The live page's own source of news; a browser is not needed to see them."""
    from biotac.view.rows import FRAME_ROW
    from biotac.view.serving import Viewing

    def follow(url: str) -> None:
        lost = False
        for line in urlopen(f"{url}events"):
            if not line.startswith(b'data: {"frames"'):
                continue
            news = json.loads(line.removeprefix(b"data: "))
            health = news["health"] or {"link": "live", "events": []}
            if news["frames"] and not lost:
                report(t_us=news["frames"][-1][FRAME_ROW.index("t_us")], age_s=None)
            for _ in (event for event in health["events"] if event["name"] == "gap"):
                report(marked=True)
            if health["link"] in ("lost", "taken") and not lost:
                lost = True
                report(lost=health["words"])

    with closing(Viewing(port, folder=Path(sys.argv[4]))) as viewing:
        threading.Thread(target=follow, args=(viewing.server.url,), daemon=True).start()
        over.wait()


def ros(port: str) -> None:
    import rclpy
    from biotac_ros2.node import Fingers, spin

    rclpy.init(args=["--ros-args", "-p", f"port:={port}"])
    node = Fingers()
    publish_row, publish, clock = node._publish, node.publish, node.get_clock()

    def published(row: Any, stamp_ns: int) -> None:
        report(t_us=int(row["t_us"]), age_s=(clock.now().nanoseconds - stamp_ns) * 1e-9)
        publish_row(row, stamp_ns)

    def published_all(batch: biotac.Batch) -> None:
        report_gaps(batch)
        publish(batch)
        if over.is_set():
            raise KeyboardInterrupt

    node._publish, node.publish = published, published_all
    with suppress(KeyboardInterrupt), node.hand:
        spin(node)


WAYS = {"pull": pull, "views": views, "callbacks": callbacks, "record": record, "lsl": lsl}
OWN_HAND_WAYS = {"page": page, "ros": ros}


def main() -> None:
    """Read until stdin or the hand ends."""
    way, port, reconnect = sys.argv[1], sys.argv[2], sys.argv[3] == "yes"
    SerialLink.patience = float(sys.argv[5])  # some of the ways open the port themselves
    threading.Thread(target=lambda: (sys.stdin.read(), over.set()), daemon=True).start()
    try:
        if way == "aio":
            asyncio.run(aio(port, reconnect))
        elif way in OWN_HAND_WAYS:
            OWN_HAND_WAYS[way](port)
        else:
            with biotac.open(port, reconnect=reconnect) as hand:
                report(opened=True)
                WAYS[way](hand)
    except biotac.DeviceLostError as error:
        report(lost=str(error))


main()
