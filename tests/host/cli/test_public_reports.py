"""Symptoms of public bug reports of comparable projects, each tried here."""

import io
import math
import multiprocessing
import os
import pickle
import resource
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import biotac
from biotac.cli.main import main
from biotac.documents import read_text, write_new
from biotac.errors import InputError
from biotac.sim.loading import load_source


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("reports") / "a.mcap"
    assert main(["record", "sim:press.toml?seconds=2", str(path), "--fact", "subject=S07"]) == 0
    return path


def test_a_part_of_a_recording_can_be_pickled_and_given_to_another_process(recorded: Path) -> None:
    part = biotac.Recording(recorded).select(fingers="index")
    again = pickle.loads(pickle.dumps(part))
    assert again.rows.tobytes() == part.rows.tobytes()
    np.testing.assert_array_equal(again.label, part.label)
    assert again.to_pandas().equals(part.to_pandas())
    with multiprocessing.get_context("spawn").Pool(1) as pool:
        assert pool.map(len, [part]) == [len(part)]
    assert len(pickle.loads(pickle.dumps(part.resample(50.0)))) > 50


@pytest.mark.parametrize("fact", ["subject=Zo\udceb", "s\udcffbject=Zoe"])
def test_a_label_that_is_not_utf8_is_refused(recorded: Path, tmp_path: Path, capsys, fact: str) -> None:
    rec = shutil.copy(recorded, tmp_path)
    for words in (["x", "--at", "1", "--fact", fact], [fact, "--at", "1"]):
        assert main(["file", "label", str(rec), *words]) == 2
        assert "not UTF-8" in capsys.readouterr().err
    assert main(["record", "sim:press.toml?seconds=1", str(tmp_path / "b.mcap"), "--fact", fact]) == 2


def test_a_clock_before_1970_is_1970(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr("time.time_ns", lambda: -5_000_000_000)
    assert main(["record", "sim:press.toml?seconds=2", str(tmp_path / "a.mcap")]) == 0
    assert biotac.Recording(tmp_path / "a.mcap").problems == []


@pytest.mark.parametrize("name", ["-", "a", "a.csv"])
def test_a_recording_needs_its_suffix(tmp_path: Path, monkeypatch, capsys, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["record", "sim:press.toml?seconds=1", name, "--force"]) == 2
    assert "a recording is an .mcap file" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []


def test_too_many_open_files_is_no_matter_of_the_disk(recorded: Path, port: str) -> None:
    words = [sys.executable, "-m", "biotac", "record", port, str(recorded.with_name("e.mcap"))]

    def few() -> None:
        resource.setrlimit(resource.RLIMIT_NOFILE, (8, 8))

    done = subprocess.run(words, capture_output=True, text=True, preexec_fn=few)
    assert done.returncode == 2 and "ulimit -n" in done.stderr and "disk" not in done.stderr, done.stderr


@pytest.mark.parametrize("name", ["a?b.mcap", "a?pace=fast.mcap", "?.mcap"])
def test_a_question_mark_may_be_part_of_a_name(recorded: Path, tmp_path: Path, capsys, name: str) -> None:
    rec = shutil.copy(recorded, tmp_path / name)
    for port in (f"replay:{rec}", f"replay:{rec}?pace=fast"):
        assert main(["record", port, str(tmp_path / "out.mcap"), "--force"]) == 0
    with pytest.raises(InputError, match="cannot be read"):
        biotac.open(f"replay:{tmp_path}/not?there.mcap")


@pytest.mark.parametrize("age_s", [-1.0, 0.0, math.nan])
def test_an_age_that_shows_nothing_is_refused(age_s: float) -> None:
    with pytest.raises(InputError, match="max_age_s is"):
        biotac.open("sim:press.toml?seconds=1", max_age_s=age_s)


@pytest.mark.parametrize("words", [["", "--at", "1"], ["x", "--fact", "=y"]])
def test_a_label_or_a_fact_without_a_name_is_refused(recorded: Path, tmp_path: Path, capsys, words: list[str]) -> None:
    rec = shutil.copy(recorded, tmp_path)
    assert main(["file", "label", str(rec), *words]) == 2
    assert "expected" in capsys.readouterr().err and not list(tmp_path.glob("*.jsonl"))


def test_a_text_as_windows_editors_write_it_is_read(tmp_path: Path) -> None:
    """With a UTF-8 mark at the front and CR LF: Foxglove and many others had reports of the mark."""
    (tmp_path / "a.csv").write_bytes("time_s,fx\r\n0,1\r\n".encode("utf-8-sig"))
    assert read_text(tmp_path / "a.csv", 99) == "time_s,fx\r\n0,1\r\n"
    text = (Path(biotac.__file__).parent / "sim/scenarios/press.toml").read_text()
    (tmp_path / "a.toml").write_bytes(text.replace("\n", "\r\n").encode("utf-8-sig"))
    assert load_source(str(tmp_path / "a.toml")).samples.shape == load_source("press.toml").samples.shape


def test_a_pipe_is_no_recording_and_a_full_disk_has_a_name(tmp_path: Path, capsys) -> None:
    os.mkfifo(tmp_path / "a.mcap")
    assert main(["record", "sim:press.toml?seconds=1", str(tmp_path / "a.mcap"), "--force"]) == 2
    assert "is a pipe" in capsys.readouterr().err
    with pytest.raises(OSError, match="No space left on device: '/dev/full'"), biotac.open("sim:press.toml") as hand:
        hand.record("/dev/full", overwrite=True)
        hand.stream("results")
        hand.read(5.0)


@pytest.mark.skipif(sys.platform != "linux", reason="limits a process's memory")
def test_what_does_not_fit_into_memory_is_told(recorded: Path, tmp_path: Path) -> None:
    """A file of 20 GB that takes no room on the disk."""
    for name in ("a.csv", "a.toml", "a.uf2"):
        with (tmp_path / name).open("wb") as file:
            file.truncate(20 << 30)
    calibrate = ["calibrate", "wrench", str(recorded), "--finger", "0", "--out", "out", "--reference", "a.csv"]
    for words, seen in (
        (calibrate, "not enough memory"),
        (["record", "sim:a.toml", "b.mcap"], "larger than 1 MiB"),
        (["flash", "--emulated", "a.uf2"], "not a UF2 file"),
    ):
        program = f"import resource as r; r.setrlimit(r.RLIMIT_AS, ({2 << 30}, {2 << 30})); from biotac.cli.main import"
        program += f" main; raise SystemExit(main({words}))"
        done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 2 and seen in done.stderr and done.stderr.count("\n") == 1, done.stderr


def test_an_error_is_told_whatever_stands_for_stdout(monkeypatch, capsys) -> None:
    """As in a notebook or behind pytest's capture: it has no file descriptor."""
    monkeypatch.setattr(sys, "stdout", io.StringIO())
    assert main(["info", "n" * 300 + ".mcap"]) == 2
    assert "File name too long" in capsys.readouterr().err


def test_a_document_that_cannot_be_written_leaves_the_one_before(tmp_path: Path) -> None:
    write_new(tmp_path / "a.json", "before")
    with pytest.raises(UnicodeEncodeError):
        write_new(tmp_path / "a.json", "\udc00", overwrite=True)
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("a.json", "before")]


