"""Board images in QEMU (firmware/boards/*/rig.toml), as much as a day has time for; at night they run tests/hil."""

import json
import re
import subprocess
from pathlib import Path
from typing import Any

import pytest

import biotac
from biotac import Calibration, PocWeights
from biotac.cli.main import main
from biotac.hand.opening import shake_hands
from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire
from biotac_rig.process import CommandBoard
from rig import all_rigs, require

BOARDS = {name: rig for name, rig in all_rigs().items() if "qemu_gateway" in rig.get("command", "")}


@pytest.fixture(params=BOARDS)
def board(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> dict[str, Any]:
    """While a test runs, emu:command is this image in QEMU."""
    facts = BOARDS[request.param]
    require(facts)
    monkeypatch.setenv("BIOTAC_SIM", facts["command"])
    return facts


@pytest.mark.nightly  # by day, the frames of two seconds come, none late or dropped
def test_it_is_healthy_with_five_fingers(board: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["doctor", "emu:command?source=press.toml&fingers=5", "--seconds", "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["findings"] == []


def test_a_command_longer_than_a_uarts_fifo_is_answered(board: dict[str, Any]) -> None:
    with biotac.open("emu:command?source=press.toml") as hand:
        own = Calibration(PocWeights.COMPRESS_N2, (1, 2, 3), (4, 5), 0, "", 1_763_731_310)
        hand.board.set_calibration(0, own)
        assert hand.board.calibration(0) == own


def test_the_hex_has_both_parts_of_an_f405s_image(board: dict[str, Any], tmp_path: Path) -> None:
    if board["board_id"] != wire.BoardKind.STM32F405:
        pytest.skip("another board's image may be in one part")
    made, whole = Path("build/f405/biotac-f405.hex"), tmp_path / "flash.bin"
    command = ["arm-none-eabi-objcopy", "-I", "ihex", "-O", "binary", "--gap-fill", "0xff"]
    subprocess.run([*command, made, whole], check=True)
    image = made.with_suffix(".bin").read_bytes()
    assert whole.read_bytes() == image[:8].ljust(0xC000, b"\xff") + image


def test_an_f405_sleeps_at_an_address_of_eight(board: dict[str, Any]) -> None:
    if board["board_id"] != wire.BoardKind.STM32F405:
        pytest.skip("ES0182 2.1.3 is of an STM32F405")
    listed = subprocess.run(
        ["arm-none-eabi-objdump", "-d", "build/f405/biotac-f405.elf"], capture_output=True, text=True, check=True
    ).stdout
    places = re.findall(r"^ *([0-9a-f]+):.*\twfi$", listed, re.MULTILINE)
    assert places and not [place for place in places if int(place, 16) % 8]


@pytest.mark.parametrize("seconds", [2, pytest.param(60, marks=pytest.mark.nightly)])
def test_it_computes_what_the_simulated_board_computes(board: dict[str, Any], seconds: int, tmp_path: Path) -> None:
    recording = tmp_path / "here.mcap"
    with biotac.open(f"emu:command?source=press.toml&fingers=5&seconds={seconds}") as hand:
        with hand.record(recording):
            here = hand.read_batch(1000).wire
        status, hello = hand.status(), hand.info
    assert (hello.board, hello.fingers) == (board["board_id"], 5)
    assert (len(here), status.slots_late, status.messages_dropped) == (500 * seconds, 0, 0)
    assert main(["check", str(recording)]) == 0
    with biotac.open(f"sim:press.toml?fingers=5&seconds={seconds}") as hand:
        in_qemu = hand.read_batch(1000).wire
    here["t_us"] -= here["t_us"][0] - in_qemu["t_us"][0]  # they do not start at the same microsecond
    assert here.tobytes() == in_qemu.tobytes()


def test_what_it_saved_is_there_after_a_restart(board: dict[str, Any], tmp_path: Path) -> None:
    source = load_source("press.toml", seconds=1)
    for expected in (100, 250, 260):
        kept = CommandBoard(source, pace=0.0, hold=True, flash=tmp_path / "flash.bin")
        with shake_hands(kept.link("qemu")) as hand:
            assert hand.board.settings()[biotac.Setting.IDLE_PERIOD_MS] == expected
            hand.board.set_setting(biotac.Setting.IDLE_PERIOD_MS, 250 if expected == 100 else 260)
            hand.board.save_settings()
