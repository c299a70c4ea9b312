"""Recordings in one run: their size, its distance from their entropy, and load time.

The entropy floor is of order 0: for each column of each finger the smaller entropy of its values and of the
differences between neighbours, without the cost of any model; PAC is one signal of 2200 Hz. Loading is from a file in
the page cache to NumPy arrays, whose content is checked; times are medians of CPU time over interleaved rounds.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import biotac

from ...errors import InputError
from ...recording.reader import Recording
from .columns import check_same, columns_of, floor_bits

ROUNDS = 3
MB = 1e6
ASKED_MCAP_MB = 40.0
PARTS = ("wire", "plots", "index and headers")
ALL, FORCE = "all frames", "one finger's force"


@dataclass(frozen=True)
class Outcome:
    """Bytes and CPU seconds; ``load_s`` holds medians by reader."""

    source: str
    fingers: int
    seconds: float
    frames: int
    wire_bytes: int
    mcap_bytes: int
    mcap_parts: dict[str, int]
    protobuf_bytes: int
    floor_bytes: float
    load_s: dict[str, float]

    @property
    def part(self) -> float:
        """CPU time to load one finger's force over that of all frames."""
        return self.load_s[FORCE] / self.load_s[ALL]

    @property
    def faster(self) -> float:
        """CPU time to load protobuf messages over that to load the wire."""
        return self.load_s["protobuf"] / self.load_s["MCAP wire"]


def measure(source: str, *, fingers: int, seconds: float, show: Callable[[str], None] = lambda text: None) -> Outcome:
    """Record ``source`` on ``fingers`` simulated fingers, PAC included, and measure the recording.

    Raises InputError without the extra ``bench``.
    """
    try:
        from . import protobuf_mcap
    except ImportError as error:
        name = "protobuf" if (error.name or "").partition(".")[0] == "google" else error.name  # as pip calls it
        raise InputError(f"{name} is not installed; pip install 'biotac-gateway[bench]'") from error
    with tempfile.TemporaryDirectory(prefix="biotac-bench-") as folder:
        mcap, protobuf = (Path(folder) / name for name in ("a.mcap", "protobuf.mcap"))
        show("recording")
        with biotac.open(f"sim:{source}?fingers={fingers}&seconds={seconds}") as hand:
            hand.record(mcap)
            for _ in hand.batches():
                pass
        recording = Recording(mcap)
        content = columns_of(recording)
        show("writing protobuf messages")
        protobuf_mcap.write(protobuf, content)
        loaders: dict[str, Callable[[], Any]] = {
            "MCAP wire": lambda: columns_of(Recording(mcap)),
            "protobuf": lambda: protobuf_mcap.load(protobuf),
        }
        for name, load in loaders.items():
            show(f"checking {name}")
            check_same(load(), content, name)
        loaders[ALL] = lambda: biotac.load(mcap)
        loaders[FORCE] = lambda: biotac.load(mcap, fields=["t_us", "force_n"], fingers=[0])
        show("loading")
        return Outcome(
            source=source,
            fingers=fingers,
            seconds=(recording.end_us - recording.begin_us) / 1e6,
            frames=len(recording.frames),
            wire_bytes=sum(map(len, recording.blocks)),
            mcap_bytes=mcap.stat().st_size,
            mcap_parts=mcap_parts(mcap),
            protobuf_bytes=protobuf.stat().st_size,
            floor_bytes=floor_bits(content) / 8,
            load_s=time_all(loaders, show),
        )


def time_all(loaders: dict[str, Callable[[], Any]], show: Callable[[str], None]) -> dict[str, float]:
    """Median CPU seconds of each; each has run before."""
    taken: dict[str, list[float]] = {name: [] for name in loaders}
    for k in range(ROUNDS):
        for name, load in loaders.items():
            show(f"loading, round {k + 1} of {ROUNDS}: {name}")
            begin_s = time.process_time()
            load()
            taken[name].append(time.process_time() - begin_s)
    return {name: statistics.median(times) for name, times in taken.items()}


def mcap_parts(path: Path) -> dict[str, int]:
    """Bytes of the chunks with wire messages, of those for plotting, and of the rest."""
    from mcap.records import Channel, Chunk, Message
    from mcap.stream_reader import StreamReader, breakup_chunk

    from ...recording.layout import PACKETS, TABLE

    topics: dict[int, str] = {}
    sizes = dict.fromkeys(PARTS, 0)
    with path.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, Chunk):
                inner = breakup_chunk(record)
                topics |= {r.id: r.topic for r in inner if isinstance(r, Channel)}
                first = next(r for r in inner if isinstance(r, Message))
                topic = topics[first.channel_id]
                sizes["wire" if topic == PACKETS or topic.startswith(TABLE) else "plots"] += len(record.data)
    sizes["index and headers"] = path.stat().st_size - sizes["wire"] - sizes["plots"]
    return sizes
