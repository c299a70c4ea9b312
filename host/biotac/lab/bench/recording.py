"""Recordings: how large, how near to their entropy, how quick to load, all in one run.

The entropy floor is of order 0: for each column of each finger the smaller of the entropies of its values
and of the differences of neighbours, without any model's own cost; PAC is one signal of 2200 Hz. Loading is
from a file in the page cache to NumPy arrays of the same content, which is checked; CPU times, interleaved
rounds, medians.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

import biotac

from ...errors import InputError
from ...recording.compact import KINDS, Compact, compact, entropy_bits, load_compact, series, write_compact
from ...recording.reader import Recording

ROUNDS = 3
MB = 1e6
ASKED_MCAP_MB = 40.0
ASKED_OF_FLOOR = 1.25
ASKED_LOAD = 10.0
PARTS = ("wire", "plots", "index and headers")


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
    compact_bytes: int
    floor_bytes: float
    load_s: dict[str, float]

    @property
    def of_floor(self) -> float:
        """Size of the compact form over its entropy floor."""
        return self.compact_bytes / self.floor_bytes

    @property
    def faster(self) -> float:
        """CPU time to load protobuf messages over that to load the compact form."""
        return self.load_s["protobuf"] / self.load_s["compact"]


def measure(source: str, *, fingers: int, seconds: float, show: Callable[[str], None] = lambda text: None) -> Outcome:
    """Record ``source`` on ``fingers`` simulated fingers, PAC included, and measure what comes of it.

    Raises InputError without the extra ``bench``.
    """
    try:
        from . import protobuf_mcap
    except ImportError as error:
        raise InputError(f"{error.name} is not installed; pip install 'biotac-gateway[bench]'") from error
    with tempfile.TemporaryDirectory(prefix="biotac-bench-") as folder:
        mcap, protobuf, small = (Path(folder) / name for name in ("a.mcap", "protobuf.mcap", "a.btc"))
        show("recording")
        with biotac.open(f"sim:{source}?fingers={fingers}&seconds={seconds}") as hand:
            hand.record(mcap)
            for _ in hand.batches():
                pass
        recording = Recording(mcap)
        content = compact(recording)
        show("writing the compact form")
        write_compact(small, content)
        show("writing protobuf messages")
        protobuf_mcap.write(protobuf, content)
        loaders: dict[str, Callable[[], Any]] = {
            "compact": lambda: load_compact(small),
            "MCAP wire": lambda: compact(Recording(mcap)),
            "protobuf": lambda: protobuf_mcap.load(protobuf),
        }
        for name, load in loaders.items():
            show(f"checking {name}")
            check_same(load(), content, name)
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
            compact_bytes=small.stat().st_size,
            floor_bytes=floor_bits(content) / 8,
            load_s=time_all(loaders, show),
        )


def time_all(loaders: dict[str, Callable[[], Any]], show: Callable[[str], None]) -> dict[str, float]:
    """Median CPU seconds of each; every one has been run before."""
    taken: dict[str, list[float]] = {name: [] for name in loaders}
    for k in range(ROUNDS):
        for name, load in loaders.items():
            show(f"loading, round {k + 1} of {ROUNDS}: {name}")
            begin_s = time.process_time()
            load()
            taken[name].append(time.process_time() - begin_s)
    return {name: statistics.median(times) for name, times in taken.items()}


def floor_bits(content: Compact) -> float:
    """Order-0 entropy of all columns, each as values or as differences."""
    bits = 0.0
    for kind in KINDS:
        for fields in getattr(content, kind).values():
            for name, values in fields.items():
                columns = series(kind, name, values)
                bits += sum(min(entropy_bits(c), entropy_bits(np.diff(c))) for c in columns if len(c) > 1)
    return bits


def check_same(got: Compact, expected: Compact, name: str) -> None:
    """A reader that gives other arrays is no contestant."""
    for kind in KINDS:
        for finger, fields in getattr(expected, kind).items():
            for column, values in fields.items():
                if not np.array_equal(getattr(got, kind)[finger][column], values):
                    raise AssertionError(f"{name}: finger {finger} {kind}/{column} differs")


def mcap_parts(path: Path) -> dict[str, int]:
    """Bytes of the wire's chunks, of those for plotting, and of the rest."""
    from mcap.records import Channel, Chunk, Message
    from mcap.stream_reader import StreamReader, breakup_chunk

    from ...recording.layout import TOPIC

    topics: dict[int, str] = {}
    sizes = dict.fromkeys(PARTS, 0)
    with path.open("rb") as stream:
        for record in StreamReader(stream, emit_chunks=True).records:
            if isinstance(record, Chunk):
                inner = breakup_chunk(record)
                topics |= {r.id: r.topic for r in inner if isinstance(r, Channel)}
                first = next(r for r in inner if isinstance(r, Message))
                sizes["wire" if topics[first.channel_id] == TOPIC else "plots"] += len(record.data)
    sizes["index and headers"] = path.stat().st_size - sizes["wire"] - sizes["plots"]
    return sizes
