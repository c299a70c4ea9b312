"""A calibration in an EEPROM: two slots, written in turn, so that an interrupted write never destroys the old one.

Each slot holds a CRC-32 over the other bytes, a generation, and the record as in a board's flash (protocol/SPEC.md,
Calibrations). The valid slot with the later generation counts. A write goes to the other slot, which has a wrong CRC
until the last byte is stored. The slots have the same addresses in every chip, so naming a wrong size does not move
them.
"""

from __future__ import annotations

import struct
import zlib

from ..errors import InputError, PortError
from ..wire.native import ffi, lib
from ..wire.sensor_gen import MAX_SENSORS
from .calibration import Calibration
from .chip import Chip

SLOT_BYTES = 128
SLOTS = 2
CRC = GENERATION = struct.Struct("<I")
RECORD_BYTES = 256
_HEADER = struct.Struct("<4xHHI4x")  # of a page in flash (firmware/core/keep/storage.c): id, version, size of the data
_FIRST_ID, _VERSION = lib.BT_RECORD_CALIBRATION, lib.BT_CALIBRATION_VERSION


def pack(calibration: Calibration) -> bytes:
    """The record, header and data, as in a page of the board's flash for finger 0; the board's own code packs it."""
    record = ffi.new("bt_calibration *")
    record.present = True
    record.serial = calibration.wire_serial()
    record.made_s = calibration.made_s
    record.value = calibration.wire_values()
    data, page = ffi.new("uint8_t[]", RECORD_BYTES), ffi.new("uint8_t[]", RECORD_BYTES)
    size = lib.bt_calibration_pack(record, data)
    lib.bt_storage_make_page(page, _FIRST_ID, _VERSION, data, size)
    return bytes(ffi.buffer(page, _HEADER.size + size))


def unpack(data: bytes, where: str) -> Calibration:
    """The calibration in ``data``, which may end in 0xFF bytes.

    Raises InputError that begins with ``where`` and says why there is none that can be used.
    """
    page = data[:RECORD_BYTES].ljust(RECORD_BYTES, b"\xff")
    number, version, size = _HEADER.unpack_from(page)
    if not lib.bt_storage_page_is(page, number):
        raise InputError(f"{where} holds no intact record: its CRC is wrong; store the calibration again")
    if not 0 <= number - _FIRST_ID < MAX_SENSORS:
        raise InputError(f"{where} holds a record other than a calibration; store the calibration again")
    if version != _VERSION:
        raise InputError(f"{where} holds a calibration in a newer format; install a newer biotac-gateway")
    record = ffi.new("bt_calibration *")
    lib.bt_calibration_unpack(record, version, page[_HEADER.size :], size)
    if size == 0:
        raise InputError(f"{where} holds a cleared calibration; store one again")
    if not record.present:
        raise InputError(f"{where} holds a calibration with a value out of range; store a valid one")
    try:
        return Calibration.from_wire(list(record.serial), record.made_s, list(record.value))
    except ValueError as error:
        raise InputError(f"{where} holds an invalid calibration ({error}); store a valid one") from error


def load(chip: Chip) -> Calibration:
    """The calibration in this chip. Raises InputError when there is none that can be used."""
    raw = [_read(chip, slot) for slot in range(SLOTS)]
    newest = _newest(raw)
    if newest is None:
        if all(set(data) == {0xFF} for data in raw):
            raise InputError(f"{chip.name} is blank; `biotac calibrate put` writes to it")
        raise InputError(
            f"{chip.name} holds no calibration: the CRCs of both copies are wrong; check its kind, or store it again"
        )
    return unpack(newest[2], chip.name)


def store(chip: Chip, calibration: Calibration) -> bool:
    """Store the calibration; False if it was there already, and nothing is written to spare the chip."""
    slot, generation, record = _newest([_read(chip, slot) for slot in range(SLOTS)]) or (1, 0, b"")
    body = pack(calibration).ljust(SLOT_BYTES - CRC.size - GENERATION.size, b"\xff")
    if record == body:
        return False
    slot = 1 - slot
    covered = GENERATION.pack((generation + 1) % 2**32) + body
    whole = CRC.pack(zlib.crc32(covered)) + covered
    chip.write(slot * SLOT_BYTES, whole)
    if _read(chip, slot) != whole:
        raise PortError(
            f"{chip.name} does not read back the bytes written; check --chip and the chip's write protection (WP)"
        )
    return True


def _read(chip: Chip, slot: int) -> bytes:
    return chip.read(slot * SLOT_BYTES, SLOT_BYTES)


def _newest(raw: list[bytes]) -> tuple[int, int, bytes] | None:
    """Slot and generation of the newest intact record, and the record, followed by 0xFF."""
    newest: tuple[int, int, bytes] | None = None
    for slot, data in enumerate(raw):
        covered = data[CRC.size :]
        if CRC.unpack_from(data) != (zlib.crc32(covered),):
            continue
        (generation,) = GENERATION.unpack_from(covered)
        # Modulo 2^32: a generation is later if it is less than 2^31 ahead.
        if newest is None or 0 < (generation - newest[1]) % 2**32 < 2**31:
            newest = slot, generation, covered[GENERATION.size :]
    return newest
