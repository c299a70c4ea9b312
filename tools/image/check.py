#!/usr/bin/env python3
"""What a board image takes, and what must not be in it. Runs after each link; exit 1 says what is wrong.

    check.py IMAGE.elf [--objdump PROGRAM]

Prints flash, RAM and the deepest stack. Refuses an image over its budget, with a heap, printf or floating
point in it, with a stack that may grow past its room, with interrupt or flash code that calls into flash,
or with a wait in the port that has no bound.
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
FLASH_BUDGET = 56 * 1024
RAM_BUDGET = 24 * 1024
SRAM = 0x20000000

ROM = "(boot ROM)"
ROM_STACK_BYTES = 256  # an allowance: the ROM does not tell
EXCEPTION_BYTES = 32 + 4  # what the core pushes, with alignment

SENDERS = (
    "bt_session_send",
    "bt_session_round",
    "bt_session_send_status",
    "bt_session_send_sensor_status",
    "send_frame",
)
# What may be called where the code calls through a pointer.
FLASH_CALLS = ("port_flash_erase", "port_flash_program", "port_flash_read")
POINTERS = {
    **dict.fromkeys(SENDERS, ("port_link_write",)),
    "bt_command": ("port_link_write", "save_settings", "save_calibration", "reboot_bootloader"),
    "bt_map_command": ("port_link_write", "erase_map_sector", "program_map_page"),
    "bt_upload_write": ("erase_map_sector", "program_map_page"),
    "bt_save_maps": ("save_map",),
    "sector_in_use": FLASH_CALLS,
    "latest": FLASH_CALLS,
    "first_free": FLASH_CALLS,
    "keep_page": FLASH_CALLS,
    "move_on": FLASH_CALLS,
    "bt_storage_read": FLASH_CALLS,
    "bt_storage_write": FLASH_CALLS,
    "leave_xip": (ROM,),
    "back_to_xip": (ROM,),
    "erase_sector": (ROM,),
    "program_page": (ROM,),
    "rom_function": (ROM,),
    "rom_has_loader": (ROM,),
    "rom_enter_loader": (ROM,),
}
# The interrupt that may interrupt everything, and the one that it may interrupt.
INTERRUPTS = ("usb_interrupt", "timer_interrupt")
# Must neither be in flash nor call anything there.
IN_SRAM = ("timer_interrupt", "erase_sector", "program_page", "exchange")


def section_sizes(elf: Path, objdump: str) -> dict[str, int]:
    text = subprocess.run([objdump, "-h", str(elf)], capture_output=True, text=True, check=True).stdout
    return {name: int(size, 16) for name, size in re.findall(r"^\s*\d+ (\.\S+)\s+([0-9a-f]+)", text, re.M)}


def symbols(elf: Path, objdump: str) -> set[str]:
    text = subprocess.run([objdump, "-t", str(elf)], capture_output=True, text=True, check=True).stdout
    return {line.split()[-1] for line in text.splitlines() if re.match(r"^[0-9a-f]{8} ", line)}


def stack_depth(program: stack.Program) -> tuple[int, str]:
    """With both interrupts on top of the main loop's deepest chain."""
    chains = [program.deepest(name) for name in ("main", *INTERRUPTS)]
    depth = sum(bytes_ for bytes_, _ in chains) + EXCEPTION_BYTES * len(INTERRUPTS)
    return depth, "; ".join(f"{' > '.join(chain)} {bytes_}" for bytes_, chain in chains)


def in_flash(program: stack.Program) -> list[str]:
    """What code that must run from SRAM would call in flash."""
    wrong = set()
    for root in IN_SRAM:
        for name in program.reached(program.named(root)):
            if name != ROM and program.functions[name].address < SRAM:
                wrong.add(f"{root} reaches {name}")
    return sorted(wrong)


def check(elf: Path, objdump: str) -> list[str]:
    """Prints the figures; returns what is wrong."""
    size = section_sizes(elf, objdump)
    flash = sum(size.get(name, 0) for name in (".boot2", ".vectors", ".binary_info", ".image_note", ".data", ".text"))
    ram = sum(size.get(name, 0) for name in (".stack", ".data", ".bss"))
    program = stack.load(elf, objdump, elf.parent, POINTERS)
    program.functions[ROM] = stack.Function(0, ROM_STACK_BYTES)
    depth, chains = stack_depth(program)
    print(f"flash {flash} of {FLASH_BUDGET} bytes")
    print(f"RAM   {ram} of {RAM_BUDGET} bytes: data {size['.data']}, bss {size['.bss']}, stack {size['.stack']}")
    print(f"stack {depth} of {size['.stack']} bytes: {chains}")
    wrong = [f"{flash} bytes of flash"] if flash > FLASH_BUDGET else []
    wrong += [f"{ram} bytes of RAM"] if ram > RAM_BUDGET else []
    wrong += [f"a stack of {depth} bytes"] if depth > size[".stack"] else []
    for name in sorted(symbols(elf, objdump)):
        if FLOAT_SYMBOL.match(name) or LIBRARY_SYMBOL.match(name):
            wrong.append(f"{name} in the image")
    wrong += [f"{what}, which is in flash" for what in in_flash(program)]
    return wrong + waits.unbounded(PORT)


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
