"""Recordings: the same arrays back, after any kill, cut or damage."""

import json
from collections.abc import Callable
from dataclasses import asdict, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from mcap.stream_reader import StreamReader
from mcap.writer import Writer
from record_all import blocks_of, in_blocks, written

import biotac
from biotac.board.gap import Gap
from biotac.cli.main import main
from biotac.recording import layout, writer
from biotac.recording.recorded_board import RecordedBoard
from biotac.wire import messages_gen as wire
from biotac.wire.batches import StreamDecoder
from biotac.wire.decoder import packed, pairs
from biotac.wire.dtypes_gen import DTYPES
from biotac.wire.framing import encode

SOURCE = "sim:press.toml?fingers=2&seconds=4"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> tuple[Path, np.ndarray, np.ndarray]:
    """A good recording, and the frames and PAC that the live stream gave."""
    path = tmp_path_factory.mktemp("rec") / "good.mcap"
    with biotac.open(SOURCE) as hand:
        hand.record(path)
        batch = hand.read_batch(100)
    return in_blocks(path, 10), batch.frames, batch.pac


def rewrite(path: Path, target: Path, change: Callable[[bytes], bytes]) -> None:
    """Copy a recording, with the packets of the blocks going through ``change``."""
    whole = biotac.Recording(path)
    written(target, whole.metadata, zip(map(change, blocks_of(whole)), whole.arrived_ns, strict=True))


def alter(seq: int, finger: int, edit: Callable[[np.ndarray], None]) -> Callable[[bytes], bytes]:
    """A change that edits one FRAME message."""

    def change(data: bytes) -> bytes:
        out = []
        for message_id, payload in pairs(data):
            if message_id == wire.FrameMessage.ID:
                rows = np.frombuffer(payload, DTYPES[wire.FrameMessage.ID]).copy()
                if rows["seq"][0] == seq and rows["finger"][0] == finger:
                    edit(rows)
                    payload = rows.tobytes()
            out.append((message_id, payload))
        return packed(out)

    return change


def add_to_force(rows: np.ndarray) -> None:
    rows["force_100un"][0, 2] += 1


def flip_poc_invalid(rows: np.ndarray) -> None:
    rows["flags"] ^= np.uint32(wire.FrameFlags.POC_INVALID)


@pytest.fixture
def check(capsys) -> Callable[[Path], tuple[int, str, str]]:
    """`biotac check`: the exit code, stdout, and stderr."""

    def run(path: Path) -> tuple[int, str, str]:
        return main(["check", str(path)]), *capsys.readouterr()

    return run


def test_reading_back_gives_the_same_arrays(recorded) -> None:
    path, frames, pac = recorded
    recording = biotac.Recording(path)
    assert frames_equal(biotac.load(path), frames)
    assert np.array_equal(recording.pac, pac)
    assert recording.problems == []
    assert recording.frames_lost == 0


def frames_equal(a: np.ndarray, b: np.ndarray) -> bool:
    """Structured arrays with NaN."""
    return a.dtype == b.dtype and a.tobytes() == b.tobytes()


@pytest.mark.parametrize(("name", "change"), [("force", add_to_force), ("PoC", flip_poc_invalid)])
def test_one_altered_digit_or_flag_fails_and_names_the_frame(recorded, tmp_path, check, name: str, change) -> None:
    altered = tmp_path / "altered.mcap"
    rewrite(recorded[0], altered, alter(123, 1, change))
    code, out, _ = check(altered)
    assert code == 1 and "finger 1 frame 123" in out and name in out
    assert out.count("frame 12") == 1


