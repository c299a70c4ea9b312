"""Importing SynTouch .btd files as recordings: the board's own code runs on their counts, with the file's own times."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np

from ...core.compiled import default_settings
from ...version import __version__
from ...wire import messages_gen as wire
from ...wire import sensor_gen as sensor
from ...wire import slots
from ...wire.framing import encode
from ...wire.identity import NO_IMAGE, SENSOR_SERIAL_BYTES, is_foreign
from ..facts import Facts
from ..mcap_file import RecordingFile
from ..rounds import Rounds, frames_and_tares
from .file import read_btd

NO_BOARD = 0
_BLOCK_US = 1_000_000
_FIRST_PAC_US = int(slots.PAC_SLOT[0]) * 1_000_000 // sensor.SLOT_HZ


def import_btd(path: Path, out: Path, show: Callable[[float], None] = lambda share: None) -> dict[str, int]:
    """Write ``path`` (.btd or .btd.gz) to ``out`` as a recording; return the numbers of fingers, frames and skipped.

    Every sensor that was present becomes a finger, and every complete frame a FRAME and a PAC at the file's own
    time. Incomplete frames are left out. The logger's gaps stay gaps in time, but sequence numbers go on without a
    gap, because the tare machine counts rounds. Raises RecordingError naming the line.
    """
    read = read_btd(path)
    words = read.samples
    frames, fingers = words.shape[:2]
    t_us = np.rint((read.t_s - read.t_s[0]) * 1e6).astype(np.int64)
    settings = default_settings()
    messages: list[tuple[int, int, bytes]] = []
    ran = made = 0

    def ran_rows(rows: int) -> None:
        nonlocal ran
        ran += rows
        show(0.9 * min(1.0, ran / (2 * frames * fingers)))

    for finger in range(fingers):
        own = words[:, finger]
        pdc, tac, tdc = (own[:, slot] for slot in (slots.PDC_SLOT, slots.TAC_SLOT, slots.TDC_SLOT))
        channels = own[:, slots.ELECTRODE_SLOT], pdc, tac, tdc, own[:, slots.PAC_SLOT]
        rounds = Rounds(finger, *channels, t_us, foreign=is_foreign(read.serials[finger]))
        rows, tares = frames_and_tares(rounds, settings, ran_rows)
        answered = np.flatnonzero((own != wire.INVALID_COUNT).any(axis=1))
        for k, row in enumerate(rows):
            at = int(t_us[answered[k]])
            if k in tares:
                messages.append((at, 0, encode(wire.Tare.ID, tares[k].pack())))
            messages.append((at, 1, encode(wire.Frame.ID, row.tobytes())))
            samples = tuple(own[answered[k], slots.PAC_SLOT].tolist())
            pac = wire.Pac(int(row["seq"]), (at + _FIRST_PAC_US) % 2**32, finger, samples)
            messages.append((at, 2, encode(wire.Pac.ID, pac.pack())))
        made += len(rows)
    messages.sort(key=lambda message: message[:2])
    _write(path, out, read.serials, settings, messages)
    show(1.0)
    return {"fingers": fingers, "frames": made, "skipped": read.skipped}


def _write(
    path: Path,
    out: Path,
    serials: tuple[bytes, ...],
    settings: dict[wire.Setting, int],
    messages: list[tuple[int, int, bytes]],
) -> None:
    """Write one block per second. The file has no date: its first frame is at 0 on the host's clock."""
    major, minor, patch = (int(part) for part in __version__.split(".")[:3])
    hello = wire.Hello(
        req_id=0, nonce=0, wire_major=wire.WIRE_MAJOR, wire_minor=wire.WIRE_MINOR, schema_hash=wire.SCHEMA_HASH,
        firmware_major=major, firmware_minor=minor, firmware_patch=patch, board=NO_BOARD, board_serial=(0,) * 12,
        boot_id=0, slot_hz=sensor.SLOT_HZ, fingers_present=(1 << len(serials)) - 1,
        image_crc32=NO_IMAGE, fingers=sensor.MAX_SENSORS, map_bytes=0, board_name=(0,) * 16,
    )  # fmt: skip
    padded = [tuple(own.ljust(SENSOR_SERIAL_BYTES, b"\0")) for own in serials]
    sensors = [
        wire.SensorInfo(0, f, not is_foreign(own), (0,) * 2, (0,) * 4, own, 0, 0) for f, own in enumerate(padded)
    ]
    metadata = Facts(hello, sensors, settings).metadata(f"btd:{path.name}")
    with out.open("xb") as stream:
        file = RecordingFile(stream, metadata)
        second, block = 0, b""
        for at, _, data in messages:
            if at // _BLOCK_US != second:
                file.add(block, second * 10**9)
                second, block = at // _BLOCK_US, b""
            block += data
        file.add(block, second * 10**9)
        file.close()
