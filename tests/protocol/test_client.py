"""The C client: small, alone, and of the same opinion as Python on a simulated board."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import pytest

import biotac
from biotac.cli.live.sim import prepare
from biotac.sim.loading import load_source
from biotac.sim.ports import start_board

CLIENT = Path(__file__).resolve().parents[2] / "firmware" / "client"
WARNINGS = ["-Wall", "-Wextra", "-Wconversion", "-Wsign-conversion", "-Wcast-qual", "-Werror"]
MOST_BYTES = 4096
FRAMES = 150


@pytest.mark.skipif(not shutil.which("arm-none-eabi-gcc"), reason="no arm-none-eabi-gcc to build for a Cortex-M0+ with")
@pytest.mark.parametrize("speed", ["-Os", "-O2"])
def test_it_is_small_and_needs_nothing(tmp_path: Path, speed: str) -> None:
    target = ["-std=c11", "-mcpu=cortex-m0plus", "-mthumb", "-ffreestanding", speed, *WARNINGS]
    made = tmp_path / "client.o"
    subprocess.run(["arm-none-eabi-gcc", *target, "-c", str(CLIENT / "biotac_client.c"), "-o", str(made)], check=True)
    told = subprocess.run(["arm-none-eabi-size", str(made)], capture_output=True, text=True, check=True).stdout
    text, data, bss = map(int, told.splitlines()[1].split()[:3])
    assert text < MOST_BYTES and data == bss == 0  # no state but the caller's
    needed = subprocess.run(["arm-none-eabi-nm", "-u", str(made)], capture_output=True, text=True, check=True).stdout
    assert needed.split() == []  # no heap, no libc


def test_the_example_prints_the_frames_that_python_reads(tmp_path: Path) -> None:
    program = tmp_path / "example"
    sources = [str(CLIENT / name) for name in ("example.c", "biotac_client.c")]
    build = ["cc", "-std=gnu11", *WARNINGS, "-fsanitize=address,undefined", *sources, "-o", str(program)]
    subprocess.run(build, check=True)
    assert len((CLIENT / "example.c").read_text().splitlines()) <= 60
    source = load_source("press.toml", fingers=2, seconds=30.0)
    board = start_board("posix", source, pace=1.0)
    try:
        prepare(board)
        done = subprocess.run([str(program), board.path, str(FRAMES)], capture_output=True, text=True, check=True)
    finally:
        board.close()
    told = [
        tuple(int(word, 16 if k == 5 else 10) for k, word in enumerate(line.split()))
        for line in done.stdout.splitlines()
    ]
    assert len(told) == FRAMES
    with biotac.open("sim:press.toml?fingers=2&seconds=30") as hand:
        hand.stream()
        wire = {}
        for batch in hand.batches():
            wire |= {(int(m["finger"]), int(m["t_us"])): m for m in batch.wire}
            if wire and max(t_us for _, t_us in wire) > max(t_us for _, t_us, *_ in told) + 20_000:
                break
    for finger, t_us, x, y, z, flags in told:
        message = wire[finger, t_us]
        assert (message["force_100un"].tolist(), int(message["flags"])) == ([x, y, z], flags)
    assert any(abs(z) < 2**31 - 1 for *_, z, _ in told)


def test_what_is_on_no_port_is_said_in_words(tmp_path: Path) -> None:
    program = tmp_path / "example"
    subprocess.run(
        ["cc", "-std=gnu11", str(CLIENT / "example.c"), str(CLIENT / "biotac_client.c"), "-o", str(program)], check=True
    )
    done = subprocess.run([str(program), "/dev/null", "1"], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "usage: example PORT FRAMES" in done.stderr
