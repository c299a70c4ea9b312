"""A disk that gets full in the middle of a recording, or loses it: that is told, and the part that fitted is kept."""

import json
import random
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from record_all import record_all

import biotac

FINGERS = 2
ROUNDS_PER_S = 100
SECONDS = 8
PORT = f"sim:press.toml?fingers={FINGERS}&seconds={SECONDS}"


@pytest.mark.parametrize("sizes", [2, pytest.param(20, marks=pytest.mark.nightly)])
def test_what_fitted_is_kept_but_for_a_second(tmp_path: Path, sizes: int) -> None:
    whole = record_all(PORT, tmp_path / "whole.mcap")
    frames, whole_bytes = biotac.load(whole), whole.stat().st_size
    draw = random.Random(sizes)
    limits = [draw.randrange(whole_bytes // 4, whole_bytes * 9 // 10) for _ in range(sizes)]
    script = Path(__file__).with_name("record_to_full_disk.py")
    words = [sys.executable, str(script), PORT, str(tmp_path), *map(str, limits)]
    done = subprocess.run(words, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    for limit, line in zip(limits, done.stdout.splitlines(), strict=True):
        answer = json.loads(line)
        assert answer["told"] == 1
        recording = biotac.Recording(tmp_path / f"{limit}.mcap")
        kept = recording.frames
        assert recording.cut_off and recording.counts.bad == 0 and recording.frames_lost == 0
        assert kept.tobytes() == frames[: len(kept)].tobytes()
        assert len(kept) <= answer["read"] + FINGERS * ROUNDS_PER_S
        assert len(kept) >= len(frames) * limit / whole_bytes - FINGERS * ROUNDS_PER_S


@pytest.mark.parametrize("pace", [0, 4])
def test_a_recording_whose_folder_is_removed_is_told_once_and_the_reading_goes_on(tmp_path: Path, pace: int) -> None:
    """Neither reading nor the board wait for a disk that takes nothing."""
    folder = tmp_path / "gone"
    folder.mkdir()
    with biotac.open("sim:press.toml?seconds=1000", pace=pace) as hand:
        recorder = hand.record(folder / "a.mcap")
        assert len(hand.read(0.5)) == 50
        shutil.rmtree(folder)
        with pytest.raises(FileNotFoundError, match="was deleted during recording"):
            hand.read(900)
        assert recorder.closed
        assert len(hand.read(4.0)) == 400
