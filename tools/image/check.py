#!/usr/bin/env python3
"""Size of a board image, and forbidden parts. Runs after each link; exit 1 with the fault.

    check.py IMAGE.elf --port FOLDER... --limits BOARD/limits.json [--objdump PROGRAM]

Prints flash, RAM and the deepest stack. Refuses an image over the board's limits, with a heap, printf or floating point
in it, with a stack that may outgrow the room, with an unbounded wait in the port, or, where the board runs from RAM,
with code run from flash after boot. None of it depends on the compiler's inlining.
"""

from __future__ import annotations

import argparse
import json
import re
import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from image import stack, waits
from image.symbols import FLOAT_SYMBOL, LIBRARY_SYMBOL

ROOT = Path(__file__).resolve().parent.parent.parent
PORTS = ROOT / "firmware" / "port"

ROM = "(boot ROM)"
FLASH_SPAN = 16 << 20  # no flash here is larger
EXCEPTION_BYTES = 32 + 4  # pushed by the core, with alignment
SECTION = re.compile(r"^\s*\d+ (\.\S+)\s+([0-9a-f]+)\s+([0-9a-f]+) .*\n\s+(.*)$", re.M)

COMMANDS = (ROOT / "firmware" / "core" / "talk" / "commands.c").read_text(encoding="utf-8")

# The functions that each call through a pointer in the gateway's source may reach; limits.json has the board's own.
POINTERS = {
    "session->write(": ("write_link",),
    "board.reboot(": ("reboot_board",),
    "board.measure(": ("measure",),
    "board.set_bus_rate(": ("clock_bus",),
    "board.now_us(": ("now_us",),
    "flash->erase(": ("erase_sector",),
    "flash->program(": ("program_page",),
    "flash->read(": ("read_flash",),
    "commands[k].run(": tuple(re.findall(r"^    {BT_\w+_ID, .*, (\w+)},$", COMMANDS, re.MULTILINE)),
}


@dataclass(frozen=True)
class Limits:
    """limits.json of a board's folder."""

    flash_at: int
    flash_bytes: int
    ram_bytes: int
    runs_from_ram: bool
    interrupts: tuple[str, ...]  # the worst case nests all of them that the image has
    rom_stack_bytes: int  # an allowance, as the boot ROM's use is not documented
    pointers: dict[str, tuple[str, ...]]


def read_limits(path: Path) -> Limits:
    facts = json.loads(path.read_text(encoding="utf-8"))
    return Limits(
        int(facts["flash"]["at"], 0), facts["flash"]["bytes"], facts["ram"]["bytes"], facts.get("runs_from_ram", False),
        tuple(facts["interrupts"]), facts.get("rom_stack_bytes", 0),
        {call: tuple(names) for call, names in facts.get("pointers", {}).items()},
    )  # fmt: skip


@dataclass(frozen=True)
class Section:
    bytes: int
    stored: bool  # in flash
    in_ram: bool


def sections(elf: Path, objdump: str, limits: Limits) -> dict[str, Section]:
    """Those that take memory. A part of RAM that is copied from flash takes both."""
    text = subprocess.run([objdump, "-h", str(elf)], capture_output=True, text=True, check=True).stdout
    found = {}
    for name, size, address, flags in SECTION.findall(text):
        if "ALLOC" in flags:
            in_flash = limits.flash_at <= int(address, 16) < limits.flash_at + FLASH_SPAN
            found[name] = Section(int(size, 16), "LOAD" in flags, not in_flash)
    return found


def symbols(elf: Path, objdump: str) -> set[str]:
    text = subprocess.run([objdump, "-t", str(elf)], capture_output=True, text=True, check=True).stdout
    return {line.split()[-1] for line in text.splitlines() if re.match(r"^[0-9a-f]{8} ", line)}


def stack_depth(program: stack.Program, interrupts: list[str]) -> tuple[int, str]:
    """Bytes with all interrupts on top of the main loop's deepest chain, and the chains in words."""
    chains = [program.deepest(name) for name in ("main", *interrupts)]
    depth = sum(bytes_ for bytes_, _ in chains) + EXCEPTION_BYTES * (len(chains) - 1)
    return depth, "; ".join(f"{' > '.join(chain)} {bytes_}" for bytes_, chain in chains)


def misplaced(program: stack.Program, limits: Limits, interrupts: list[str]) -> list[str]:
    """Functions that would run from the slow flash, or from SRAM before they are copied there."""
    early = program.reached("clocks_start") | {"image_reset"}
    late = program.reached("main").union(*(program.reached(name) for name in interrupts)) - {ROM}
    flash = range(limits.flash_at, limits.flash_at + FLASH_SPAN)
    wrong = [f"{name} runs from flash" for name in late if program.functions[name].address in flash]
    return sorted(
        wrong + [f"{name} runs from RAM before it is copied" for name in early
                 if program.functions[name].address not in flash]
    )  # fmt: skip


def check(elf: Path, objdump: str, limits: Limits, ports: list[Path]) -> list[str]:
    """Print the figures; return the faults."""
    parts = sections(elf, objdump, limits)
    flash = sum(part.bytes for part in parts.values() if part.stored)
    ram = sum(part.bytes for part in parts.values() if part.in_ram)
    program = stack.load(elf, objdump, elf.parent / "CMakeFiles" / f"{elf.stem}.dir", POINTERS | limits.pointers)
    program.functions[ROM] = stack.Function(0, limits.rom_stack_bytes)
    interrupts = [name for name in limits.interrupts if name in program.functions]
    depth, chains = stack_depth(program, interrupts)
    room = parts[".stack"].bytes
    print(f"flash {flash} of {limits.flash_bytes} bytes")
    in_ram = ", ".join(f"{name[1:]} {part.bytes}" for name, part in parts.items() if part.in_ram and part.bytes)
    print(f"RAM   {ram} of {limits.ram_bytes} bytes: {in_ram}")
    print(f"stack {depth} of {room} bytes: {chains}")
    wrong = [f"{flash} bytes of flash, over its limit"] if flash > limits.flash_bytes else []
    wrong += [f"{ram} bytes of RAM, over its limit"] if ram > limits.ram_bytes else []
    wrong += [f"a stack of {depth} bytes, more than .stack has"] if depth > room else []
    for name in sorted(symbols(elf, objdump)):
        if FLOAT_SYMBOL.match(name) or LIBRARY_SYMBOL.match(name):
            wrong.append(f"{name} must not be in the image")
    wrong += misplaced(program, limits, interrupts) if limits.runs_from_ram else []
    return wrong + [wait for port in (PORTS / "cortex_m", *ports) for wait in waits.unbounded(port, *ports)]


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("elf", type=Path)
    parser.add_argument("--port", nargs="+", type=Path, required=True, help="the folders of its port")
    parser.add_argument("--limits", required=True, type=Path)
    parser.add_argument("--objdump", default="arm-none-eabi-objdump")
    args = parser.parse_args()
    try:
        wrong = check(args.elf, args.objdump, read_limits(args.limits), args.port)
    except stack.Unknown as unknown:
        wrong = [str(unknown)]
    for problem in wrong:
        print(f"tools/image/check.py: {problem}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
