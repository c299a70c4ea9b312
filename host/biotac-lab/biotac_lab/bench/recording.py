"""Recordings in one run: size, and load time against one protobuf message per frame.

Loading is from a file in the page cache to NumPy arrays, whose content is checked; times are medians of CPU time over
interleaved rounds.
"""

from __future__ import annotations

import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

import biotac
from biotac import InputError, Recording

from ..report import Show, Table
from .contest import judge

ROUNDS = 3
MB = 1e6
ASKED_MCAP_MB = 40.0  # for ten minutes of five fingers
OURS, PROTOBUF, ALL, FORCE = "MCAP wire", "protobuf", "all frames", "one finger's force"


def measure(
    source: str = "press.toml", fingers: int = 5, seconds: float = 600.0, show: Show = lambda text: None
) -> list[Table]:
    """Record ``source`` on ``fingers`` simulated fingers, PAC included, and measure the recording.

    Raises InputError without the extra ``bench``.
    """
    try:
        from . import protobuf_mcap
    except ImportError as error:
        name = "protobuf" if (error.name or "").partition(".")[0] == "google" else error.name  # as pip calls it
        raise InputError(f"{name} is not installed; pip install 'biotac-lab[bench]'") from error
    with tempfile.TemporaryDirectory(prefix="biotac-bench-") as folder:
        mcap, protobuf = (Path(folder) / name for name in ("a.mcap", "protobuf.mcap"))
        show("recording")
        with biotac.open(f"sim:{source}?fingers={fingers}&seconds={seconds}") as hand:
            hand.record(mcap)
            for _ in hand.batches():
                pass
        content = protobuf_mcap.columns_of(Recording(mcap))
        show("writing protobuf messages")
        protobuf_mcap.write(protobuf, content)
        loaders: dict[str, Callable[[], Any]] = {
            OURS: lambda: protobuf_mcap.columns_of(Recording(mcap)),
            PROTOBUF: lambda: protobuf_mcap.load(protobuf),
        }
        for name, load in loaders.items():
            show(f"checking {name}")
            check_same(load(), content, name)
        loaders[ALL] = lambda: biotac.load(mcap)
        loaders[FORCE] = lambda: biotac.load(mcap, fields=["t_us", "force_n"], fingers=[0])
        times = load_times_s(loaders, show)
        size_mb, whole = mcap.stat().st_size / MB, (fingers, round(seconds)) == (5, 600)
        verdict = judge(ASKED_MCAP_MB, size_mb) if whole else ""
        sizes = [["MCAP", size_mb, verdict], ["MCAP with protobuf messages", protobuf.stat().st_size / MB, ""]]
    rows = [[name, time_s] for name, time_s in times.items()]
    rows += [["protobuf / MCAP wire", times[PROTOBUF] / times[OURS]], ["force / all frames", times[FORCE] / times[ALL]]]
    return [
        Table(f"{source}, {fingers} finger(s), {seconds:g} s", ["", "MB", ""], sizes, digits=2),
        Table("Load to NumPy", ["", "CPU s, or times"], rows),
    ]


def load_times_s(loaders: dict[str, Callable[[], Any]], show: Show) -> dict[str, float]:
    """Median CPU seconds of each; each has run before."""
    times_s: dict[str, list[float]] = {name: [] for name in loaders}
    for k in range(ROUNDS):
        for name, load in loaders.items():
            show(f"loading, round {k + 1} of {ROUNDS}: {name}")
            begin_s = time.process_time()
            load()
            times_s[name].append(time.process_time() - begin_s)
    return {name: statistics.median(times) for name, times in times_s.items()}


def check_same(got: Any, expected: Any, name: str) -> None:
    """Raises AssertionError if a reader gives other arrays: it is no contestant."""
    for (kind, finger), fields in expected.items():
        for column, values in fields.items():
            if not np.array_equal(got[kind, finger][column], values):
                raise AssertionError(f"{name}: finger {finger} {kind}/{column} differs")
