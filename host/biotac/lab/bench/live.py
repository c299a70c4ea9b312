"""The live path against a plain pyserial reader thread: loss, delay from write to callback, CPU. `biotac bench live`.

Both read the same board (flood.py, another process) through the same pty, in alternate rounds. A pty is not USB.
"""

from __future__ import annotations

import os
import pty
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import tty
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...errors import InputError
from ...hand.hand import Hand
from ...link.serial_port import SerialLink
from ...wire import messages_gen as wire
from ...wire.batches import Batch
from ...wire.dtypes_gen import DTYPES
from ...wire.framing import encode
from . import flood

RATES = (5_000, 50_000)
OURS, PYSERIAL = "reading thread + callback", "pyserial thread, read(in_waiting or 1)"
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


@dataclass(frozen=True)
class Row:
    """One reader at one rate: medians over the rounds, but mean and worst loss, as shares of the frames offered."""

    rate: int
    name: str
    loss: float
    worst_loss: float
    median_us: float
    p99_us: float
    cpu_percent: float


@dataclass(frozen=True)
class Outcome:
    """All rows, and by rate our CPU time over pyserial's: the median of the rounds' ratios."""

    rows: list[Row]
    cpu_ratio: dict[int, float]
    rounds: int
    seconds: float


@dataclass(frozen=True)
class Asked:
    """A figure, and whether it meets its requirement."""

    what: str
    seen: str
    wanted: str
    met: bool


class Producer:
    """flood.py in a process, and the pty to it."""

    def __init__(self, rate: int, seconds: float, folder: Path) -> None:
        self.rate = rate
        self.seconds = seconds
        self.frames = int(rate * seconds)
        self._times = folder / f"times{rate}"
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)
        self.path = os.ttyname(self._slave)
        words = [str(word) for word in (self._master, rate, self.frames, self._times)]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "biotac.lab.bench.flood", *words], stdout=subprocess.PIPE, pass_fds=[self._master]
        )
        self.wait()

    def wait(self) -> None:
        """Wait for its next line: it writes one when ready, and one each time all frames are sent."""
        assert self._process.stdout is not None
        if not self._process.stdout.readline():
            raise RuntimeError("the producer of `biotac bench live` ended early; its own error is on stderr")

    def delays_us(self, arrivals: list[Arrival]) -> NDArray[np.float64]:
        """Delay of every frame that arrived, from the ring to the callback."""
        put_ns = np.fromfile(self._times, np.int64)
        delays = [
            (when - put_ns[(seq.astype(np.int64) * flood.FINGERS + finger) // flood.burst_frames(self.rate)]) / 1e3
            for finger, seq, when in arrivals
        ]
        return np.concatenate(delays) if delays else np.empty(0)

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()
        assert self._process.stdout is not None
        self._process.stdout.close()
        os.close(self._master)
        os.close(self._slave)


def ours(path: str, arrivals: list[Arrival], until: Callable[[], None]) -> None:
    """Read with the package, as a user runs it."""
    now_ns = time.monotonic_ns

    def arrived(batch: Batch) -> None:
        arrivals.append((batch.wire["finger"], batch.wire["seq"], now_ns()))

    with Hand(SerialLink(path)) as hand:
        hand.on_batch(arrived)
        hand.run()
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
                if zlib.crc32(plain[:-4]) == int.from_bytes(plain[-4:], "little") and plain[0] == wire.Frame.ID:
                    arrived(plain[1:-4])

    with serial.Serial(path, 115200, timeout=0.1) as port:
        thread = threading.Thread(target=read, args=(port,))
        thread.start()
        port.write(encode(wire.Start.ID, wire.Start(1, 1, 31, 0).pack()))
        until()
        over.set()
        thread.join()
    for payload, when in came:
        row = np.frombuffer(payload, DTYPES[wire.Frame.ID])
        arrivals.append((row["finger"], row["seq"], when))


def one_round(producer: Producer, contestant: Callable[..., None]) -> Round:
    """Let one reader read everything once."""
    arrivals: list[Arrival] = []
    cpu_s, begin = 0.0, time.process_time()

    def until() -> None:
        nonlocal cpu_s
        producer.wait()
        time.sleep(0.05)  # the rest is still on its way
        cpu_s = time.process_time() - begin

    contestant(producer.path, arrivals, until)
    delays = producer.delays_us(arrivals)
    if not len(delays):
        return Round(1.0, float("nan"), float("nan"), 0.0)
    median_us, p99_us = np.percentile(delays, (50, 99)).tolist()
    return Round(1 - len(delays) / producer.frames, median_us, p99_us, 100 * cpu_s / producer.seconds)


def measure(*, rates: tuple[int, ...] = RATES, rounds: int = 5, seconds: float = 2.0) -> Outcome:
    """Time both readers at each rate in alternate rounds after an untimed one. Raises InputError if it cannot run."""
    if os.name != "posix":
        raise InputError("bench live needs a pty, which this system lacks; use Linux or macOS")
    try:
        import cobs  # noqa: F401
    except ImportError:
        raise InputError("bench live needs cobs for the pyserial reader; pip install 'biotac-gateway[bench]'") from None
    contestants = {OURS: ours, PYSERIAL: pyserial_thread}
    rows, ratios = [], {}
    with tempfile.TemporaryDirectory(prefix="biotac-bench-") as folder:
        for rate in rates:
            producer = Producer(rate, seconds, Path(folder))
            try:
                taken: dict[str, list[Round]] = {name: [] for name in contestants}
                for number in range(rounds + 1):
                    for name, contestant in contestants.items():
                        done = one_round(producer, contestant)
                        if number:
                            taken[name].append(done)
            finally:
                producer.close()
            rows += [row_of(rate, name, taken[name]) for name in contestants]
            pairs = zip(taken[OURS], taken[PYSERIAL], strict=True)
            ratios[rate] = statistics.median(a.cpu_percent / b.cpu_percent for a, b in pairs)
    return Outcome(rows, ratios, rounds, seconds)


def row_of(rate: int, name: str, taken: list[Round]) -> Row:
    """Medians over the rounds; the loss is their mean."""
    middle = {k: statistics.median(getattr(r, k) for r in taken) for k in ("median_us", "p99_us", "cpu_percent")}
    losses = [r.loss for r in taken]
    return Row(rate, name, statistics.fmean(losses), max(losses), **middle)


def asked(outcome: Outcome) -> list[Asked]:
    """The requirements on this package's reader, and what it did."""
    out = []
    for row in (row for row in outcome.rows if row.name == OURS):
        at = f"at {row.rate}/s"
        if row.rate in ASKED_LOSS:
            most = ASKED_LOSS[row.rate]
            out.append(Asked(f"loss {at}", f"{row.loss:.4%}", f"<= {most:.1%}", row.loss <= most))
        seen = f"{row.median_us:.0f} us"
        out.append(
            Asked(f"write to callback {at}", seen, f"< {ASKED_LATENCY_US:.0f} us", row.median_us < ASKED_LATENCY_US)
        )
        if row.rate in ASKED_CPU:
            ratio, most = outcome.cpu_ratio[row.rate], ASKED_CPU[row.rate]
            out.append(Asked(f"CPU time over pyserial's {at}", f"{ratio:.2f}x", f"<= {most}x", ratio <= most))
    return out
