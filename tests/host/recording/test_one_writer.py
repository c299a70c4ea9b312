"""One output, one writer: no verb writes over the file it reads, and no two recorders write one file."""

import os
import shutil
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import pytest

import biotac
from biotac.cli.main import main
from biotac.errors import InputError

SIM = "sim:press.toml?seconds=2"
WAYS: dict[str, Callable[[Path], Path]] = {
    "the same name": lambda rec: rec,
    "..": lambda rec: rec.parent / "x" / ".." / rec.name,
    "a link": lambda rec: _made(rec.with_name("link.mcap"), lambda at: at.symlink_to(rec)),
    "a hard link": lambda rec: _made(rec.with_name("hard.mcap"), lambda at: os.link(rec, at)),
    "a folder's link": lambda rec: _made(rec.with_name("y"), lambda at: at.symlink_to(rec.parent)) / rec.name,
}
VERBS = {
    "cut": ["file", "cut", "REC", "OUT", "--from", "0", "--to", "1"],
    "recover": ["file", "recover", "REC", "OUT"],
    "recompute": ["export", "REC", "OUT", "--recompute"],
    "record": ["record", "replay:REC", "OUT"],
    "record, paced": ["record", "replay:REC?pace=fast", "OUT"],
}


def _made(at: Path, make: Callable[[Path], object]) -> Path:
    make(at)
    return at


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("one") / "a.mcap"
    assert main(["record", SIM, str(path)]) == 0
    return path


@pytest.mark.parametrize("way", WAYS)
@pytest.mark.parametrize("verb", VERBS)
def test_what_is_read_is_not_written_over(recorded: Path, tmp_path: Path, capsys, verb: str, way: str) -> None:
    rec = Path(shutil.copy(recorded, tmp_path))
    (tmp_path / "x").mkdir()
    before = rec.read_bytes()
    out = WAYS[way](rec)
    words = [word.replace("REC", str(rec)).replace("OUT", str(out)) for word in VERBS[verb]]
    assert main([*words, "--force"]) == 2
    assert "itself, which would be lost" in capsys.readouterr().err
    assert rec.read_bytes() == before
    assert not list(tmp_path.glob(".*"))  # nothing partial


@pytest.mark.parametrize("more", [[], ["--bringup"]])
@pytest.mark.parametrize("way", WAYS)
def test_a_report_is_not_written_over_what_it_is_about(
    recorded: Path, tmp_path: Path, capsys, way: str, more: list[str]
) -> None:
    rec = Path(shutil.copy(recorded, tmp_path))
    (tmp_path / "x").mkdir()
    before = rec.read_bytes()
    assert main(["doctor", f"replay:{rec}?pace=fast", "--report", str(WAYS[way](rec)), *more]) == 2
    assert "itself, which would be lost" in capsys.readouterr().err
    assert rec.read_bytes() == before


def test_a_bag_is_not_written_over_the_one_it_is_beside(recorded: Path, tmp_path: Path, capsys) -> None:
    pytest.importorskip("rosbags")
    bag = tmp_path / "a.bag"
    assert main(["export", str(recorded), str(bag)]) == 0
    assert main(["export", str(recorded), str(bag), "--beside", str(bag), "--force"]) == 2
    assert "itself, which would be lost" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["a.mcap", "link.mcap"])
def test_of_two_recorders_in_a_process_the_second_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "link.mcap").symlink_to(tmp_path / "a.mcap")
    with biotac.open(SIM) as first, biotac.open(SIM) as second:
        with first.record(tmp_path / "a.mcap", overwrite=True) as recorder:
            with pytest.raises(InputError, match="is being recorded to"):
                second.record(tmp_path / name, overwrite=True)
            first.stream("results")
            assert len(first.read(1.0))
        assert biotac.Recording(tmp_path / "a.mcap").problems == [] and recorder.frames > 50
        second.record(tmp_path / name, overwrite=True).close()  # the first is closed


def test_of_two_recorders_in_two_processes_the_second_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with biotac.open(SIM) as hand, hand.record(path):
        words = [sys.executable, "-m", "biotac", "record", SIM, str(path), "--force"]
        other = subprocess.run(words, capture_output=True, text=True)
        assert other.returncode == 2 and "is being recorded to" in other.stderr
        hand.stream("results")
        hand.read(1.0)
    assert biotac.Recording(path).problems == []


@pytest.mark.parametrize("change", ["cut", "emptied and written", "replaced", "deleted"])
def test_a_file_that_another_program_changes_is_told(recorded: Path, tmp_path: Path, change: str) -> None:
    path = tmp_path / "a.mcap"
    words = "was deleted" if change in ("replaced", "deleted") else "by another program"
    with pytest.raises(OSError, match=words), biotac.open(SIM.replace("2", "8")) as hand, hand.record(path):
        hand.stream("results")
        hand.read(2.0)
        if change == "cut":
            os.truncate(path, 100)
        elif change == "deleted":
            path.unlink()
        elif change == "replaced":
            os.replace(shutil.copy(recorded, tmp_path / "b.mcap"), path)
        else:
            path.write_bytes(recorded.read_bytes() * 9)
        hand.read(2.0)


def test_a_verdict_is_not_better_than_the_file(recorded: Path, tmp_path: Path, capsys) -> None:
    """A recording without the statistics: missing rows cannot be noticed."""
    rec = Path(shutil.copy(recorded, tmp_path))
    data = bytearray(rec.read_bytes())
    begin = _record_at(data, 0x0B)
    data[begin] = 0x7F  # an unknown kind of record
    rec.write_bytes(data)
    out = tmp_path / "a.csv"
    for words in (["check", str(rec)], ["info", str(rec)], ["export", str(rec), str(out)]):
        assert main(words) == 1, words
        output = capsys.readouterr()
        assert "it lacks its statistics" in output.err and ", good" not in output.out
    assert out.exists()
    assert main(["check", str(rec), "--json"]) == 1
    assert '"good": false' in capsys.readouterr().out


def _record_at(data: bytes, opcode: int) -> int:
    """Start of the last record of that kind, walking from the magic on."""
    at, found = 8, -1
    while at < len(data) - 8:
        found = at if data[at] == opcode else found
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    return found
