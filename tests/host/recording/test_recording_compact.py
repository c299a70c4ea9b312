"""The compact form: every integer back, near its entropy, and damage is found."""

from __future__ import annotations

import math
import zipfile
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import biotac
from biotac.cli.main import main
from biotac.hand.streams import RESULTS
from biotac.recording.compact import Compact, entropy_bits, load_compact, write_compact


def test_every_integer_of_a_recording_comes_back(tmp_path) -> None:
    path, small = tmp_path / "a.mcap", tmp_path / "a.btc"
    with biotac.open("sim:faults.toml?fingers=2") as hand:
        hand.subscribe(RESULTS)  # with heartbeats
        hand.record(path)
        hand.read_batch(100)
    recording = biotac.Recording(path)
    assert len(recording.idle)
    assert main(["export", str(path), str(small)]) == 0
    got = biotac.load_compact(small)
    assert got.metadata == recording.metadata
    for kind, rows, sent in (
        ("frames", recording.frames, recording.wire),
        ("pac", recording.pac, recording.pac),
        ("idle", recording.idle, recording.idle),
    ):
        for finger in (0, 1):
            mine, fields = rows["finger"] == finger, getattr(got, kind)[finger]
            assert set(fields) == set(sent.dtype.names) - {"finger"}
            for name, values in fields.items():
                source = rows if name in ("seq", "t_us") else sent
                assert np.array_equal(values, source[name][mine]), (kind, name)
                assert values.dtype == (np.int64 if name in ("seq", "t_us") else sent[name].dtype)


@settings(max_examples=60, deadline=None)
@given(
    st.sampled_from(["u1", "u2", "u4", "i2", "i4", "i8"]),
    st.integers(1, 4),
    st.lists(st.integers(0, 2**64 - 1), min_size=1, max_size=40),
    st.booleans(),
)
def test_any_integers_come_back(tmp_path_factory, kind: str, parts: int, numbers: list[int], walk: bool) -> None:
    """Extremes and wraps too; a walk has differences of less entropy, so that both ways are taken."""
    raw = np.array(numbers, np.uint64)
    values = (np.cumsum(raw % np.uint64(3)) if walk else raw).astype(np.dtype(kind))
    table = np.stack([values] * parts, axis=1) if parts > 1 else values
    path = tmp_path_factory.mktemp("any") / "a.btc"
    write_compact(path, Compact({}, frames={3: {"x": table}}))
    got = load_compact(path).frames[3]["x"]
    assert got.dtype == table.dtype and np.array_equal(got, table)


def test_entropy_is_shannons() -> None:
    """Against the definition, in plain Python."""
    values = np.random.default_rng(1).integers(0, 20, 1000) ** 2
    counts = Counter(values.tolist())
    bits = -sum(n * math.log2(n / 1000) for n in counts.values())
    assert entropy_bits(values) == pytest.approx(bits)
    assert entropy_bits(np.zeros(9)) == 0
    assert entropy_bits(np.array([0, 1] * 8)) == pytest.approx(16)


def test_damage_is_found(tmp_path) -> None:
    path = tmp_path / "a.btc"
    values = np.random.default_rng(2).integers(0, 4096, 500).astype(np.uint16)
    write_compact(path, Compact({}, frames={0: {"x": values}}))
    whole = path.read_bytes()
    for at in (60, len(whole) // 2, 200):
        damaged = bytearray(whole)
        damaged[at] ^= 0x40
        path.write_bytes(damaged)
        with pytest.raises(biotac.RecordingError, match="damaged"):
            load_compact(path)
    for content in (b"", b"PK", whole[: len(whole) // 2], b"x" * 500):
        path.write_bytes(content)
        with pytest.raises(biotac.RecordingError, match="no compact recording"):
            load_compact(path)
    with pytest.raises(biotac.RecordingError, match="check the path"):
        load_compact(Path(tmp_path / "nowhere.btc"))


def test_a_newer_format_is_refused(tmp_path) -> None:
    with zipfile.ZipFile(tmp_path / "a.btc", "w") as archive:
        archive.writestr("meta.json", '{"format": 99}')
    with pytest.raises(biotac.RecordingError, match="format 99"):
        load_compact(tmp_path / "a.btc")


def test_the_bench_prints_sizes_floor_and_ratios(capsys) -> None:
    assert main(["bench", "recording", "--seconds", "2", "--fingers", "1"]) == 0
    out = capsys.readouterr().out
    for words in ("200 frames", "MCAP with protobuf messages", "its entropy floor (asked <= 1.25x", "against protobuf"):
        assert words in out
