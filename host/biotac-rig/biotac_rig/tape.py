"""The tape: counts for emulated sensors, one uint16 a slot.

Little-endian: 8 bytes ``BTTAPE02``; u32 fingers, u32 rounds, u32 slots (44), u32 reserved (0); then
uint16 samples [round][slot][finger], as EMU_TAPE has them. 0..4095 are counts; CODES are other words of the sensor
on the bus. Nothing in between is legal.
"""

from __future__ import annotations

import struct
from pathlib import Path

from biotac.errors import InputError
from biotac.sim.source import BLOCK, Source, check_samples

MAGIC = b"BTTAPE02"
_HEADER = struct.Struct("<8sIIII")


def write_tape(path: str | Path, source: Source) -> None:
    """Write ``source.samples`` as a tape.

    Raises InputError when the samples have a wrong shape, type or value, or the file cannot be written.
    """
    check_samples(source)
    frames, fingers, slots = source.samples.shape  # the emulator checks that there are not too few or too many
    blocks = [source.samples[first : first + BLOCK] for first in range(0, frames, BLOCK)]
    try:
        with Path(path).open("wb") as file:
            file.write(_HEADER.pack(MAGIC, fingers, frames, slots, 0))
            for block in blocks:
                file.write(block.transpose(0, 2, 1).astype("<u2").tobytes())
    except OSError as error:
        raise InputError(f"{path}: cannot write the tape: {error.strerror}; choose another place") from error
