#!/usr/bin/env python3
"""Run an image of the Cortex-M4F reference board (tests/target/m4f) in QEMU's mps2-an386.

    tools/qemu.py [--seconds N] IMAGE.elf

Prints the image's output, exits with its code. An image still running after N seconds (default 1800) is killed,
and the last output is printed.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
from pathlib import Path

MACHINE = "mps2-an386"
SECONDS = 1800.0  # only an image that hangs takes this long, however busy the computer is


class Failed(Exception):
    """One sentence for the user."""


def argv(elf: Path, machine: str = MACHINE) -> list[str]:
    """QEMU's command line."""
    return ["qemu-system-arm", "-M", machine, "-kernel", str(elf), "-display", "none", "-monitor", "none",
            "-serial", "none", "-semihosting-config", "enable=on,target=native"]  # fmt: skip


def run(elf: Path, seconds: float = SECONDS, machine: str = MACHINE) -> tuple[int, str]:
    """The image's exit code and output."""
    if not elf.is_file():
        build = "cmake -S tests/target/m4f -B build/m4f -G Ninja && cmake --build build/m4f"
        raise Failed(f"{elf} is missing; build it: {build}")
    try:
        done = subprocess.run(argv(elf, machine), stdin=subprocess.DEVNULL, stdout=subprocess.PIPE,
                              stderr=subprocess.STDOUT, timeout=seconds, check=False)  # fmt: skip
    except FileNotFoundError:
        raise Failed("qemu-system-arm is missing; install it: apt-get install qemu-system-arm") from None
    except subprocess.TimeoutExpired as late:
        output = (late.stdout or b"").decode(errors="replace").splitlines()
        last = f"it printed {len(output)} lines, the last: {output[-1]}" if output else "it printed nothing"
        raise Failed(f"{elf.name} did not end within {seconds:g} s; {last}") from None
    return done.returncode, done.stdout.decode(errors="replace")


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=SECONDS, help="kill it after this long (default %(default)g)")
    parser.add_argument("image", type=Path, help="an .elf built from tests/target/m4f")
    args = parser.parse_args()
    code, output = run(args.image, args.seconds)
    sys.stdout.write(output)
    return code


if __name__ == "__main__":
    try:
        sys.exit(main())
    except Failed as failed:
        sys.exit(f"tools/qemu.py: {failed}")
