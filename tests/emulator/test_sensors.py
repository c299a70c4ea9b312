"""The emulated sensors as WebAssembly answer as the native ones do, under any course of the bus."""

import struct
import subprocess
from pathlib import Path

import numpy as np
import pytest

from biotac.sim.source import CODES, Source
from biotac.wire import sensor_gen as _sensor
from biotac_rig.tape import write_tape

ROOT = Path(__file__).resolve().parents[2]
HERE = Path(__file__).resolve().parent
FIRMWARE = ROOT / "firmware"
SLOTS = 20_000
FRAMES = 100  # the course goes on behind the last
LISTEN = _sensor.LISTEN_WORD


@pytest.fixture(scope="session")
def native(emulated_pico: None, tmp_path_factory: pytest.TempPathFactory) -> Path:
    program = tmp_path_factory.mktemp("native") / "course"
    sources = [FIRMWARE / "emu" / f"{name}.c" for name in ("bus", "device", "stream", "by_clock")]
    words = ["cc", "-std=c11", "-O1", f"-I{FIRMWARE / 'emu'}", f"-I{FIRMWARE / 'core'}", HERE / "course.c"]
    subprocess.run([*words, *sources, FIRMWARE / "core/wire/sensor_gen.c", "-o", program], check=True)
    return program


class Course:
    """Steps on the bus, in time."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng = rng
        self.steps = bytearray()
        self.now = 0

    def select(self, mask: int) -> None:
        self.steps += struct.pack("<IIQ", 0, mask, self.now)

    def transfer(self, mosi: int) -> None:
        self.steps += struct.pack("<IIQ", 1, mosi, self.now)

    def wait(self, *choices: int) -> None:
        self.now += int(self.rng.choice(choices))

    def command(self) -> int:
        command = 0x81 | int(self.rng.integers(64)) << 1
        sample = (command ^ (bin(command).count("1") % 2 == 0)) << 8  # with odd parity
        properties = 0x6100 | int(self.rng.integers(8))
        return int(self.rng.choice([sample, sample, sample, properties, int(self.rng.integers(0x10000))]))

    def slot(self) -> None:
        """Steps of a driver, sometimes too early."""
        mask = int(self.rng.integers(32))
        self.select(mask)
        self.transfer(self.command())
        self.select(0)
        self.wait(49_999, 50_000, 50_001, 60_000, 200_000)
        for finger in range(5):
            if mask >> finger & 1:
                self.select(1 << finger)
                self.transfer(LISTEN)
                self.select(0)
                self.wait(0, 3636)

    def anything(self) -> None:
        """Steps that no driver should take."""
        if self.rng.random() < 0.5:
            self.select(int(self.rng.integers(32)))
        else:
            self.transfer(int(self.rng.choice([LISTEN, 0, self.command()])))
        self.wait(0, 1, 3636, 50_000)


def random_course(rng: np.random.Generator) -> bytes:
    course = Course(rng)
    for kind in rng.random(SLOTS):
        if kind < 0.8:
            course.slot()
        else:
            course.anything()
    return bytes(course.steps)


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.nightly) for seed in range(1, 4))])
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
