"""The tape: counts for the C simulator's sensors, one uint16 a slot.

Little-endian: 8 bytes ``BTTAPE02``; u32 fingers, u32 rounds, u32 slots (44), u32 reserved (0); then
uint16 samples [round][slot][finger], as EMU_TAPE has them. 0..4095 are counts; CODES say what else the sensor
puts on the bus. Nothing in between is legal.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..wire import sensor_gen as _sensor
from .emu_gen import EmuFault
from .source import Source

CODES = tuple(fault for fault in EmuFault if fault)  # in place of a count; see enum emu_fault (protocol/emu.toml)

MAGIC = b"BTTAPE02"
_HEADER = struct.Struct("<8sIIII")
_SLOTS = len(_sensor.SLOTS)
_BLOCK = 10_000  # frames at a time, for memory


def write_tape(path: str | Path, source: Source) -> None:
    """Write ``source.samples`` as a tape.

    Raises InputError when the samples have a wrong shape, type or value, or the file cannot be written.
    """
    samples = source.samples
    if samples.ndim != 3 or samples.shape[2] != _SLOTS or samples.dtype != np.uint16:
        raise InputError(
            f"source {source.name}: samples are {samples.dtype} {samples.shape}: expected uint16 "
            f"(frames, fingers, {_SLOTS}); load it with load_source"
        )
    frames, fingers, slots = samples.shape  # the simulator checks that there are not too few or too many
    blocks = [samples[first : first + _BLOCK] for first in range(0, frames, _BLOCK)]
    for k, block in enumerate(blocks):
        wrong = (block > _sensor.FULL_SCALE_COUNT) & (block < min(CODES))
        if wrong.any():
            frame, finger, slot = np.argwhere(wrong)[0].tolist()
            raise InputError(
                f"source {source.name}: frame {k * _BLOCK + frame}, finger {finger}, slot {slot} holds "
                f"{block[frame, finger, slot]}: expected a count 0..{_sensor.FULL_SCALE_COUNT} or a tape code from "
                f"{min(CODES):#06X}; load it with load_source"
            )
    try:
        with Path(path).open("wb") as file:
            file.write(_HEADER.pack(MAGIC, fingers, frames, slots, 0))
            for block in blocks:
                file.write(block.transpose(0, 2, 1).astype("<u2").tobytes())
    except OSError as error:
        raise InputError(f"{path}: cannot write the tape: {error.strerror}; choose another place") from error
