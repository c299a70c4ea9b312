"""The live path against a plain pyserial reader thread: loss, delay from write to callback, CPU.

Both read the same board (flood.py, another process) through the same pty, in alternate rounds. A pty is not USB.
"""

from __future__ import annotations

import multiprocessing
import statistics
import threading
import time
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import biotac
from biotac import Batch
from biotac.wire import DTYPES, encode
from biotac.wire import messages as wire

from ..report import Show, Table
from . import flood
from .contest import check_installed

RATES = (5_000, 50_000)
OURS, PYSERIAL = "biotac, on_batch", "pyserial thread, read(in_waiting or 1)"
ASKED_LOSS = {5_000: 0.0, 50_000: 0.001}
ASKED_LATENCY_US = 100.0
ASKED_CPU = {50_000: 0.6}

#: (finger (n,), seq (n,), arrival in ns)
Arrival = tuple[NDArray[Any], NDArray[Any], int]


@dataclass(frozen=True)
class Round:
    """One reader in one round."""

    loss: float
    median_us: float
    p99_us: float
    cpu_percent: float


class Producer:
    """flood.py in a process, and the pty to it."""

    def __init__(self, rate: int, seconds: float) -> None:
        self.rate, self.seconds, self.frames = rate, seconds, int(rate * seconds)
        context = multiprocessing.get_context("spawn")
        self._pipe, theirs = context.Pipe(duplex=False)
        self._put_ns = context.RawArray("q", -(-self.frames // flood.burst_frames(rate)))
        work = (theirs, rate, self.frames, self._put_ns)
        self._process = context.Process(target=flood.run, args=work, daemon=True)
        self._process.start()
        theirs.close()
        self.path = self.wait()

    def wait(self) -> Any:
        """Wait for the next word: the pty's path when it is ready, None each time all frames are sent."""
        try:
            return self._pipe.recv()
        except EOFError:
            raise RuntimeError(
                "the producer of `biotac-lab bench live` ended early; its own error is on stderr"
            ) from None

    def delays_us(self, arrivals: list[Arrival]) -> NDArray[np.float64]:
        """Delay of every frame that arrived, from the ring to the callback."""
        put_ns = np.frombuffer(self._put_ns, np.int64)
        delays = [
            (when - put_ns[(seq.astype(np.int64) * flood.FINGERS + finger) // flood.burst_frames(self.rate)]) / 1e3
            for finger, seq, when in arrivals
        ]
        return np.concatenate(delays) if delays else np.empty(0)

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.join()
        self._pipe.close()


def ours(path: str, arrivals: list[Arrival], until: Callable[[], None]) -> None:
    """Read with the package, as a user runs it."""
    now_ns = time.monotonic_ns

    def arrived(batch: Batch) -> None:
        arrivals.append((batch.wire["finger"], batch.wire["seq"], now_ns()))

    with biotac.open(path) as hand:
        hand.on_batch(arrived)
        hand.stream()
        until()
        hand.ping()


def pyserial_thread(path: str, arrivals: list[Arrival], until: Callable[[], None]) -> None:
    """Read as one would without this package: pyserial, and per packet C cobs, CRC and a callback."""
    import serial
    from cobs import cobs

    now_ns = time.monotonic_ns
    came: list[tuple[bytes, int]] = []
    over = threading.Event()

    def arrived(payload: bytes) -> None:
        came.append((payload, now_ns()))

    def read(port: serial.Serial) -> None:
        rest = b""
        while not over.is_set():
            *packets, rest = (rest + port.read(port.in_waiting or 1)).split(b"\0")
            for packet in packets:
                plain = cobs.decode(packet)
                if zlib.crc32(plain[:-4]) == int.from_bytes(plain[-4:], "little") and plain[0] == wire.FrameMessage.ID:
                    arrived(plain[1:-4])

    with serial.Serial(path, 115200, timeout=0.1) as port:
        thread = threading.Thread(target=read, args=(port,))
        thread.start()
        port.write(encode(wire.Start.ID, wire.Start(1, 1, 31, 0).pack()))
        until()
        over.set()
        thread.join()
    for payload, when in came:
        row = np.frombuffer(payload, DTYPES[wire.FrameMessage.ID])
        arrivals.append((row["finger"], row["seq"], when))


def one_round(producer: Producer, contestant: Callable[..., None]) -> Round:
    """Let one reader read everything once."""
    arrivals: list[Arrival] = []
    cpu_s, begin = 0.0, time.process_time()

    def until() -> None:
        nonlocal cpu_s
        producer.wait()
        time.sleep(0.05)  # frames are still on their way
        cpu_s = time.process_time() - begin

    contestant(producer.path, arrivals, until)
    delays = producer.delays_us(arrivals)
    if not len(delays):
        return Round(1.0, float("nan"), float("nan"), 0.0)
    median_us, p99_us = np.percentile(delays, (50, 99)).tolist()
    return Round(1 - len(delays) / producer.frames, median_us, p99_us, 100 * cpu_s / producer.seconds)


def measure(
    show: Show = lambda text: None, *, rates: tuple[int, ...] = RATES, rounds: int = 5, seconds: float = 2.0
) -> list[Table]:
    """Time both readers at each rate in alternate rounds after an untimed one. Raises InputError if it cannot run."""
    check_installed("cobs")
    contestants = {OURS: ours, PYSERIAL: pyserial_thread}
    done_rounds: dict[tuple[int, str], list[Round]] = {(rate, name): [] for rate in rates for name in contestants}
    for rate in rates:
        show(f"{rate} frames a second")
        producer = Producer(rate, seconds)
        try:
            for number in range(rounds + 1):
                for name, contestant in contestants.items():
                    done = one_round(producer, contestant)
                    if number:
                        done_rounds[rate, name].append(done)
        finally:
            producer.close()
    return report(done_rounds, seconds)


def report(done_rounds: dict[tuple[int, str], list[Round]], seconds: float) -> list[Table]:
    """Medians over the rounds, but mean and worst loss as shares of the frames offered; then the requirements."""
    rows, asked = [], []
    for (rate, name), rounds in done_rounds.items():
        loss = statistics.fmean(own.loss for own in rounds)
        middle = [statistics.median(getattr(own, k) for own in rounds) for k in ("median_us", "p99_us", "cpu_percent")]
        rows.append([rate, name, 100 * loss, 100 * max(own.loss for own in rounds), *middle])
        if name == OURS:
            pairs = zip(rounds, done_rounds[rate, PYSERIAL], strict=True)
            ratio = statistics.median(a.cpu_percent / b.cpu_percent for a, b in pairs)
            for quantity, seen, most in (
                (f"loss at {rate}/s", loss, ASKED_LOSS.get(rate)),
                (f"us from write to callback at {rate}/s", middle[0], ASKED_LATENCY_US),
                (f"CPU time over pyserial's at {rate}/s", ratio, ASKED_CPU.get(rate)),
            ):
                verdict = "" if most is None else "met" if seen <= most else "NOT met"
                asked.append([quantity, seen, most, verdict])
    head = ["frames/s", "reader", "loss [%]", "worst [%]", "median [us]", "p99 [us]", "CPU [%]"]
    text = f"Rounds of {seconds:g} s in turn, a board with a 16 KiB ring buffer on a pty."
    return [Table("Live path", head, rows, text), Table("Asked", ["", "seen", "at most", ""], asked)]
