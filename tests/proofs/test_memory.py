"""Readers of bytes from outside (frames, records in flash, maps) touch nothing beside their buffers. And no step
of the sums of force and torque overflows.

Frama-C's Eva follows every value that a variable can have through the C of the board (int, pointers and shifts of a
32-bit machine) and tells of each access, conversion and overflow that it cannot exclude; there must be none. It cannot
follow the two indices of bt_cobs_decode: WP proves them from the invariants in that function.

Taken for granted: a CRC's and COBS's word loops are proved at every length alone, each at one alignment;
coefficients of maps and commands are not proved.
"""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MEMORY = "tests/proofs/memory"
CORE = "firmware/core"
PROVED_APART = "bt_cobs_decode,bt_cobs_in_place,bt_crc32"
WORDS = (f"{MEMORY}/words.c", f"{CORE}/wire/cobs.c", f"{CORE}/wire/crc32.c", f"{CORE}/wire/crc32_gen.c")

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.skipif(shutil.which("frama-c") is None, reason="frama-c is missing (Debian: frama-c-base why3 z3)"),
]


def analysed(*arguments: str, defines: str = "") -> str:
    preprocessor = f"-I{CORE} -include {MEMORY}/contracts.h {defines}"
    command = ["frama-c", "-c11", "-machdep", "gcc_x86_32", f"-cpp-extra-args={preprocessor}", *arguments]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout[-4000:]
    return done.stdout


def nothing_is_left_open(output: str) -> None:
    """Eva came to the end without an alarm, and every check that was reached holds."""
    alarms = re.findall(r"\[eva:alarm\].*\n.*", output)
    assert "0 alarms generated" in output and not alarms, "\n".join(alarms)
    assert "100% of the logical properties reached have been proven" in output


def test_frames() -> None:
    sources = (f"{MEMORY}/framing.c", f"{CORE}/wire/framing.c", f"{CORE}/wire/messages_gen.c")
    nothing_is_left_open(analysed("-eva", "-eva-precision", "2", "-eva-use-spec", PROVED_APART, *sources))


def test_cobs_of_anything() -> None:
    output = analysed("-wp", "-wp-rte", "-wp-fct", "bt_cobs_decode", "-wp-prover", "z3", "-wp-timeout", "600", WORDS[1])
    proved, goals = re.findall(r"Proved goals: +(\d+) / (\d+)", output)[0]
    assert proved == goals and int(goals) >= 20, output[-4000:]


@pytest.mark.parametrize("first", [*range(1, 240, 16), 240])
def test_words_at_the_end_of_memory(first: int) -> None:
    output = analysed("-eva", "-eva-precision", "0", "-eva-min-loop-unroll", "260",
                    "-absolute-valid-range", "0x20000000-0x200000ff", *WORDS,
                    defines=f"-DEND=0x20000100 -DFIRST={first}")  # fmt: skip
    nothing_is_left_open(output)


def test_records_in_flash() -> None:
    sources = (f"{MEMORY}/storage.c", f"{CORE}/keep/storage.c")
    nothing_is_left_open(analysed("-eva", "-eva-precision", "2", "-eva-use-spec", "bt_crc32", *sources))


def test_the_head_of_any_map() -> None:
    source = f"{MEMORY}/map.c"
    output = analysed("-eva", "-eva-precision", "2", "-eva-use-spec", "coefficients_bounded", source)
    nothing_is_left_open(output)


def test_sums_of_any_signals() -> None:
    sources = (f"{MEMORY}/solve.c", f"{CORE}/signal/sums_gen.c")
    nothing_is_left_open(analysed("-eva", "-eva-precision", "2", *sources))
