"""The C client: small, self-contained, and in agreement with Python on a simulated board."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from served_board import ServedBoard

import biotac
from biotac.sim import SimFinger, SimTouch, world
from biotac.sim.loading import load_source

CLIENT = Path(__file__).resolve().parents[2] / "firmware" / "client"
WARNINGS = ["-Wall", "-Wextra", "-Wpedantic", "-Wconversion", "-Wsign-conversion", "-Wcast-qual", "-Werror"]
M4 = ["arm-none-eabi-gcc", "-mcpu=cortex-m4", "-mthumb"]
COMPILERS = [
    *([compiler, f"-std={standard}"] for compiler in ("gcc", "clang") for standard in ("c99", "c11")),
    *([compiler, "-std=c++17", "-x", "c++"] for compiler in ("g++", "clang++")),
    [*M4, "-std=c99"], [*M4, "-std=c++17", "-x", "c++"],
]  # fmt: skip
EXAMPLES = CLIENT.parents[1] / "host/docs/guides/examples"
MOST_BYTES = 4096
FRAMES = 150


@pytest.mark.parametrize("speed", ["-Os", "-O2"])
def test_it_is_small_and_needs_nothing(tmp_path: Path, speed: str) -> None:
    target = ["-std=c11", "-mcpu=cortex-m0plus", "-mthumb", "-ffreestanding", speed, *WARNINGS]
    made = tmp_path / "client.o"
    subprocess.run(["arm-none-eabi-gcc", *target, "-c", str(CLIENT / "biotac_client.c"), "-o", str(made)], check=True)
    output = subprocess.run(["arm-none-eabi-size", str(made)], capture_output=True, text=True, check=True).stdout
    text, data, bss = map(int, output.splitlines()[1].split()[:3])
    assert text < MOST_BYTES and data == bss == 0  # no state but the caller's
    needed = subprocess.run(["arm-none-eabi-nm", "-u", str(made)], capture_output=True, text=True, check=True).stdout
    assert needed.split() == []  # no heap, no libc


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("client") / "example"
    build = ["cc", "-std=gnu11", *WARNINGS, "-fsanitize=address,undefined"]
    subprocess.run([*build, CLIENT / "example.c", CLIENT / "biotac_client.c", "-o", made], check=True)
    return made


def test_the_example_prints_the_frames_that_python_reads(program: Path) -> None:
    assert len((CLIENT / "example.c").read_text().splitlines()) <= 60
    source = load_source("press.toml", fingers=2, seconds=120.0)  # a busy computer starts the program late
    board = ServedBoard(source, pace=1.0, hold=True)
    try:
        board.release()
        done = subprocess.run([str(program), board.path, str(FRAMES)], capture_output=True, text=True, check=True)
    finally:
        board.close()
    output = [
        tuple(int(word, 16 if k == 5 else 10) for k, word in enumerate(line.split()))
        for line in done.stdout.splitlines()
    ]
    assert len(output) == FRAMES
    with biotac.open("sim:press.toml?fingers=2&seconds=120") as hand:
        hand.stream()
        wire = {}
        for batch in hand.batches():
            wire |= {(int(m["finger"]), int(m["t_us"])): m for m in batch.wire}
            if wire and max(t_us for _, t_us in wire) > max(t_us for _, t_us, *_ in output) + 20_000:
                break
    for finger, t_us, x, y, z, flags, trust in output:
        message = wire[finger, t_us]
        assert (message["force_100un"].tolist(), int(message["flags"])) == ([x, y, z], flags)
        assert int(message["trust"]) == trust
    assert any(abs(z) < 2**31 - 1 for *_, z, _, _ in output)


def test_a_program_in_c_closes_its_loop_over_a_simulated_finger(tmp_path: Path) -> None:
    """It presses until it feels 2 N; this computer's world knows which load that takes."""
    build = ["cc", "-std=gnu11", *WARNINGS, "-fsanitize=address,undefined"]
    subprocess.run(
        [*build, f"-I{CLIENT}", EXAMPLES / "press_loop.c", CLIENT / "biotac_client.c", "-o", tmp_path / "loop"],
        check=True,
    )
    command = [sys.executable, "-m", "biotac", "sim", "--live", "index", "--json"]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as board:
        assert board.stdout is not None
        facts = json.loads(board.stdout.readline())
        arguments = [tmp_path / "loop", facts["port"], str(facts["loads"]), facts["token"]]
        done = subprocess.run(arguments, capture_output=True, text=True, check=True)
        board.terminate()
    rounds = [tuple(map(float, line.split())) for line in done.stdout.splitlines()]
    assert [seq for seq, *_ in rounds] == list(range(1, 801))
    assert all(abs(felt_n - 2.0) < 0.2 for *_, felt_n in rounds[-50:])
    with world({"index": SimFinger(1)}) as w:
        w.run(5.0)
        felt = w.run(1.0, index=SimTouch(rounds[-1][1]))["index"].frame
        assert felt is not None and abs(felt.force_n[2] - 2.0) < 0.4


