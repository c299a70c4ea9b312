"""The emulated sensors as WebAssembly answer as they do natively, whatever is done to their bus."""

from __future__ import annotations

import os
import shutil
import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest

from biotac.sim.source import Source
from biotac.sim.tape import CODES, write_tape

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
FIRMWARE = ROOT / "firmware"
TOOLS = ("cc", "node", "npm", "clang", "wasm-ld")
STEPS = 100_000
FRAMES = 600  # the course goes on behind the last
LISTEN = 0xFFFF


@pytest.fixture(scope="session")
def native(tmp_path_factory: pytest.TempPathFactory) -> Path:
    missing = [tool for tool in TOOLS if shutil.which(tool) is None]
    if missing:
        assert "BIOTAC_CI" not in os.environ, f"{missing} missing"
        pytest.skip(f"{', '.join(missing)} missing; tools/test installs what the emulated rig needs")
    subprocess.run([ROOT / "tools/emulator/prepare"], check=True)
    program = tmp_path_factory.mktemp("native") / "course"
    sources = [FIRMWARE / "emu" / f"{name}.c" for name in ("bus", "device", "tape")]
    words = ["cc", "-std=c11", "-O1", f"-I{FIRMWARE / 'emu'}", f"-I{FIRMWARE / 'core'}", HERE / "course.c"]
    subprocess.run([*words, *sources, FIRMWARE / "core/sensor_gen.c", "-o", program], check=True)
    return program


def random_course(rng: np.random.Generator) -> bytes:
    """Mostly what a driver does, at all distances in time; and much that none should."""
    out = bytearray()
    now = 0
    for kind in rng.random(STEPS):
        now += int(rng.choice([0, 1, 3636, 49_999, 50_000, 50_001, 227_273]))
        if kind < 0.5:
            mask = int(rng.choice([0, 0, 1, 2, 4, 8, 16, 31, int(rng.integers(32))]))
            out += struct.pack("<IIQ", 0, mask, now)
            continue
        command = 0x81 | int(rng.integers(64)) << 1
        sample = (command ^ (bin(command).count("1") % 2 == 0)) << 8  # with odd parity
        prop = 0x6100 | int(rng.integers(256))
        anything = int(rng.integers(0x10000))
        mosi = int(rng.choice([LISTEN, LISTEN, LISTEN, 0, sample, sample, sample, prop, anything]))
        out += struct.pack("<IIQ", 1, mosi, now)
    return bytes(out)


@pytest.mark.parametrize("seed", range(4))
def test_the_same_words_on_a_random_course(native: Path, tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    samples = rng.integers(0, 4096, (FRAMES, int(rng.integers(1, 6)), 44)).astype(np.uint16)
    faulty = rng.random(samples.shape) < 0.2
    samples[faulty] = rng.choice(np.array(CODES, dtype=np.uint16), int(faulty.sum()))
    tape = tmp_path / "counts.tape"
    write_tape(tape, Source(name="random", samples=samples))
    course = random_course(rng)
    here = subprocess.run([native, tape], input=course, capture_output=True, check=True).stdout
    wasm = ROOT / "build/emulator/sensors.wasm"
    there = subprocess.run(["node", HERE / "course.mjs", wasm, tape], input=course, capture_output=True, check=True)
    words = np.frombuffer(here, dtype="<u2")
    assert len(np.unique(words)) > 1000  # the course does reach the sensors
    assert there.stdout == here