def test_a_name_of_any_length_that_the_disk_takes_will_do(recorded: Path, tmp_path: Path, monkeypatch) -> None:
    """Also where names made from it, for labels and unfinished files, would be too long."""
    monkeypatch.chdir(tmp_path)
    name = "n" * 250
    shutil.copy(recorded, f"{name}.mcap")
    assert main(["file", "cut", f"{name}.mcap", f"{name[1:]}m.mcap"]) == 0
    assert main(["export", f"{name}.mcap", f"{name}.npz"]) == 0


def test_a_suffix_in_capitals_is_one(tmp_path: Path) -> None:
    """As Windows and cameras write it; readers take it."""
    assert main(["record", "sim:press.toml?seconds=1", str(tmp_path / "A.MCAP")]) == 0
    assert main(["check", str(tmp_path / "A.MCAP")]) == 0


@pytest.mark.filterwarnings("ignore::biotac.ReadWarning")  # of the gap
def test_a_program_that_goes_to_another_folder_keeps_its_recordings(tmp_path: Path, monkeypatch) -> None:
    """As Hydra's do, a folder for each job."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "else").mkdir()
    with biotac.open("sim:press.toml?seconds=5", reconnect=True) as hand, hand.record("b.mcap") as recorder:
        hand.stream("results")
        hand.read(0.5)
        monkeypatch.chdir(tmp_path / "else")
        hand.board.restart()
        for _ in range(100):  # a busy machine needs longer to find the board again
            hand.read(0.5)
            if len(recorder.paths) > 1:
                break
    assert recorder.paths == [tmp_path / "b.mcap", tmp_path / "b.2.mcap"] and recorder.path.exists()
    monkeypatch.chdir(tmp_path)
    recording = biotac.Recording("b.mcap")
    monkeypatch.chdir(tmp_path / "else")
    assert len(recording.select()) > 30