@pytest.mark.parametrize("compiler", COMPILERS, ids=" ".join)
def test_it_compiles_wherever_a_hands_controller_does(tmp_path: Path, compiler: list[str]) -> None:
    in_c = [] if "c++" in compiler else [CLIENT.parents[1] / "host/docs/guides/examples/grip.c"]
    for source in (CLIENT / "biotac_client.c", EXAMPLES / "example_bare.c", *in_c):
        command = [*compiler, *WARNINGS, f"-I{CLIENT}", "-c", str(source), "-o", str(tmp_path / "x.o")]
        subprocess.run(command, check=True)


def test_a_program_in_cpp_links_it(tmp_path: Path) -> None:
    """The client built as C, a program in C++ that also includes the core's header."""
    (tmp_path / "main.cpp").write_text(
        '#include "wire/messages_gen.h"\n#include "biotac_client.h"\n'
        "int main() {\n"
        "    static bt_client board;\n"
        "    bt_client_rounds finger = {};\n"
        "    bool lost = bt_client_lost(&finger, 65534, 1) == 0 && bt_client_lost(&finger, 1, 3) == 0\n"
        "                && bt_client_lost(&finger, 4, 1) == 2 && bt_client_lost(&finger, 9, 2) == 3;\n"
        "    bool valid = !bt_valid_i32(BT_INVALID_I32) && bt_valid_i32(0) && !bt_valid_count(65535);\n"
        "    return lost && valid ? bt_client_push(&board, 0) : 1;\n"
        "}\n"
    )
    core = CLIENT.parent / "core"
    subprocess.run(["gcc", "-std=c99", "-c", str(CLIENT / "biotac_client.c"), "-o", str(tmp_path / "c.o")], check=True)
    words = ["-std=c++17", *WARNINGS, f"-I{CLIENT}", f"-I{core}", str(tmp_path / "main.cpp"), str(tmp_path / "c.o")]
    subprocess.run(["g++", *words, "-o", str(tmp_path / "main")], check=True)
    subprocess.run([str(tmp_path / "main")], check=True)


@pytest.mark.nightly
def test_a_controller_without_an_operating_system_reads_a_hand_over_its_uart() -> None:
    """example_bare.c on an STM32F405 in QEMU; the UART leads to a simulated board."""
    subprocess.run(["arm-none-eabi-gcc", "--version"], check=True, capture_output=True)  # CMake says less
    for words in (["-S", "firmware", "--preset", "f405"], ["--build", "build/f405"]):
        subprocess.run(["cmake", *words], cwd=CLIENT.parents[1], check=True, capture_output=True)
    # Slowly: QEMU keeps this computer's time, however busy, and gives up a board that is silent for 500 ms.
    board = ServedBoard(load_source("press.toml", fingers=2, seconds=60.0), pace=0.25, hold=True)
    image = str(CLIENT.parents[1] / "build/f405/f405-client.elf")
    command = ["qemu-system-arm", "-M", "netduinoplus2", "-kernel", image]
    command += ["-display", "none", "-monitor", "none", "-serial", "null", "-serial", "null"]
    command += ["-serial", board.path, "-semihosting-config", "enable=on,target=native"]
    try:
        board.release()
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    finally:
        board.close()
    *acted, last = done.stderr.splitlines()
    forces = [tuple(int(word, 16) for word in line.split()) for line in acted]
    assert len(forces) in (100, 101) and last == "00000000 lost"  # a poll may bring both fingers of a round
    assert {finger for finger, *_ in forces} == {0, 1}
    with biotac.open("sim:press.toml?fingers=2&seconds=60") as hand:
        output = hand.read_batch(4000).wire
    published = {(int(m["finger"]), *(int(f) & 0xFFFFFFFF for f in m["force_100un"])) for m in output}
    assert set(forces) <= published


def test_what_is_on_no_port_is_said_in_words(program: Path) -> None:
    done = subprocess.run([str(program), "/dev/null", "1"], capture_output=True, text=True, check=False)
    assert done.returncode == 2 and "usage: example PORT FRAMES" in done.stderr
