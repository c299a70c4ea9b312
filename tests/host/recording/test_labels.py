"""Labels made live and afterwards: they come back with their times, and cost the recording nothing."""

import hashlib
import signal
import subprocess
import sys
from pathlib import Path

import pytest
from mcap.reader import make_reader
from record_all import record_all

import biotac
from biotac.cli.main import main
from biotac.recording import labels


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    """Two fingers, with a note, a point of one finger and a span, made during the recording."""
    path = tmp_path_factory.mktemp("labels") / "live.mcap"
    with biotac.open("sim:press.toml?fingers=2&seconds=6") as hand:
        with pytest.raises(biotac.InputError, match="nothing is being recorded"):
            hand.mark("early")
        hand.record(path, note="glass, 3 mm")
        rows = hand.read(seconds=1)
        hand.mark("touched", "middle", video_s=12.5)
        with hand.mark("grasp", trial=3, subject="S07"):
            hand.read(seconds=2)
        hand.read_batch(100)
        with pytest.raises(KeyError, match="thumb"):
            hand.mark("touched", "thumb")
    assert len(rows)
    return path


def test_live_labels_have_their_times_and_facts(recorded: Path) -> None:
    recording = biotac.Recording(recorded)
    note, touched, grasp = recording.labels
    assert (note.text, note.t_us, note.finger) == ("glass, 3 mm", None, None)
    assert touched.text == "touched" and touched.finger == 1 and touched.facts == {"video_s": 12.5}
    assert grasp.text == "grasp" and grasp.facts == {"trial": 3, "subject": "S07"}
    assert touched.t_us is not None and grasp.t_us is not None and grasp.end_us is not None
    # The reader is ahead of the program by the rows that wait, so only the span's order is known here.
    assert recording.begin_us <= touched.t_us <= grasp.t_us < grasp.end_us <= recording.end_us
    assert recording.problems == [] and recording.gaps == []


@pytest.mark.parametrize("options", [["export", "--recompute", "--keep-tare"], ["file", "recover"]])
def test_a_recording_written_again_keeps_them(recorded: Path, tmp_path: Path, options: list[str]) -> None:
    assert main([*options, str(recorded), str(tmp_path / "again.mcap")]) == 0
    assert biotac.Recording(tmp_path / "again.mcap").labels == biotac.Recording(recorded).labels


