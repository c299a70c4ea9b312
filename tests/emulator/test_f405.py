"""The STM32F405's image in QEMU, as much of it as a day has time for; at night the rig f405_qemu runs tests/hil."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from kept_board import KeptBoard

import biotac
from biotac.cli.main import main
from biotac.hand.opening import shake_hands
from biotac.sim.loading import load_source
from biotac.sim.process import SimLink

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "hil"))

from rig import all_rigs, in_ci, prepare

FACTS = all_rigs()["f405_qemu"]


@pytest.fixture
def f405(monkeypatch: pytest.MonkeyPatch) -> None:
    """While a test runs, sim: is the image in QEMU."""
    if why := prepare(FACTS):
        pytest.fail(why) if in_ci() else pytest.skip(why)
    monkeypatch.setenv("BIOTAC_SIM", FACTS["command"])


def test_it_is_healthy_with_five_fingers(f405: None, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "sim:press.toml?fingers=5", "--seconds", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["findings"] == []


def test_it_computes_what_the_simulated_board_computes(
    f405: None, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    source, recording = "sim:press.toml?fingers=5&seconds=2", tmp_path / "here.mcap"
    with biotac.open(source) as hand:
        with hand.record(recording):
            here = hand.read_batch(1000).wire
        status, hello = hand.status(), hand.info
    assert (hello.board, hello.fingers, hello.map_bytes) == (FACTS["board_id"], 5, 0)
    assert (len(here), status.slots_late, status.messages_dropped) == (1000, 0, 0)
    assert main(["check", str(recording)]) == 0
    monkeypatch.delenv("BIOTAC_SIM")
    with biotac.open(source) as hand:
        there = hand.read_batch(1000).wire
    for field in set(here.dtype.names or ()) - {"t_us"}:  # its clock runs on while it works
        assert here[field].tobytes() == there[field].tobytes(), field


def test_what_it_saved_is_there_after_a_restart(f405: None, tmp_path: Path) -> None:
    source = load_source("press.toml", seconds=1)
    for expected in (100, 250, 260):
        link = SimLink("f405", KeptBoard(source, tmp_path / "flash.bin"))
        with shake_hands(link) as hand:
            assert hand.board.settings()[biotac.Setting.IDLE_PERIOD_MS] == expected
            hand.board.set_setting(biotac.Setting.IDLE_PERIOD_MS, 250 if expected == 100 else 260)
            hand.board.save_settings()
