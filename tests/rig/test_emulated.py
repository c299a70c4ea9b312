"""An emulated board that lacks a file or program says so in one sentence, with the cure."""

import shutil
from pathlib import Path

import pytest

import biotac
from biotac.cli.main import main
from biotac.errors import PortError
from biotac_rig import emulated


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A clone of the repository in which everything is ready, as far as files tell."""
    files = ("tools/emulator/main.mjs", "build/emulator/sensors.wasm", "build/pico/biotac-pico.bin")
    for name in (*files, "tools/node_modules/rp2040js/package.json"):
        path = tmp_path / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.touch()
    monkeypatch.setenv("BIOTAC_EMULATOR", str(tmp_path / "tools/emulator"))
    monkeypatch.setattr(shutil, "which", lambda tool: f"/usr/bin/{tool}")
    return tmp_path


def refusal(port: str = "emu:pico?source=press.toml") -> str:
    with pytest.raises(PortError) as caught:
        biotac.open(port)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_a_clone_that_is_ready_is_found(clone: Path) -> None:
    tools = emulated.find_tools("pico", None)
    assert tools.image == clone / "build/pico/biotac-pico.bin"


def test_without_node(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(shutil, "which", lambda tool: None)
    assert "apt-get install nodejs" in refusal()


@pytest.mark.parametrize("missing", ["build/emulator/sensors.wasm", "tools/node_modules/rp2040js/package.json"])
def test_a_rig_that_is_not_prepared(clone: Path, missing: str) -> None:
    (clone / missing).unlink()
    (clone / missing).parent.rmdir()
    assert "tools/emulator/prepare" in refusal()


def test_without_an_image(clone: Path) -> None:
    assert "check the path" in refusal("emu:pico?source=press.toml&image=/nowhere.bin")
    (clone / "build/pico/biotac-pico.bin").unlink()
    assert "cmake -S" in refusal()


def test_a_pico_2_wants_what_is_fetched_by_hand(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    image = clone / "build/pico/biotac-pico.bin"
    port = f"emu:pico2?source=press.toml&image={image}"
    monkeypatch.delenv("BIOTAC_RP2350JS", raising=False)
    assert "pico2.md), and BIOTAC_RP2350JS is not set" in refusal(port)
    monkeypatch.setenv("BIOTAC_RP2350JS", str(image))
    assert emulated.find_tools("pico2", str(image)).chip == ["--chip", "rp2350", "--emulator", str(image)]


def test_outside_a_clone(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setenv("BIOTAC_EMULATOR", str(tmp_path))
    assert "BIOTAC_EMULATOR" in refusal()


def test_ports_that_name_nothing(clone: Path) -> None:
    assert "emu:pico" in refusal("emu:uno?source=press.toml")
    assert "no source" in refusal("emu:pico")
    assert "option 'finger'" in refusal("emu:pico?source=press.toml&finger=2")
    assert "option 'image'" in refusal("sim:press.toml?image=x.bin")
    assert "option 'pase'" in refusal("sim:press.toml?pase")


def test_an_image_for_a_board_that_has_none(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["sim", "press.toml", "--image", "x.bin"]) == 2
    assert "--board pico" in capsys.readouterr().err
