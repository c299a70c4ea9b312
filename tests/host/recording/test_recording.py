"""Recordings: the same arrays back, whatever was killed, cut or damaged."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from deframer import Deframer
from mcap.stream_reader import StreamReader
from mcap.writer import Writer

import biotac
from biotac.recording.file import RecordingFile
from biotac.wire import messages_gen as wire
from biotac.wire.dtypes_gen import DTYPES
from biotac.wire.framing import encode

SOURCE = "sim:press.toml?fingers=2&seconds=4"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> tuple[Path, np.ndarray, np.ndarray]:
    """A good recording, and the frames and PAC that the live stream gave."""
    path = tmp_path_factory.mktemp("rec") / "good.mcap"
    with pytest.MonkeyPatch.context() as patch, biotac.open(SOURCE) as hand:
        patch.setattr("biotac.recording.writer.FINGER_BYTES_PER_S", 16384)  # several chunks in little time
        hand.record(path)
        batch = hand.read_batch(100)
    return path, batch.frames, batch.pac


def rewrite(path: Path, target: Path, change: Callable[[bytes], bytes]) -> None:
    """Copy a recording, its blocks of the wire going through ``change``."""
    whole = biotac.Recording(path)
    file = RecordingFile(target.open("wb"), whole.metadata)
    for block, arrived_ns in zip(whole.blocks, whole.arrived_ns, strict=True):
        file.add(change(block), arrived_ns)
    file.close()


def alter(seq: int, finger: int, edit: Callable[[np.ndarray], None]) -> Callable[[bytes], bytes]:
    """A change that edits one FRAME message and gives it a right CRC again."""

    def change(data: bytes) -> bytes:
        out = b""
        for message_id, payload in Deframer().feed(data):
            if message_id == wire.Frame.ID:
                rows = np.frombuffer(payload, DTYPES[wire.Frame.ID]).copy()
                if rows["seq"][0] == seq and rows["finger"][0] == finger:
                    edit(rows)
                    payload = rows.tobytes()
            out += encode(message_id, payload)
        return out

    return change


def add_to_force(rows: np.ndarray, by: int) -> None:
    rows["force_100un"][0, 2] += by


def flip_poc_invalid(rows: np.ndarray) -> None:
    rows["flags"] ^= np.uint32(wire.FrameFlags.POC_INVALID)


def check(path: Path, *options: str) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "biotac", "check", str(path), *options], capture_output=True, text=True, check=False
    )


def test_reading_back_gives_the_same_arrays(recorded) -> None:
    path, frames, pac = recorded
    recording = biotac.Recording(path)
    assert np.array_equal(biotac.load(path), frames, equal_nan=False) or frames_equal(biotac.load(path), frames)
    assert np.array_equal(recording.pac, pac)
    assert recording.problems == []
    assert recording.frames_lost == 0


def frames_equal(a: np.ndarray, b: np.ndarray) -> bool:
    """Structured arrays with NaN."""
    return a.dtype == b.dtype and a.tobytes() == b.tobytes()


def test_load_has_the_documented_fields(recorded) -> None:
    frames = biotac.load(recorded[0])
    assert frames.dtype == biotac.FRAME_DTYPE
    assert frames["counts"].shape == (800, 19)
    assert frames["poc_mm"].shape == frames["force_n"].shape == frames["torque_nmm"].shape == (800, 3)


def test_a_good_recording_passes(recorded) -> None:
    done = check(recorded[0])
    assert (done.returncode, done.stderr) == (0, "")
    assert "800 frames, 0 lost, good" in done.stdout


@pytest.mark.parametrize("by", [1, -7])
def test_one_altered_force_digit_fails_and_names_the_frame(recorded, tmp_path, by: int) -> None:
    altered = tmp_path / "altered.mcap"
    rewrite(recorded[0], altered, alter(123, 1, lambda rows: add_to_force(rows, by)))
    done = check(altered)
    assert done.returncode == 1
    assert "finger 1 frame 123" in done.stdout
    assert "force" in done.stdout
    assert done.stdout.count("frame 12") == 1


def test_a_damaged_wire_byte_fails_and_names_the_gap(recorded, tmp_path) -> None:
    damaged = tmp_path / "damaged.mcap"
    state = {"done": False}

    def change(data: bytes) -> bytes:
        at = len(data) // 2
        if state["done"] or data[at] in (0, 0x55):
            return data
        state["done"] = True
        return data[:at] + bytes([data[at] ^ 0x55 or 1]) + data[at + 1 :]

    rewrite(recorded[0], damaged, change)
    assert state["done"]
    done = check(damaged)
    assert done.returncode == 1
    assert "1 packet(s) rejected" in done.stderr


def test_a_flag_that_contradicts_its_poc_fails(recorded, tmp_path) -> None:
    altered = tmp_path / "flag.mcap"

    rewrite(recorded[0], altered, alter(200, 0, flip_poc_invalid))
    done = check(altered)
    assert done.returncode == 1
    assert "finger 0 frame 200" in done.stdout


def test_damaged_metadata_is_a_recording_error(recorded, tmp_path) -> None:
    """Or none, as it stands in the file twice; a flipped bit never passes for another setting."""
    good = biotac.Recording(recorded[0])
    whole = recorded[0].read_bytes()
    damaged = tmp_path / "meta.mcap"
    for words, change in (
        (b'"nonce"', b'"nOnce"'),
        (b'"force_gain_z_nn": ', b'"force_gain_z_nn":-'),
        (b"format", b"forma9"),
    ):
        damaged.write_bytes(whole.replace(words, change, 1))
        recording = biotac.Recording(damaged)
        assert (recording.info, recording.settings) == (good.info, good.settings)
        assert recording.problems == [
            "'biotac' of meta.mcap is damaged and was skipped",
            "meta.mcap is damaged: the checksum of its records is wrong",
        ]
        damaged.write_bytes(whole.replace(words, change))
        with pytest.raises(biotac.RecordingError, match="damaged metadata"):
            biotac.Recording(damaged)


def test_an_absurd_record_length_is_no_traceback(recorded, tmp_path) -> None:
    whole = recorded[0].read_bytes()
    absurd = tmp_path / "absurd.mcap"
    # After the eight magic bytes: one byte of opcode, eight of length.
    absurd.write_bytes(whole[:9] + b"\xff" * 8 + whole[17:])
    with pytest.raises(biotac.RecordingError):
        biotac.Recording(absurd)


@pytest.mark.parametrize("content", [b"", b"hello, I am no recording", bytes(1000)])
def test_a_file_that_is_no_recording_exits_2_in_one_line(tmp_path, content: bytes) -> None:
    path = tmp_path / "strange.mcap"
    path.write_bytes(content)
    done = check(path)
    assert done.returncode == 2
    assert done.stderr.startswith("biotac: ")
    assert done.stderr.count("\n") == 1


def test_a_missing_file_exits_2(tmp_path) -> None:
    done = check(tmp_path / "nowhere.mcap")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "No such file" in done.stderr


def test_a_finger_that_told_only_bands_is_there(recorded, tmp_path) -> None:
    bands = wire.Bands(3, 30_227, 1, 22, (1, 2, 3, 4, 5, 6))
    rewrite(recorded[0], tmp_path / "bands.mcap", lambda _: encode(bands.ID, bands.pack()))
    told = biotac.Recording(tmp_path / "bands.mcap")
    assert told.fingers == [1] and len(told.frames) == 0
    assert set(told.bands["finger"]) == {1}


def test_another_mcap_file_is_not_taken_for_a_recording(tmp_path) -> None:
    path = tmp_path / "other.mcap"
    with path.open("wb") as out:
        writer = Writer(out)
        writer.start()
        writer.finish()
    with pytest.raises(biotac.RecordingError, match="not a biotac recording"):
        biotac.Recording(path)


def test_a_recording_of_another_wire_major_is_refused(recorded, tmp_path) -> None:
    path = tmp_path / "newer.mcap"
    with path.open("wb") as out:
        writer = Writer(out)
        writer.start()
        writer.add_metadata("biotac", {"format": "1", "wire": "7.0", "hello": "{}", "settings": "{}"})
        writer.finish()
    with pytest.raises(biotac.RecordingError, match=r"wire version 7\.0.*install the version it was recorded with"):
        biotac.Recording(path)


def test_a_recording_cut_anywhere_gives_what_is_whole_or_says_why(recorded, tmp_path) -> None:
    path, frames, _ = recorded
    whole = path.read_bytes()
    cut = tmp_path / "cut.mcap"
    seen = set()
    for length in [*range(0, 400, 37), *np.linspace(400, len(whole) - 1, 40).astype(int)]:
        cut.write_bytes(whole[:length])
        try:
            recording = biotac.Recording(cut)
        except biotac.RecordingError:
            seen.add("refused")
            continue
        got = recording.frames
        assert frames_equal(got, frames[: len(got)])
        assert any("ends without its index" in p for p in recording.problems)
        seen.add("all" if len(got) == len(frames) else "some" if len(got) else "none")
    assert {"refused", "all"} <= seen


def test_a_cut_recording_is_checked_with_a_warning(recorded, tmp_path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(recorded[0].read_bytes()[:-50])
    done = check(cut)
    assert done.returncode == 0
    assert done.stderr.count("\n") == 1
    assert "ends without its index" in done.stderr


def test_a_damaged_second_is_left_out_and_the_rest_is_read(recorded, tmp_path) -> None:
    path, frames, _ = recorded
    whole = bytearray(path.read_bytes())
    with path.open("rb") as stream:
        chunks = [r for r in StreamReader(stream, emit_chunks=True).records if type(r).__name__ == "Chunk"]
    blocks = chunks[::2]  # the wire of each second; what is for plotting comes behind it
    assert len(blocks) > 3
    at = bytes(whole).find(blocks[-2].data) + len(blocks[-2].data) // 2  # the last may hold no frame
    whole[at] ^= 0xFF
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(whole)
    recording = biotac.Recording(damaged)
    assert 0 < len(recording.frames) < len(frames)
    done = check(damaged)
    assert done.returncode == 1
    assert "damaged and was skipped" in done.stderr


def test_an_existing_recording_is_not_overwritten(recorded) -> None:
    before = recorded[0].read_bytes()
    with biotac.open("sim:drift.toml?seconds=1") as hand, pytest.raises(biotac.InputError, match=r"exists.*--force"):
        hand.record(recorded[0])
    assert recorded[0].read_bytes() == before