def test_a_damaged_wire_byte_fails_and_names_the_gap(recorded, tmp_path, check) -> None:
    source, damaged = biotac.Recording(recorded[0]), tmp_path / "damaged.mcap"
    recorder, decoder = writer.Writer(damaged, board_of(source), "test"), StreamDecoder()
    for k in range(len(source.arrived_ns)):
        data = bytearray(b"".join(encode(*message) for message in source.messages_in(k)))
        if k == 0:
            data[len(data) // 2] ^= 0x55 if data[len(data) // 2] != 0x55 else 1
        batch = decoder.feed(bytes(data))
        recorder.write(batch.packets, batch.damaged)
    recorder.close()
    code, _, err = check(damaged)
    assert code == 1 and "1 packet(s) rejected, the first in the second that began at 0.0 s" in err
    assert biotac.Recording(damaged).rejected in ([{"at_s": 0.0, kind: 1}] for kind in ("bad_crc", "bad_cobs"))


def test_damaged_metadata_is_a_recording_error(recorded, tmp_path) -> None:
    """Or no error, as the setting stands in the file twice; a flipped bit never passes for another setting."""
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


def test_facts_of_other_minor_versions_are_read_as_the_wire_is(recorded) -> None:
    good = biotac.Recording(recorded[0])
    metadata, hello = dict(good.metadata), json.loads(good.metadata["hello"])
    names = list(hello)
    older = {name: hello[name] for name in names[:-1]}
    read = RecordedBoard.read(metadata | {"hello": json.dumps(older)}).info
    assert asdict(read) == asdict(good.info) | {names[-1]: (0,) * len(hello[names[-1]])}
    assert RecordedBoard.read(metadata | {"hello": json.dumps(hello | {"appended_later": 1})}).info == good.info
    for wrong in ({name: hello[name] for name in names[1:]}, {"other": 1} | older):
        with pytest.raises(ValueError, match="Hello has"):
            RecordedBoard.read(metadata | {"hello": json.dumps(wrong)})


def test_an_absurd_record_length_is_no_traceback(recorded, tmp_path) -> None:
    whole = recorded[0].read_bytes()
    absurd = tmp_path / "absurd.mcap"
    # After the eight magic bytes: one byte of opcode, eight of length.
    absurd.write_bytes(whole[:9] + b"\xff" * 8 + whole[17:])
    with pytest.raises(biotac.RecordingError):
        _ = biotac.Recording(absurd).problems
    assert len(biotac.load(absurd)) == len(recorded[1])  # the index at the end leads past the damage


def test_messages_that_are_no_more_are_left_out(recorded, tmp_path) -> None:
    """BANDS and the emulated sensors' EMU_STATUS: some earlier recordings have them."""
    gone = packed([(0x18, bytes(36)), (0x40, bytes(50))])
    rewrite(recorded[0], tmp_path / "gone.mcap", lambda block: block + gone)
    answer, before = biotac.Recording(tmp_path / "gone.mcap"), biotac.Recording(recorded[0])
    assert not answer.damage and answer.messages == before.messages
    assert answer.frames.tobytes() == before.frames.tobytes()


def test_another_mcap_file_is_not_taken_for_a_recording(tmp_path) -> None:
    path = tmp_path / "other.mcap"
    with path.open("wb") as out:
        other = Writer(out)
        other.start()
        other.finish()
    with pytest.raises(biotac.RecordingError, match="not a biotac recording"):
        biotac.Recording(path)


def test_a_recording_of_before_is_refused_with_the_way(recorded, tmp_path) -> None:
    path = tmp_path / "before.mcap"
    with path.open("wb") as out:
        other = Writer(out)
        other.start()
        other.add_metadata("biotac", layout.with_checksum({"format": "2", "wire": "9.0"}))
        other.finish()
    with pytest.raises(biotac.RecordingError, match=r"format 2, written by .* at \w+; check out that commit, .*export"):
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


@pytest.mark.parametrize("part", ["packets", "head"])
def test_a_damaged_second_is_left_out_and_counted(recorded, tmp_path, check, part: str) -> None:
    path, frames, _ = recorded
    whole = bytearray(path.read_bytes())
    with path.open("rb") as stream:
        chunks = [r for r in StreamReader(stream, emit_chunks=True).records if type(r).__name__ == "Chunk"]
    # Chunks of each second: packets, applied forces, head.
    chosen = chunks[3 * 2 + {"packets": 0, "head": 2}[part]]
    whole[bytes(whole).find(chosen.data) + len(chosen.data) // 2] ^= 0xFF
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(whole)
    recording = biotac.Recording(damaged)
    assert 0 < len(recording.frames) < len(frames)
    assert len(recording.frames) + recording.frames_lost == len(frames)
    code, _, err = check(damaged)
    assert code == 1 and "damaged and was skipped" in err


def board_of(recording: biotac.Recording) -> RecordedBoard:
    return RecordedBoard(recording.info, recording.sensors, recording.settings)


def test_a_gap_is_in_the_file_and_told(recorded, tmp_path, capsys) -> None:
    """By Recording, load and check; the numbers are right, so check ends with 0."""
    source, path = biotac.Recording(recorded[0]), tmp_path / "gap.mcap"
    recorder = writer.Writer(path, board_of(source), "test")
    first, *others = blocks_of(source)
    gap = Gap("silence", int(source.t_us[0]), int(source.t_us[-1]), 10**9, 3 * 10**9, 7)
    recorder.write(first)
    recorder.write_gap(gap)
    for block in others:
        recorder.write(block)
    at_the_end = replace(gap, next_t_us=None)
    recorder.write_gap(at_the_end)
    recorder.close()
    assert recorder.frames == len(recorded[1])
    recording = biotac.Recording(path)
    assert recording.gaps == [gap, at_the_end] and recording.problems == [gap.line(), at_the_end.line()]
    assert recording.gaps_before(1) == [gap] and recording.gaps_before(0) == []
    assert [h.arrived_ns for h in biotac.Recording(path).heads()] == [h.arrived_ns for h in recording.heads()]
    assert frames_equal(recording.frames, recorded[1])
    with pytest.warns(biotac.RecordingWarning, match=r"2 gap\(s\)"):
        biotac.load(path)
    assert main(["check", str(path)]) == 0
    answer = capsys.readouterr()
    assert "good, 2 gap(s)" in answer.out and {gap.line(), at_the_end.line()} <= {
        line.removeprefix("biotac: ") for line in answer.err.splitlines()
    }
    assert main(["check", str(path), "--json"]) == 0
    assert [Gap(**facts) for facts in json.loads(capsys.readouterr().out)["gaps"]] == [gap, at_the_end]
    again = tmp_path / "again.mcap"
    assert main(["export", "--keep-tare", str(path), str(again)]) == 0
    assert biotac.Recording(again).gaps == [gap, at_the_end]


def test_a_stop_over_a_wrap_of_device_time_is_counted_by_the_clock(recorded, tmp_path) -> None:
    """Device time is 32 bits, 71.6 min; 4500 s without a byte are 450 000 frames of each finger."""
    frame = wire.FrameMessage.unpack(biotac.Recording(recorded[0]).wire[0].tobytes())
    now_ns = [10**18]
    path = tmp_path / "stop.mcap"
    recorder = writer.Writer(
        path,
        board_of(biotac.Recording(recorded[0])),
        "test",
        clock_s=lambda: now_ns[0] / 1e9,
        unix_ns=lambda: now_ns[0],
    )
    stops_s = [0, 4500, 4300, 9000, 1800]
    rounds = np.cumsum([round(100 * stop_s) for stop_s in stops_s])
    for stop_s, n in zip(stops_s, rounds.tolist(), strict=True):
        now_ns[0] += stop_s * 10**9
        recorder.write(packed([(wire.FrameMessage.ID, replace(frame, seq=n % 2**16, t_us=n * 10_000 % 2**32).pack())]))
        recorder.flush()
    recorder.close()
    recording = biotac.Recording(path)
    assert recording.t_us.tolist() == (rounds * 10_000).tolist()
    assert recording.frames_lost == recorder.frames_lost == rounds[-1] - len(stops_s) + 1


def test_events_are_read_and_replayed_as_they_came(tmp_path: Path) -> None:
    path = tmp_path / "events.mcap"
    with biotac.open("sim:press.toml?seconds=3") as hand:
        hand.record(path)
        hand.stream("results", "events")
        live = [m for m in hand.read_batch(10.0).messages if isinstance(m, biotac.Event)]
    assert live and [m for m in biotac.Recording(path).messages if isinstance(m, biotac.Event)] == live
    with biotac.open(f"replay:{path}") as hand:
        assert [m.kind for m in hand.read_batch(10.0).messages if isinstance(m, biotac.Event)] == [m.kind for m in live]


def test_a_second_on_the_recorders_clock_closes_a_block(tmp_path: Path) -> None:
    now_s = [100.0]
    with biotac.open("sim:press.toml?seconds=1") as hand:
        facts = RecordedBoard(hand.info, [hand.sensor_info(0)], hand.board.settings())
    path = tmp_path / "clock.mcap"
    recorder = writer.Writer(path, facts, "test", clock_s=lambda: now_s[0], unix_ns=lambda: 7)
    ping = packed([(wire.Reply.ID, wire.Reply(1, wire.Ping.ID, 0).pack())])
    sizes = []
    for step in (0.0, 0.5, 0.3, 0.2, 0.4, 0.3):
        now_s[0] += step
        recorder.write(ping)
        sizes.append(path.stat().st_size)
    # 1.0 s after the first byte, and not 0.7 s after it: by then another block has begun, which is 0.3 s old.
    grown = [after > before for before, after in pairwise(sizes)]
    assert grown == [False, False, True, False, False]
    now_s[0] += 1.0
    recorder.write()
    assert path.stat().st_size > sizes[-1]
    recorder.close()
    assert biotac.Recording(path).arrived_ns == [7, 7]


def test_whatever_a_board_says_the_wire_is_kept(recorded, tmp_path: Path) -> None:
    """Random payloads: nothing that is derived from the wire may stop the recording of the bytes."""
    known = biotac.Recording(recorded[0])
    rng = np.random.default_rng(7)
    path = tmp_path / "wild.mcap"
    recorder = writer.Writer(
        path, RecordedBoard(known.info, known.sensors, known.settings), "test", clock_s=lambda: 0.0
    )
    wild = b""
    for message_id in (wire.FrameMessage.ID, wire.Pac.ID, wire.Tare.ID, wire.Idle.ID, wire.Status.ID) * 60:
        wild += packed([(message_id, rng.bytes(wire.MESSAGES[message_id].STRUCT.size))])
    recorder.write(wild)
    recorder.close()
    recording = biotac.Recording(path)
    assert b"".join(blocks_of(recording)) == wild
    assert len(recording.frames) == 60 and recording.problems != []
