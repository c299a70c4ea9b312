"""The tape: counts for the C simulator's sensors, one uint16 a slot.

Little-endian: 8 bytes ``BTTAPE01``; u32 fingers, u32 frames, u32 slots (44), u32 reserved (0); then
uint16 samples [frame][finger][slot]. 0..4095 are counts; the codes above say what else the sensor
puts on the bus. Nothing in between is legal.
"""

from __future__ import annotations

import struct
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..errors import InputError
from ..wire import messages_gen as _wire
from ..wire import sensor_gen as _sensor
from .source import Source

# In place of a count; what each is says enum emu_fault (protocol/MESSAGES.md).
NO_CHANNEL = _wire.EmuFault.NO_CHANNEL
BAD_PARITY = _wire.EmuFault.BAD_PARITY
STUCK_LOW = _wire.EmuFault.STUCK_LOW
STUCK_HIGH = _wire.EmuFault.STUCK_HIGH
ERROR_WORD = _wire.EmuFault.TOO_EARLY
UNPLUGGED = _wire.EmuFault.UNPLUGGED
SWAPPED = _wire.EmuFault.SWAPPED
CODES = (NO_CHANNEL, BAD_PARITY, STUCK_LOW, STUCK_HIGH, ERROR_WORD, UNPLUGGED, SWAPPED)

MAGIC = b"BTTAPE01"
_HEADER = struct.Struct("<8sIIII")
_SLOTS = len(_sensor.SLOTS)
_BLOCK = 10_000  # frames at a time, for memory


def write_tape(path: str | Path, source: Source) -> None:
    """Write ``source.samples`` as a tape.

    Raises InputError when the samples are no tape (shape, values) or the file cannot be written.
    """
    samples = source.samples
    if samples.ndim != 3 or samples.shape[2] != _SLOTS or samples.dtype != np.uint16:
        raise InputError(
            f"source {source.name}: samples are {samples.dtype} {samples.shape}: expected uint16 "
            f"(frames, fingers, {_SLOTS}); load it with load_source"
        )
    frames, fingers, slots = samples.shape
    _check(f"source {source.name}", samples)
    header = _HEADER.pack(MAGIC, fingers, frames, slots, 0)
    try:
        with Path(path).open("wb") as file:
            file.write(header)
            for first in range(0, frames, _BLOCK):
                file.write(samples[first : first + _BLOCK].astype("<u2").tobytes())
    except OSError as error:
        raise InputError(f"{path}: cannot write the tape: {error.strerror}; choose another place") from error


def read_tape(path: str | Path) -> npt.NDArray[np.uint16]:
    """Samples of a tape: uint16 (frames, fingers, 44).

    Raises InputError when the file is missing, is no tape, or its size or values do not fit.
    """
    cure = "write it again with write_tape"
    try:
        data = Path(path).read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot read the tape: {error.strerror}; check the path") from error
    if len(data) < _HEADER.size or data[: len(MAGIC)] != MAGIC:
        raise InputError(f"{path}: begins with {data[:8]!r}: expected a tape, {MAGIC!r}; {cure}")
    _, fingers, frames, slots, reserved = _HEADER.unpack_from(data)
    if slots != _SLOTS or reserved != 0:
        raise InputError(f"{path}: {slots} slots, reserved {reserved}: expected {_SLOTS} slots, reserved 0; {cure}")
    expected = _HEADER.size + 2 * fingers * frames * slots
    if len(data) != expected:
        raise InputError(
            f"{path}: {len(data)} bytes: expected {expected} for {frames} frames of {fingers} fingers; {cure}"
        )
    words = np.frombuffer(data, dtype="<u2", offset=_HEADER.size).astype(np.uint16)
    samples = words.reshape(frames, fingers, slots)
    _check(str(path), samples)
    return samples


def _check(where: str, samples: npt.NDArray[np.uint16]) -> None:
    frames, fingers, _ = samples.shape
    if not 1 <= fingers <= _sensor.MAX_SENSORS or frames < 1:
        raise InputError(
            f"{where}: {frames} frames of {fingers} fingers: expected at least one frame "
            f"and 1 to {_sensor.MAX_SENSORS} fingers; load it with load_source"
        )
    for first in range(0, frames, _BLOCK):
        block = samples[first : first + _BLOCK]
        wrong = (block > _sensor.FULL_SCALE_COUNT) & (block < min(CODES))
        if wrong.any():
            frame, finger, slot = (int(k) for k in np.argwhere(wrong)[0])
            raise InputError(
                f"{where}: frame {first + frame}, finger {finger}, slot {slot} holds {block[frame, finger, slot]}: "
                f"expected a count 0..{_sensor.FULL_SCALE_COUNT} or a tape code from {min(CODES):#06X}; "
                "load it with load_source"
            )
