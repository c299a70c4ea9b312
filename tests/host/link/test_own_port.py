"""Another package's kind of port, added as the page says, and extras that are missing or fail."""

import importlib.metadata
import subprocess
import sys
from contextlib import closing
from pathlib import Path

import pytest
from served_board import ServedBoard

import biotac
from biotac.cli.main import main
from biotac.sim.loading import load_source

EXAMPLE = Path(__file__).resolve().parents[3] / "host/docs/guides/examples/pipe_port"
PUMP = """
import os, select, sys
board = os.open(sys.argv[1], os.O_RDWR | os.O_NOCTTY)
while True:
    for end in select.select([0, board], [], [])[0]:
        os.write(1 if end == board else board, os.read(end, 65536))
"""


def installed(folder: Path, monkeypatch: pytest.MonkeyPatch, source: Path) -> None:
    how = ["install", "--quiet", "--no-deps", "--no-index", "--no-build-isolation", "--target", str(folder)]
    copied = folder / "source"
    subprocess.run(["cp", "-r", source, copied], check=True)  # setuptools builds beside it
    subprocess.run([sys.executable, "-m", "pip", *how, copied], check=True)
    monkeypatch.syspath_prepend(str(folder))


def test_the_examples_package_adds_a_port_that_reads_a_board(tmp_path: Path, monkeypatch) -> None:
    installed(tmp_path, monkeypatch, EXAMPLE)
    assert "biotac_pipe" not in sys.modules
    (tmp_path / "pump.py").write_text(PUMP)
    board = ServedBoard(load_source("press.toml", seconds=3), pace=1.0)
    with closing(board), biotac.open(f"pipe:{sys.executable} {tmp_path / 'pump.py'} {board.path}") as hand:
        assert len(hand.read(0.5)) >= 50
    body = (EXAMPLE / "biotac_pipe.py").read_text().partition("class PipeLink")[2].splitlines()[1:]
    heads = ("def ", "with ")
    assert sum(bool(line.strip()) and not line.strip().startswith(heads) for line in body) <= 10


NEEDS_THE_RIG = (
    "needs biotac-rig, which is not installed; pip install biotac-rig, in a clone pip install ./host/biotac-rig"
)


def test_an_extra_that_fails_names_itself(tmp_path: Path, monkeypatch, capsys) -> None:
    facts = tmp_path / "theirs-2.1.dist-info"
    facts.mkdir()
    (facts / "METADATA").write_text("Metadata-Version: 2.1\nName: theirs\nVersion: 2.1\n")
    points = "[biotac.ports]\nworn = worn:Port\nrough = rough:Port\n[biotac.bridges]\nworn = worn\n"
    (facts / "entry_points.txt").write_text(points)
    (tmp_path / "worn.py").write_text("import nobody_has_this")
    (tmp_path / "rough.py").write_text("class Port:\n def __init__(self, port, pace): [][0]\n")
    monkeypatch.syspath_prepend(str(tmp_path))
    for kind, why in (("worn", "nobody_has_this"), ("rough", "IndexError")):
        with pytest.raises(biotac.InputError, match=f"{kind}, an extra of theirs 2.1, failed .*{why}.*update theirs"):
            biotac.open(f"{kind}:x")
    assert main(["share", "sim:press.toml", "--by", "worn"]) == 2
    assert "an extra of theirs 2.1" in capsys.readouterr().err
    assert "worn" not in sys.modules and "rough" in sys.modules


def test_what_is_not_installed_is_told_with_its_line(monkeypatch, capsys) -> None:
    monkeypatch.setattr(importlib.metadata, "distributions", list)
    for words in (
        ["info", "emu:pico?source=press.toml"],
        ["doctor", "/dev/ttyACM0", "--sensor-port", "/dev/ttyACM1"],
        ["sim", "press.toml", "--sensor-port", "/dev/ttyACM1"],
        ["sim", "press.toml", "--board", "pico"],
        ["flash", "--emulated", str(EXAMPLE / "no.uf2")],
    ):
        code = main(words)
        error = capsys.readouterr().err
        if words[0] != "flash":  # flash looks for the image first
            assert code in (2, 3) and NEEDS_THE_RIG in error
        assert error.count("\n") == 1
    assert main(["share", "sim:press.toml", "--by", "nobody"]) == 2
    assert "no bridge 'nobody' is installed" in capsys.readouterr().err
