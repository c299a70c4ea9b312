"""Recordings in one run: size, and load time against one protobuf message per frame.

Loading is from a file in the page cache to NumPy arrays, and the arrays are checked; times are medians of CPU time
over interleaved rounds.
"""

from __future__ import annotations

import tempfile
from pathlib import Path
from time import process_time_ns
from typing import Any

import numpy as np

import biotac
from biotac import Recording

from ..report import Show, Table
from .contest import Contestant, check_installed, judge, timed

ROUNDS = 3
MB = 1e6
FINGERS, SECONDS = 5, 600
ASKED_MCAP_MB = 40.0  # for that
OURS, PROTOBUF, ALL, FORCE = "MCAP wire", "protobuf", "all frames", "one finger's force"


def measure(
    show: Show = lambda text: None, fingers: int = FINGERS, seconds: float = SECONDS, rounds: int = ROUNDS
) -> list[Table]:
    """Record simulated fingers, PAC included, and measure the recording. Raises InputError without the extra."""
    check_installed("mcap_protobuf", "google.protobuf")
    from .protobuf_mcap import ProtobufMcap

    with tempfile.TemporaryDirectory(prefix="biotac-bench-") as folder:
        mcap, protobuf = (Path(folder) / name for name in ("a.mcap", "protobuf.mcap"))
        show("recording")
        with biotac.open(f"sim:press.toml?fingers={fingers}&seconds={seconds}") as hand:
            hand.record(mcap)
            for _ in hand.batches():
                pass
        show("writing protobuf messages")
        content = rows_of(mcap)
        other = ProtobufMcap(protobuf, content)
        check_same(other.load(), content, PROTOBUF)
        show("loading")
        contestants = [
            Contestant(OURS, 1, lambda: rows_of(mcap)),
            Contestant(PROTOBUF, 1, other.load),
            Contestant(ALL, 1, lambda: biotac.load(mcap)),
            Contestant(FORCE, 1, lambda: biotac.load(mcap, fields=["t_us", "force_n"], fingers=[0])),
        ]
        times = timed(contestants, rounds, process_time_ns)
        size_mb = mcap.stat().st_size / MB
        verdict = judge(ASKED_MCAP_MB, size_mb) if (fingers, seconds) == (FINGERS, SECONDS) else ""
        sizes = [["MCAP", size_mb, verdict], ["MCAP with protobuf messages", protobuf.stat().st_size / MB, ""]]
    rows = [[name, time_ns / 1e9] for name, time_ns in times.items()]
    rows += [["protobuf / MCAP wire", times[PROTOBUF] / times[OURS]], ["force / all frames", times[FORCE] / times[ALL]]]
    return [
        Table(f"press.toml, {fingers} finger(s), {seconds:g} s", ["", "MB", ""], sizes, digits=2),
        Table("Load to NumPy", ["", "CPU s, or times"], rows),
    ]


def rows_of(mcap: Path) -> dict[str, Any]:
    """The rows of a recording by kind of message."""
    recording = Recording(mcap)
    return {"frames": recording.wire, "pac": recording.pac, "idle": recording.idle}


def check_same(got: Any, expected: dict[str, Any], name: str) -> None:
    """Raises AssertionError if a reader gives other arrays: it is no contestant."""
    for kind, rows in expected.items():
        for field in rows.dtype.names:
            if not np.array_equal(got[kind][field], rows[field]):
                raise AssertionError(f"{name}: {kind}/{field} differs")