def test_rows_know_which_labels_hold(recorded: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(recorded.read_bytes())
    recording = biotac.Recording(path)
    recording.mark("window", 1.0, 1.5)
    recording.mark("tap", 4.0, finger="middle")
    part = recording.select(fields="pdc")
    since_us = part.rows["t_us"] - recording.begin_us
    inside = (since_us >= 1_000_000) & (since_us <= 1_500_000)
    assert all(("window" in text.split("; ")) == held for text, held in zip(part.label, inside, strict=True))
    assert all(text.startswith("glass, 3 mm") for text in part.label)
    (tapped,) = [k for k, text in enumerate(part.label) if "tap" in text.split("; ")]
    assert part.rows["finger"][tapped] == 1 and 4_000_000 <= since_us[tapped] < 4_010_000
    window = recording.select(fields="pdc", labels="window").rows
    assert window.tobytes() == part.rows[inside].tobytes()
    both = recording.select(fields="pdc", labels=["window", "tap"], fingers="index").rows
    near_s = (both["t_us"] - recording.begin_us) / 1e6
    assert ((abs(near_s - 1.25) <= 0.25) | (abs(near_s - 4.0) <= 0.5)).all() and len(both) in range(150, 154)
    with pytest.raises(biotac.InputError, match=r"no label 'slip' with a time: expected one or more of 'grasp', 't"):
        recording.select(labels="slip")


def test_a_label_is_removed_live_ones_too(recorded: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(recorded.read_bytes())
    recording = biotac.Recording(path)
    recording.mark("tap", 1.0)
    recording.mark("tap", 2.0, finger="index")
    assert recording.unmark("tap", 1.004) == 1 and [
        label.finger for label in recording.labels if label.text == "tap"
    ] == [0]
    assert recording.unmark("grasp") == recording.unmark("tap") == 1
    again = biotac.Recording(path)
    assert [label.text for label in again.labels] == ["glass, 3 mm", "touched"] and again.problems == []
    again.mark("tap", 1.0)
    assert (
        "tap" in [label.text for label in biotac.Recording(path).labels] and path.read_bytes() == recorded.read_bytes()
    )
    for wanted, expected in ((("grasp",), "no label 'grasp': expected one of"), (("tap", 3.0), "'tap' at 3 s")):
        with pytest.raises(biotac.InputError, match=expected):
            again.unmark(*wanted)


def test_what_is_not_in_the_recording_is_not_labelled_or_selected(recorded: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(recorded.read_bytes())
    recording = biotac.Recording(path)
    last_s = (recording.end_us - recording.begin_us) / 1e6
    for times in ((99,), (1.0, 99), (-0.1,)):
        with pytest.raises(biotac.InputError, match=rf"{times[-1]} s: a.mcap has rows from 0 to {last_s:g} s"):
            recording.mark("x", *times)
    for asks in (lambda: recording.mark("x", finger="thumb"), lambda: recording.select(fingers=["thumb"])):
        with pytest.raises(biotac.InputError, match="has no rows of finger 4: expected one or more of 0, 1"):
            asks()
    recording.mark("the end", last_s, finger=1)
    assert len(recording.select(fingers="middle", start_s=99).rows) == 0  # it is there, but not then


def test_a_long_span_keeps_its_beginning(tmp_path: Path) -> None:
    with biotac.open("sim:press.toml?seconds=90") as hand, hand.record(tmp_path / "long.mcap"):
        hand.read(seconds=1)
        with hand.mark("long"):
            hand.read_batch(100)
    recording = biotac.Recording(tmp_path / "long.mcap")
    (label,) = recording.labels
    assert label.t_us is not None and label.end_us == recording.end_us
    assert recording.begin_us <= label.t_us < recording.begin_us + 60_000_000


def test_a_thousand_labels_leave_the_recording_as_it_was(recorded: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(recorded.read_bytes())
    before = hashlib.sha256(path.read_bytes()).digest()
    recording = biotac.Recording(path)
    for k in range(1000):
        recording.mark(f"label {k}", k / 1000, trial=k)
    again = biotac.Recording(path)
    assert [label.text for label in again.labels[1:1001]] == [f"label {k}" for k in range(1000)]
    assert hashlib.sha256(path.read_bytes()).digest() == before and again.problems == []
    recording.mark("label 7", 7 / 1000, trial="again")  # replaces it
    assert [label.facts for label in recording.labels if label.text == "label 7"] == [{"trial": "again"}]
    with path.open("rb") as stream:
        assert sum(1 for _ in make_reader(stream).iter_messages()) == 3 * len(recording.arrived_ns)


KILLED = """
import sys, biotac
recording = biotac.Recording(sys.argv[1])
k = 0
while True:
    recording.mark(f"label {k}", k / 1e4)
    print(k, flush=True)
    k += 1
"""


def test_kill_9_loses_at_most_the_last_label(recorded: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(recorded.read_bytes())
    with subprocess.Popen([sys.executable, "-c", KILLED, str(path)], stdout=subprocess.PIPE, text=True) as program:
        assert program.stdout is not None
        printed = [program.stdout.readline() for _ in range(200)]
        program.send_signal(signal.SIGKILL)
        printed += program.stdout.read().splitlines()
    texts = [label.text for label in biotac.Recording(path).labels if label.text.startswith("label")]
    assert texts[: len(printed)] == [f"label {k}" for k in range(len(printed))] and len(texts) <= len(printed) + 1


def test_a_torn_line_costs_itself_alone(recorded: Path, tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(recorded.read_bytes())
    recording = biotac.Recording(path)
    recording.mark("first", 1.0)
    recording.mark("second", 2.0)
    beside = labels.beside(path)
    beside.write_bytes(beside.read_bytes()[:-20])
    recording = biotac.Recording(path)
    recording.mark("third", 3.0)
    again = biotac.Recording(path)
    texts = [label.text for label in again.labels]
    assert "first" in texts and "third" in texts and "second" not in texts
    assert again.problems == [f"line 2 of {beside.name} is damaged and was skipped"]


def test_another_recording_of_that_name_does_not_inherit_them(recorded: Path, tmp_path: Path) -> None:
    path = record_all("sim:press.toml?seconds=1", tmp_path / "a.mcap")
    biotac.Recording(path).mark("of the first", 0.5)
    path.write_bytes(recorded.read_bytes())
    again = biotac.Recording(path)
    assert "of the first" not in [label.text for label in again.labels]
    assert again.problems == ["line 1 of a.labels.jsonl is about another recording of that name"]


@pytest.mark.parametrize("line", ['{"recording": 1}', "[]", '{"recording": 1, "text": 5}', "nonsense", "\\xff"])
def test_no_line_is_a_traceback(recorded: Path, tmp_path: Path, line: str) -> None:
    path = tmp_path / "a.mcap"
    path.write_bytes(recorded.read_bytes())
    begin_ns = biotac.Recording(path).begin_ns
    labels.beside(path).write_text(line.replace("1", str(begin_ns), 1) + "\n")
    assert len(biotac.Recording(path).problems) == 1
    with pytest.raises(biotac.InputError, match="ends before"):
        biotac.Recording(path).mark("x", 2.0, 1.0)
