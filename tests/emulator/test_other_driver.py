"""The sensors' image read as others read a BioTac: 0x0100 to listen, the select high between words, 1 MHz."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from biotac.wire import messages_gen as wire
from biotac.wire import sensor_gen as sensor
from biotac.wire.framing import encode

ROOT = Path(__file__).resolve().parents[2]
TOOLS = ("node", "npm", "clang", "wasm-ld", "arm-none-eabi-gcc")
SLOTS = 55
SETTLE_US, GAP_US = 50, 10
LISTEN_0100 = 0x0100
DELAY_WORD, EMPTY_WORD = 0xA52D, 0xA55F


@pytest.fixture(scope="session")
def image() -> Path:
    missing = [tool for tool in TOOLS if shutil.which(tool) is None]
    if missing:
        assert "BIOTAC_CI" not in os.environ, f"{missing} missing"
        pytest.skip(f"{', '.join(missing)} missing; tools/test installs what the emulated rig needs")
    subprocess.run([ROOT / "tools/emulator/prepare"], check=True)
    for words in (["-S", "firmware", "--preset", "pico-sensor"], ["--build", "build/pico-sensor"]):
        subprocess.run(["cmake", *words], check=True, cwd=ROOT, capture_output=True)
    return ROOT / "build/pico-sensor/biotac-sensor.bin"


def word_of(count: int) -> int:
    """By the product manual: two bytes of odd parity."""
    odd = lambda byte: byte | (byte.bit_count() + 1) % 2  # noqa: E731
    return odd(count >> 5 << 1) << 8 | odd((count & 31) << 3)


def run(image: Path, folder: Path, samples: list[int], course: list[dict[str, Any]]) -> dict[str, Any]:
    data = np.array(samples, "<u2").tobytes().ljust(220, b"\0")
    said = encode(wire.EmuPlug.ID, wire.EmuPlug(1, 0, 1, (0,) * 16).pack())
    said += encode(wire.EmuTape.ID, wire.EmuTape(2, 1, len(samples), 0, tuple(data)).pack())
    (folder / "said").write_bytes(said)
    (folder / "course").write_text(json.dumps(course))
    words = ["node", Path(__file__).with_name("other_driver.mjs"), image, folder / "said", folder / "course"]
    told: dict[str, Any] = json.loads(subprocess.run(words, check=True, capture_output=True).stdout)
    return told


def test_both_ways_of_reading_get_the_tape(image: Path, tmp_path: Path) -> None:
    rng = np.random.default_rng(19)
    samples = [int(count) for count in rng.integers(0, 4096, SLOTS)]
    course, expected = [], []
    for k in range(SLOTS):
        theirs = k < SLOTS // 2
        hz = 1e6 if theirs else 4.4e6
        listen = LISTEN_0100 if theirs else sensor.LISTEN_WORD
        command = sensor.CHANNEL_COMMAND[sensor.SLOTS[k % len(sensor.SLOTS)]]
        course.append({"mosi": command << 8, "hz": hz, "wait_us": SETTLE_US})
        course.append({"mosi": listen, "hz": hz, "wait_us": GAP_US})
        expected.append(word_of(samples[k]))
    told = run(image, tmp_path, samples, course)
    assert told["words"][1::2] == expected
    assert told["counters"]["late_edges"] == 0
    assert told["counters"]["answer_ns"] < 500  # what this driver leaves between select and clock


def test_the_fifty_microseconds_are_kept_and_a_sample_is_given_once(image: Path, tmp_path: Path) -> None:
    command = sensor.CHANNEL_COMMAND[sensor.SLOTS[0]] << 8
    steps = [(command, 30), (sensor.LISTEN_WORD, 51), (sensor.LISTEN_WORD, 20), (sensor.LISTEN_WORD, 20)]
    course = [{"mosi": mosi, "hz": 5e6, "wait_us": wait_us} for mosi, wait_us in steps]
    words = run(image, tmp_path, [1234, 77], course)["words"]
    assert words[1:] == [DELAY_WORD, word_of(1234), EMPTY_WORD]
