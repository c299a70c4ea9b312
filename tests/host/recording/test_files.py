"""Recordings as files that one handles: a file's contents, a part of it, the rest of a damaged one."""

import json
from pathlib import Path

import numpy as np
import pytest
from record_all import blocks_of, record_all

import biotac
from biotac.cli.main import main


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> Path:
    path = record_all("sim:press.toml?fingers=2&seconds=12", tmp_path_factory.mktemp("files") / "a.mcap")
    assert main(["file", "label", str(path), "slip", "--at", "5.5", "--until", "6", "--finger", "middle", "--fact",
                 "trial=3"]) == 0  # fmt: skip
    return path


def test_info_of_a_recording_says_what_is_in_it(recorded: Path, capsys) -> None:
    assert main(["info", str(recorded), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    rows = biotac.load(recorded, fields=["finger", "flags", "t_us"])
    assert facts["duration_s"] == (rows["t_us"].max() - rows["t_us"].min()) / 1e6
    flags = rows["flags"][rows["finger"] == 1]
    touched, low = ((flags & int(flag)) != 0 for flag in (biotac.FrameFlags.CONTACT, biotac.FrameFlags.POC_LOW))
    middle = facts["fingers"]["1"]
    assert middle["flags"]["CONTACT"] == np.mean(touched) and middle["name"] == "middle"
    assert middle["flags"]["POC_LOW"] == np.mean(low[touched]) < np.mean(low)  # at rest it is no fault
    assert facts["fingers"]["0"]["frames"] == (rows["finger"] == 0).sum()
    assert facts["labels"] == [{"text": "slip trial=3", "at_s": 5.5, "until_s": 6.0, "finger": 1}]
    assert main(["info", str(recorded)]) == 0
    assert "label, 5.50 s to 6.00 s, finger 1: slip trial=3" in capsys.readouterr().out
    recording = biotac.Recording(recorded)
    assert "12.0 s" in repr(recording) and "<td>middle, sensor BTSIM" in recording._repr_html_()
    assert {"index", "middle"} <= set(recording._ipython_key_completions_())


def test_a_part_has_the_messages_and_labels_of_the_whole(recorded: Path, tmp_path: Path) -> None:
    assert main(["file", "cut", str(recorded), str(tmp_path / "part.mcap"), "--from", "5.2", "--to", "7"]) == 0
    whole, part = biotac.Recording(recorded), biotac.Recording(tmp_path / "part.mcap")
    assert b"".join(blocks_of(part)) in b"".join(blocks_of(whole)) and part.problems == []
    since_s = (part.frames["t_us"] - whole.begin_us) / 1e6
    assert 3.2 < since_s.min() <= 5.2 and 7 - 0.01 <= since_s.max() < 9
    (label,) = part.labels  # in the recording itself now
    assert label.line() == "slip trial=3" and label.t_us == whole.begin_us + 5_500_000
    assert part.metadata["cut_from"] == "a.mcap"
    assert main(["file", "cut", str(recorded), str(tmp_path / "none.mcap"), "--from", "100"]) == 2
    assert not (tmp_path / "none.mcap").exists()


def test_what_is_left_of_a_damaged_recording_becomes_whole(recorded: Path, tmp_path: Path, capsys) -> None:
    damaged = bytearray(recorded.read_bytes())[: recorded.stat().st_size * 3 // 4]
    damaged[len(damaged) // 3] ^= 0x40
    (tmp_path / "cut.mcap").write_bytes(damaged)
    before = biotac.Recording(tmp_path / "cut.mcap")
    assert before.cut_off
    assert main(["file", "recover", str(tmp_path / "cut.mcap"), str(tmp_path / "good.mcap")]) == 0
    after = biotac.Recording(tmp_path / "good.mcap")
    assert after.frames.tobytes() == before.frames.tobytes() and not after.cut_off
    assert after.frames_lost == before.frames_lost
    assert main(["check", str(tmp_path / "good.mcap")]) == 0


def test_a_picture_shows_force_and_labels(recorded: Path, tmp_path: Path) -> None:
    from matplotlib.image import imread  # half a second to import

    assert main(["export", str(recorded), str(tmp_path / "a.png")]) == 0
    picture = imread(tmp_path / "a.png")
    assert picture.shape[:2] == (600, 1200) and len(np.unique(picture.reshape(-1, picture.shape[2]), axis=0)) > 20


@pytest.mark.parametrize(
    "words",
    [["--finger", "nose"], ["--finger", "thumb"], ["--fact", "trial"], ["--fact", "finger=3"], ["--at", "99"],
     ["--at", "3", "--until", "2"], ["--remove"]],
)  # fmt: skip
def test_a_label_that_makes_no_sense_is_refused_in_a_line(recorded: Path, capsys, words: list[str]) -> None:
    assert main(["file", "label", str(recorded), "x", *words]) == 2
    assert capsys.readouterr().err.startswith("biotac: ") and len(biotac.Recording(recorded).labels) == 1


def test_labels_are_listed_and_removed_by_a_command(recorded: Path, tmp_path: Path, capsys) -> None:
    path = tmp_path / "b.mcap"
    path.write_bytes(recorded.read_bytes())
    for words in (["tap", "--at", "1"], ["tap", "--at", "2"], ["tap", "--at", "2", "--remove"]):
        assert main(["file", "label", str(path), *words]) == 0
    capsys.readouterr()
    assert main(["file", "label", str(path)]) == 0
    assert capsys.readouterr().out == "label, 1.00 s: tap\n"
    assert main(["file", "label", str(path), "tap", "--remove"]) == main(["file", "--json", "label", str(path)]) == 0
    assert capsys.readouterr().out.splitlines()[1:] == ["[]"]
    assert main(["file", "label", str(path), "tap", "--remove"]) == 2
    assert "this recording has no labels with a text" in capsys.readouterr().err


def test_each_label_is_a_line_and_one_before_the_first_row_is_at_0(tmp_path: Path, capsys) -> None:
    path = tmp_path / "early.mcap"
    with biotac.open("sim:press.toml?fingers=1") as hand, hand.record(path):
        hand.mark("early")
        hand.read(1.0)
        hand.mark("late")
    assert main(["file", "label", str(path)]) == 0
    early, late = capsys.readouterr().out.splitlines()
    assert early == "label, 0.00 s: early" and late.endswith("late")
    assert main(["file", "label", str(path), "early", "--at", "0", "--remove"]) == 0
    assert main(["file", "label", str(path), "", "--fact", "subject=S07"]) == 0
    assert main(["file", "label", str(path), "", "--remove"]) == 0
