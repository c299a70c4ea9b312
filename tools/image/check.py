#!/usr/bin/env python3
"""What a board image takes, and what must not be in it. Runs after each link; exit 1 says what is wrong.

    check.py IMAGE.elf [--objdump PROGRAM]

Prints flash, RAM and the deepest stack. Refuses an image over its budget, with a heap, printf or floating point in it,
with a stack that may outgrow its room, with code run from flash after boot, or with an unbounded wait in the port. None
of it depends on what the compiler inlined.
"""

from __future__ import annotations

import argparse
import re
import subprocess
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from image import stack, waits
from image.symbols import FLOAT_SYMBOL, LIBRARY_SYMBOL

ROOT = Path(__file__).resolve().parent.parent.parent
PORT = ROOT / "firmware" / "port" / "rp2040"
FLASH_BUDGET = 68 * 1024  # of 1820 KiB: boot has to copy it
RAM_BUDGET = 200 * 1024  # of 256 KiB: the image, five maps of 20 KiB, 16 KiB of data and the stack
SRAM = 0x20000000
RAM_PARTS = (("program", ".text"), ("data", ".data"), ("bss", ".bss"), ("stack", ".stack"))

ROM = "(boot ROM)"
ROM_STACK_BYTES = 256  # an allowance: the ROM's use is not documented
EXCEPTION_BYTES = 32 + 4  # pushed by the core, with alignment

COMMANDS = (ROOT / "firmware" / "core" / "talk" / "commands.c").read_text(encoding="utf-8")

# The functions that each call through a pointer in the source may reach.
POINTERS = {
    "session->write(": ("write_link",),
    "board->save_settings(": ("save_settings",),
    "board.save_calibration(": ("save_calibration",),
    "board.save_map(": ("save_map",),
    "board.reboot_bootloader(": ("reboot_bootloader",),
    "board.now_us(": ("now_us",),
    "flash->erase(": ("erase_sector", "erase_map_sector"),
    "flash->program(": ("program_page", "program_map_page"),
    "flash->read(": ("read_flash",),
    "commands[k].run(": tuple(re.findall(r"^    {BT_\w+_ID, .*, (\w+)},$", COMMANDS, re.MULTILINE)),
    "rom.": (ROM,),
    "boot2_copy": (ROM,),
    "device->source(": ("bt_emu_stream_count",),
    "lookup(": (ROM,),
    "loader(": (ROM,),
}
# The worst case nests all that the image has; the last two are the sensor board's.
INTERRUPTS = ("usb_interrupt", "uart_interrupt", "timer_interrupt", "exchanged", "heard")


def section_sizes(elf: Path, objdump: str) -> dict[str, int]:
    text = subprocess.run([objdump, "-h", str(elf)], capture_output=True, text=True, check=True).stdout
    return {name: int(size, 16) for name, size in re.findall(r"^\s*\d+ (\.\S+)\s+([0-9a-f]+)", text, re.M)}


def symbols(elf: Path, objdump: str) -> set[str]:
    text = subprocess.run([objdump, "-t", str(elf)], capture_output=True, text=True, check=True).stdout
    return {line.split()[-1] for line in text.splitlines() if re.match(r"^[0-9a-f]{8} ", line)}


def interrupts(program: stack.Program) -> list[str]:
    return [name for name in INTERRUPTS if name in program.functions]


def stack_depth(program: stack.Program) -> tuple[int, str]:
    """Bytes with all interrupts on top of the main loop's deepest chain, and the chains in words."""
    chains = [program.deepest(name) for name in ("main", *interrupts(program))]
    depth = sum(bytes_ for bytes_, _ in chains) + EXCEPTION_BYTES * (len(chains) - 1)
    return depth, "; ".join(f"{' > '.join(chain)} {bytes_}" for bytes_, chain in chains)


def misplaced(program: stack.Program) -> list[str]:
    """Functions that would run from the slow flash, or from SRAM before they are copied there."""
    early = program.reached("clocks_start") | {"image_reset"}
    late = program.reached("main").union(*(program.reached(name) for name in interrupts(program))) - {ROM}
    wrong = [f"{name} runs from flash" for name in late if program.functions[name].address < SRAM]
    return sorted(
        wrong
        + [f"{name} runs from SRAM before it is copied" for name in early if program.functions[name].address >= SRAM]
    )


def check(elf: Path, objdump: str) -> list[str]:
    """Print the figures; return what is wrong."""
    size = section_sizes(elf, objdump)
    kept = (".boot2", ".vectors", ".binary_info", ".image_note", ".boot_code", ".data", ".text")
    flash = sum(size.get(name, 0) for name in kept)
    ram = sum(size.get(name, 0) for name in (".stack", ".text", ".data", ".bss"))
    program = stack.load(elf, objdump, elf.parent, POINTERS)
    program.functions[ROM] = stack.Function(0, ROM_STACK_BYTES)
    depth, chains = stack_depth(program)
    print(f"flash {flash} of {FLASH_BUDGET} bytes")
    parts = ", ".join(f"{name} {size[section]}" for name, section in RAM_PARTS)
    print(f"RAM   {ram} of {RAM_BUDGET} bytes: {parts}")
    print(f"stack {depth} of {size['.stack']} bytes: {chains}")
    wrong = [f"{flash} bytes of flash, over budget"] if flash > FLASH_BUDGET else []
    wrong += [f"{ram} bytes of RAM, over budget"] if ram > RAM_BUDGET else []
    wrong += [f"a stack of {depth} bytes, more than .stack has"] if depth > size[".stack"] else []
    for name in sorted(symbols(elf, objdump)):
        if FLOAT_SYMBOL.match(name) or LIBRARY_SYMBOL.match(name):
            wrong.append(f"{name} must not be in the image")
    return wrong + misplaced(program) + waits.unbounded(PORT)


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("elf", type=Path)
    parser.add_argument("--objdump", default="arm-none-eabi-objdump")
    args = parser.parse_args()
    try:
        wrong = check(args.elf, args.objdump)
    except stack.Unknown as unknown:
        wrong = [str(unknown)]
    for what in wrong:
        print(f"tools/image/check.py: {what}", file=sys.stderr)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
