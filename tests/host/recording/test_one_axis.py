"""A mark, a gap, a stalled disk and a restart lie on one time axis, in the recording and in all files made of it."""

import csv
import os
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy
from capture import Capture
from mcap.reader import make_reader

import biotac
from biotac.cli.main import main
from biotac.hand.record import Recorder

SCENARIO = """
name = "rest"
seed = 3
[[finger]]
profile = "new"
[[step]]
do = "rest"
seconds = 30.0
[[fault]]
kind = "stuck_low"
finger = 0
at_s = 4.0
seconds = 2.0
"""
WRAP_S = 2**32 / 1e6


def recorded(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, port: str, before_s: float) -> list[Path]:
    """A mark before the first row, a finger that falls silent, a disk that stalls, a restart, a mark after it."""
    monkeypatch.setattr(Recorder, "is_full", lambda self: False)  # a board that waits for the reader has no stall
    free, full = threading.Event(), threading.Event()
    fstat, sent = os.fstat, Capture()

    def slow(fd: int) -> os.stat_result:
        """A recorder asks for this before it writes."""
        if full.is_set() and threading.current_thread() is not threading.main_thread():
            assert free.wait(600)
        return fstat(fd)

    monkeypatch.setattr(os, "fstat", slow)
    with biotac.open(port, reconnect=True) as hand:
        if before_s:
            for batch in hand.batches():
                if (batch.last_t_us() or 0) > before_s * 1e6:
                    break
        with hand.record(tmp_path / "a.mcap", note="glass") as recorder:
            hand.mark("start", subject="S07")
            hand.read_batch(2.0)
            with hand.mark("span"):
                hand.read_batch(6.0)
            with monkeypatch.context() as patch:
                patch.setattr("biotac.hand.record.LIMIT_BYTES", 50_000)  # a minute of rows takes long
                full.set()
                hand.add(sent)
                while len(sent.sent) < 100_000:
                    hand.read_batch(0.5)
                hand.remove(sent)
                hand.read_batch(3.0)
            full.clear()
            free.set()
            with hand.mark("over it"):
                hand.read_batch(0.5)
                hand.board.restart()
                hand.mark("again")
                while not [m for m in hand.read_batch(0.5).messages if getattr(m, "reason", "") == "rebooted"]:
                    pass
                hand.read_batch(2.0)
            return recorder.paths


def watched(savefig: Any, limits: list[tuple[float, float]]):
    def kept(figure: Any, *to: Any, **how: Any) -> None:
        limits.append(figure.axes[0].get_xlim())
        savefig(figure, *to, **how)

    return kept


def check(path: Path, reasons: set[str], marks: set[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    recording = biotac.Recording(path)
    assert not recording.damage, recording.damage
    begin_us, end_us = recording.begin_us, recording.end_us
    t_us = recording.frames["t_us"]
    assert {gap.reason for gap in recording.gaps} - {"finger"} == reasons - {"finger"}
    ends_us = {gap.next_t_us for gap in recording.gaps}
    assert ends_us <= set(t_us.tolist())
    for gap in recording.gaps:
        assert gap.reason == "rebooted" or (gap.last_t_us in t_us.tolist() and gap.seconds < 25.0)
        assert gap.frames_missed or gap.reason == "rebooted"
        assert gap.back_at_ns >= gap.lost_at_ns > 0
    assert max(gap.seconds for gap in recording.gaps) > 1.0 or reasons == {"rebooted"}
    for label in recording.labels:
        assert label.t_us is None or begin_us <= label.t_us <= (label.end_us or end_us) <= end_us

    def holds(texts: list[str], gap_s: np.ndarray, where: str) -> None:
        assert {part.split()[0] for text in texts for part in text.split("; ") if part} == {"glass", *marks}, where
        assert (np.asarray(gap_s, float) > 0).sum() >= len(ends_us), where

    table = recording.to_pandas()
    holds(list(table["label"]), table["gap_s"], "pandas")
    holds(list(recording.select().resample(5.0).label), recording.select().resample(5.0).gap_s, "resampled")
    cube = recording.to_xarray()
    holds([*cube["label"].values.ravel()], cube["gap_s"].values.ravel(), "xarray")
    for suffix in (".csv", ".parquet", ".mat", ".ros2", ".png"):
        out = tmp_path / f"{path.name}{suffix}"
        pictures: list[tuple[float, float]] = []
        if suffix == ".png":
            from matplotlib.figure import Figure  # as only the picture does

            monkeypatch.setattr(Figure, "savefig", watched(Figure.savefig, pictures))
        assert main(["export", str(path), str(out)]) == 0
        if suffix == ".csv":
            with out.open() as file:
                rows = list(csv.DictReader(file))
            holds([row["label"] for row in rows], [row["gap_s"] for row in rows], suffix)
        elif suffix == ".parquet":
            import pandas

            frame = pandas.read_parquet(out)
            holds(list(frame["label"]), frame["gap_s"], suffix)
        elif suffix == ".mat":
            file = scipy.io.loadmat(out, simplify_cells=True)
            fingers = [f["frames"] for name, f in file.items() if name.startswith("finger")]
            texts = [text for f in fingers for text in f["label"] if isinstance(text, str)]
            holds(texts, np.concatenate([f["gap_s"] for f in fingers]), suffix)
        elif suffix == ".png":
            ((left, right),) = pictures
            length_s = (end_us - begin_us) / 1e6
            assert -0.1 * length_s < left < right < 1.1 * length_s
    with next((tmp_path / f"{path.name}.ros2").glob("*.mcap")).open("rb") as stream:
        found = [(c.topic, m.log_time) for _, c, m in make_reader(stream).iter_messages(log_time_order=False)]
    logs = [ns for topic, ns in found if topic == "/biotac/log"]
    rows_ns = [ns for topic, ns in found if topic.endswith("wrench")]
    assert len(logs) >= len(recording.gaps) + len(recording.labels)
    assert min(rows_ns) - 1e9 < min(logs) <= max(logs) < max(rows_ns) + 1e9 and min(ns for _, ns in found) > 1e18


@pytest.mark.filterwarnings("ignore::biotac.ReadWarning")
@pytest.mark.parametrize(
    "clock_s", [WRAP_S - 10.0, *(pytest.param(s, marks=pytest.mark.nightly) for s in (9.0, WRAP_S - 0.001))]
)
def test_by_day_a_board_whose_clock_wraps(tmp_path, monkeypatch, clock_s: float) -> None:
    """Before, within and after the wrap: the board has been on for so long when it is opened."""
    (tmp_path / "rest.toml").write_text(SCENARIO)
    port = f"sim:{tmp_path / 'rest.toml'}?fingers=2&seconds=30&clock_s={clock_s}"
    first, second = recorded(tmp_path, monkeypatch, port, 0.0)
    check(first, {"finger", "slow"}, {"start", "span", "over"}, tmp_path, monkeypatch)
    check(second, {"rebooted"}, {"again", "over"}, tmp_path, monkeypatch)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore::biotac.ReadWarning")
def test_by_night_forty_minutes_beyond_the_wrap(tmp_path, monkeypatch) -> None:
    (tmp_path / "rest.toml").write_text(SCENARIO)
    port = f"sim:{tmp_path / 'rest.toml'}?fingers=5&seconds=7200"
    first, second = recorded(tmp_path, monkeypatch, port, WRAP_S + 2400.0)
    check(first, {"finger", "slow"}, {"start", "span", "over"}, tmp_path, monkeypatch)
    check(second, {"rebooted"}, {"again", "over"}, tmp_path, monkeypatch)
