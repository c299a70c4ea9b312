"""Times of a recording by the host's clock: against a board with a clock known to drift, for hours."""

from collections.abc import Iterator
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from record_all import record_all, written

import biotac
from biotac.recording.mcap_file import RecordingFile
from biotac.wire import messages_gen as wire
from biotac.wire.decoder import packed
from biotac.wire.dtypes_gen import DTYPES

BEGIN_NS = 1_700_000_000_000_000_000
DRIFT_PPM = 50.0
HOURS = 2.5  # longer than the clock remembers, and two wraps of the board's 32 bits
EVERY_S = 30.0


@pytest.fixture(scope="module")
def metadata(tmp_path_factory) -> dict[str, str]:
    path = record_all("sim:press.toml?seconds=1", tmp_path_factory.mktemp("facts") / "a.mcap")
    return biotac.Recording(path).metadata


def rows(drift_ppm: float) -> Iterator[tuple[int, int, int]]:
    """(seq, device time, true host time in ns) of a FRAME every few seconds."""
    for k in range(int(HOURS * 3600 / EVERY_S)):
        host_s = k * EVERY_S
        yield k, round(host_s * (1 + drift_ppm / 1e6) * 1e6), BEGIN_NS + round(host_s * 1e9)


@pytest.fixture(scope="module")
def drifting(tmp_path_factory, metadata) -> Path:
    """Frames that take 0.2 to 1.2 ms to the host."""
    path = tmp_path_factory.mktemp("drift") / "a.mcap"
    rng = np.random.default_rng(3)
    frame = np.zeros((), DTYPES[wire.FrameMessage.ID])
    with path.open("wb") as stream:
        file = RecordingFile(stream, metadata)
        for seq, t_us, true_ns in rows(DRIFT_PPM):
            frame["seq"], frame["t_us"] = seq, t_us % 2**32
            block = packed([(wire.FrameMessage.ID, frame.tobytes())])
            late_ns = int(10_000_000 + 1_000_000 * (0.2 + rng.random()))
            file.add(block, true_ns + late_ns, true_ns + late_ns + 1000)
        file.close()
    return path


def test_exports_follow_the_measured_drift(drifting: Path) -> None:
    recording = biotac.Recording(drifting)
    truth_ns = np.array([true_ns for _, _, true_ns in rows(DRIFT_PPM)])
    stamps = recording.stamp_ns(recording.frames["t_us"])
    assert stamps[0] == recording.begin_ns
    # The start is as late as the first message was; from there on only a message's way can be mistaken.
    error_ms = (stamps - stamps[0] - (truth_ns - truth_ns[0])) / 1e6
    assert np.abs(error_ms).max() < 1.2
    assert (np.diff(stamps) > 0).all()
    plain_ms = ((recording.frames["t_us"] - recording.frames["t_us"][0]) * 1000 - (truth_ns - truth_ns[0])) / 1e6
    assert np.abs(plain_ms).max() > 400  # the error without it
    assert recording.to_pandas().index.asi8.tolist() == stamps.tolist()


def test_where_nobody_knows_the_hosts_time_device_time_counts(tmp_path: Path, metadata) -> None:
    """As in imported files: one time a block, which tells nothing about a clock."""
    frame, blocks = np.zeros((), DTYPES[wire.FrameMessage.ID]), []
    for seq, t_us, _ in islice(rows(0.0), 21):
        frame["seq"], frame["t_us"] = seq, t_us % 2**32
        blocks.append((packed([(wire.FrameMessage.ID, frame.tobytes())]), t_us * 1000 // 10**9 * 10**9))
    recording = biotac.Recording(written(tmp_path / "a.mcap", metadata, blocks))
    t_us = recording.frames["t_us"]
    assert recording.stamp_ns(t_us).tolist() == (t_us * 1000).tolist()
