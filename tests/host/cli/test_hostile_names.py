"""Names that are not UTF-8 or hold escape sequences, streams that are closed, metadata that lies: no traceback."""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest
from record_all import blocks_of, record_all, written

import biotac
from biotac.cli.main import main

NOT_UTF8 = os.fsdecode(b"\xff\xfe")
ESCAPES = "\x1b[31m\nred"


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return record_all("sim:press.toml?seconds=0.5", tmp_path_factory.mktemp("hostile") / "a.mcap")


@pytest.mark.parametrize("name", [NOT_UTF8, ESCAPES])
def test_any_name_of_a_file_will_do(recorded: Path, tmp_path: Path, monkeypatch, capsys, name: str) -> None:
    monkeypatch.chdir(tmp_path)
    Path(f"{name}.mcap").write_bytes(recorded.read_bytes())
    calls = [
        ["check", f"{name}.mcap"],
        ["export", f"{name}.mcap", f"{name}.parquet"],
        ["export", f"{name}.mcap", f"{name}.ros2"],
        ["export", "--recompute", f"{name}.mcap", f"{name}.again.mcap"],
        ["export", f"{name}.mcap", "many", "--partition"],
        ["export", f"{name}.mcap", f"{name}.many", "--partition"],
    ]
    for argv in calls:
        assert main(argv) == 0, argv
    printed = capsys.readouterr()
    assert "\x1b" not in printed.out + printed.err


@pytest.mark.parametrize("redirect", [">&-", ">&- 2>&-", ">/dev/full"])
def test_a_stream_that_takes_nothing_is_no_traceback(recorded: Path, redirect: str) -> None:
    command = f'"$0" -m biotac check "$1" {redirect}'
    done = subprocess.run(["sh", "-c", command, sys.executable, str(recorded)], capture_output=True, check=False)
    assert done.returncode == (2 if "full" in redirect else 0) and b"Traceback" not in done.stderr


@pytest.mark.parametrize("serial", [[65] * 100_000, [300] * 12, [], "text", None])
def test_a_serial_number_of_any_length_is_refused(recorded: Path, tmp_path: Path, capsys, serial: object) -> None:
    """The checksum is right: the file was made so on purpose."""
    good = biotac.Recording(recorded)
    hello = json.dumps(json.loads(good.metadata["hello"]) | {"board_serial": serial})
    path = written(tmp_path / "hostile.mcap", good.metadata | {"hello": hello}, [(blocks_of(good)[0], 0)])
    with pytest.raises(biotac.RecordingError, match="damaged metadata"):
        biotac.Recording(path)
    assert main(["export", str(path), str(tmp_path / "many"), "--partition"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
