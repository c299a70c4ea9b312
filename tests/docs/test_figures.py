"""Figures in pages: constants where the code has them, and measurements as the command that made them repeats them."""

import dataclasses
import importlib
import os
import re
import shutil
import subprocess
from pathlib import Path

import pytest

import figures

ROOT = Path(__file__).parents[2]
SAFETY, PICO = "host/docs/reference/safety.md", "firmware/boards/pico/README.md"
MODEL, PHYSICS = "host/docs/reference/sensor_model.md", "host/biotac/sim/physics.py"
SAMPLING = "host/biotac/sim/sampling.py"
SPEC, LINK = "protocol/SPEC.md", "protocol/link.toml"
SYSTEM, CONTROLLER = "firmware/port/rp2/system.c", "firmware/port/rp2/usb/controller.c"
WORDS = {"two": 2.0, "ten": 10.0}
#: A page and words of it, a file of the code and words of it, and how many of the code's make one of the page's.
FIGURES = [
    (SAFETY, r"the firmware hangs .*TARE_RESTORED.* (\d+) s, an exception", SYSTEM, r"WATCHDOG_US (\d+)u", 1e6),
    (SAFETY, r"the firmware hangs .* (\d+) s, an exception", "firmware/port/rp2040/boot2.S", r"=2 \* (\d+)", 1e6),
    (SAFETY, r"the firmware hangs .* (\d+) s, an ", "firmware/port/stm32f405/clocks.c", r"RLR = (\d+)", 32000 / 64),
    (PICO, r"restarts the board after (\w+) seconds", SYSTEM, r"WATCHDOG_US (\d+)u", 1e6),
    ("firmware/boards/f405/README.md", r"after (\w+) seconds", "firmware/port/stm32f405/clocks.c", r"RLR = (\d+)", 500),
    ("firmware/port/README.md", r"a halt of (\w+) seconds", SYSTEM, r"WATCHDOG_US (\d+)u", 1e6),
    (SAFETY, r"no start of frame for (\d+) ms", CONTROLLER, r"SUSPENDED_US +(\d+)u", 1e3),
    (PICO, r"hears no frame for (\d+) ms", CONTROLLER, r"SOF_TIMEOUT_US (\d+)u", 1e3),
    (SAFETY, r"hold_timeout_ms` \| 1 s; (\d+) s", LINK, r"hold_timeout_ms\](?s:.*?)default = ([\d_]+)", 1e3),
    (MODEL, r"gap of (\d) mm", PHYSICS, r"GAP_MM = ([\d.]+)", 1),
    (MODEL, r"at (4\.5) N", PHYSICS, r"PLATE_N, FAINT_N = ([\d.]+)", 1),
    (MODEL, r"tanh\(C g_i / (.*?)\)", PHYSICS, r"SQUEEZE_MAX = ([\d.]+)", 1),
    (MODEL, r"L = (\d) per N", PHYSICS, r"SQUEEZE_MAX_PER_N = ([\d.]+)", 1),
    (MODEL, r"T / (\d+) rad", PHYSICS, r"TORSION_NMM_PER_RAD = ([\d.]+)", 1),
    (MODEL, r"exp\(-(0?\.\d+) \(t - 30 C", PHYSICS, r"TEMPERATURE_PER_C = -([\d.]+)", 1),
    (MODEL, r"by a lag of (\d+) s \| free", SAMPLING, r"\nCREEP_S = ([\d.]+)", 1),
    (MODEL, r"(\d+) counts/N \* F", SAMPLING, r"PDC_PER_N, PDC_NOISE = ([\d.]+)", 1),
    (MODEL, r"undershoot (\d+) tanh", SAMPLING, r"PDC_UNDERSHOOT, PDC_UNDERSHOOT_AT, PDC_UNDERSHOOT_S = ([\d.]+)", 1),
    (SPEC, r"\(after (\w+) times", "firmware/core/talk/sensors.c", r"LATE_AFTER +(\d+)", 1),
]


@pytest.mark.parametrize(("page", "words", "code", "constant", "unit"), FIGURES)
def test_a_page_has_the_codes_figure(page: str, words: str, code: str, constant: str, unit: float) -> None:
    stated = re.search(words, (ROOT / page).read_text(encoding="utf-8"))
    done = re.search(constant, (ROOT / code).read_text(encoding="utf-8"))
    assert stated is not None and done is not None, (stated, done)
    assert (WORDS.get(stated[1]) or float(stated[1])) == float(done[1].replace("_", "")) / unit


KEPT = pytest.mark.parametrize("figure", figures.found(), ids=lambda figure: figure.name)


@pytest.mark.nightly
@KEPT
def test_a_figure_is_what_its_command_measures(figure: figures.Figures) -> None:
    missing = [word for word in figure.command.split() if word.startswith("../") and not (ROOT / word).exists()]
    if figure.command.startswith("tools/bench") and not shutil.which("arm-none-eabi-gcc"):
        missing.append("arm-none-eabi-gcc")
    if missing and not (os.environ.get("BIOTAC_CI") and missing == ["arm-none-eabi-gcc"]):
        pytest.skip(f"{figure.name} needs {', '.join(missing)}")
    assert figure.differences(figure.measured()) == [], f"run tools/make/figures.py {figure.file.name}"


@KEPT
def test_nobody_edited_a_figure_or_drew_its_picture_otherwise(figure: figures.Figures) -> None:
    assert figure.hashes.split(", ")[1] == figure.hashes_of(figure.text).split(", ")[1]


@pytest.mark.nightly
@KEPT
def test_a_figure_was_made_of_what_its_inputs_are_now(figure: figures.Figures) -> None:
    assert figure.hashes.split(", ")[0] == figures.inputs_hash(figure.inputs), "run tools/make/figures.py --changed"


def test_a_difference_is_named() -> None:
    text = "| PoC | 1,476 | .92 |\n| force | 402 | - |"
    figure = figures.Figures(ROOT / "page.md", "echo", "", "LICENSE", 1.0, "?", text)
    assert figure.differences(text) == figure.differences(text.replace("402", "405")) == []
    assert figure.differences(text.replace("402", "407")) == ["402 is 407 now, more than 1 % off"]
    assert figure.differences(text.replace("1,476", "1,400")) == ["1476 is 1400 now, more than 1 % off"]
    assert figure.differences(text + "\n| torque | 7 |") == figure.differences(text.replace("- |", "none |"))
    assert figure.differences(text + "\n| torque | 7 |") == ["other words or rows"]


def test_a_block_is_written_once_and_read_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page, head = tmp_path / "page.md", "<!-- figures: COMMAND | LICENSE | within 1 % | made of ?, ? -->"
    (tmp_path / "tools/make").mkdir(parents=True)
    shutil.copy(figures.__file__, tmp_path / "tools/make/figures_here.py")
    monkeypatch.syspath_prepend(str(tmp_path / "tools/make"))
    here = importlib.import_module("figures_here")
    page.write_text(f"7\n{head.replace('COMMAND', 'echo 7 page.md')}\n-\n<!-- end of figures -->\n", encoding="utf-8")
    for words in (["git", "init", "-q"], ["git", "add", "page.md"]):
        subprocess.run(words, cwd=tmp_path, check=True)
    (figure,) = here.found(["page"])
    figure.write(figure.measured())
    (again,) = here.found(["page"])
    assert again.text == "7 page.md" == again.measured()
    assert again.hashes == again.hashes_of(again.text)
    assert dataclasses.replace(again, text="8 page.md").hashes != again.hashes_of("8 page.md")
    assert page.read_text(encoding="utf-8").startswith("7\n<!-- figures: echo 7 page.md |")
