"""A calibration as in the board's flash, bit for bit: the board's own code packs and checks it.

The layout is in protocol/SPEC.md, Calibrations.
"""

from __future__ import annotations

from ..errors import InputError
from ..wire.native import ffi, lib
from .calibration import Calibration

MAX_BYTES = 256

_WHY = {
    lib.BT_RECORD_DAMAGED: "holds no intact record: its CRC is wrong; store the calibration again",
    lib.BT_RECORD_OF_SOMETHING: "holds a record other than a calibration; store the calibration again",
    lib.BT_RECORD_OTHER_VERSION: "holds a calibration in a newer format; install a newer biotac-gateway",
    lib.BT_RECORD_CLEARED: "holds a cleared calibration; store one again",
    lib.BT_RECORD_OUT_OF_RANGE: "holds a calibration with a value out of range; store a valid one",
}


def pack(calibration: Calibration) -> bytes:
    """Header and data, as in a page of the board's flash for finger 0."""
    record = ffi.new("bt_calibration *")
    record.present = True
    record.serial = calibration.wire_serial()
    record.made_s = calibration.made_s
    record.value = calibration.wire_values()
    page = ffi.new("uint8_t[]", MAX_BYTES)
    return bytes(ffi.buffer(page, lib.bt_record_pack(record, page)))


def unpack(data: bytes, where: str) -> Calibration:
    """The calibration in ``data``, which may end in 0xFF bytes.

    Raises InputError that begins with ``where`` and says why there is none that can be used.
    """
    record = ffi.new("bt_calibration *")
    judgement = lib.bt_record_unpack(record, data, len(data))
    if judgement != lib.BT_RECORD_GOOD:
        raise InputError(f"{where} {_WHY[judgement]}")
    try:
        return Calibration.from_wire(list(record.serial), record.made_s, list(record.value))
    except ValueError as error:
        raise InputError(f"{where} holds an invalid calibration ({error}); store a valid one") from error
