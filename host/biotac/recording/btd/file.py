"""SynTouch's .btd text files: header lines, ``Begin File``, then one line per slot.

A line is ``t batch frame channel`` followed by a pair ``value parity`` for each sensor of the adapter. Parity 0 is
good, 1 is bad; an absent sensor reads bad parity throughout (BioTac QuickStart Guide). The logger
leaves gaps between batches.
"""

from __future__ import annotations

import gzip
import io
import re
import zlib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...errors import RecordingError
from ...wire import sensor_gen as _sensor
from ...wire.identity import SENSOR_SERIAL_BYTES, is_foreign
from ...wire.messages_gen import INVALID_COUNT

_FIRST_PAIR = 4
# Channel numbers (44,) of our slots; a command byte is 1SSSSSSP, S the channel.
_SLOT_CHANNELS = np.array([(_sensor.CHANNEL_COMMAND[name] & 0x7E) >> 1 for name in _sensor.SLOTS])
_BEGIN = b"Begin File"
_MAX_BYTES = 1 << 30  # a day of three sensors is larger
# Real files compress to a tenth of their size; in memory each byte becomes four.
_PACKED_RATIO, _PACKED_FREE_BYTES = 30, 1 << 24


@dataclass(frozen=True)
class BtdFrames:
    """Complete frames of the sensors that were present.

    ``samples`` uint16 (frames, sensors, 44) in our SLOTS order, INVALID_COUNT where the parity was bad. ``t_s``
    (frames,) is the file's time of each frame in s. ``skipped`` counts incomplete frames. ``serials``: of each sensor,
    b"" where the header does not say.
    """

    samples: npt.NDArray[np.uint16]
    t_s: npt.NDArray[np.float64]
    skipped: int
    serials: tuple[bytes, ...] = ()


def read_btd(path: Path) -> BtdFrames:
    """Read a .btd or .btd.gz file. Raises RecordingError, naming the line, for anything malformed."""
    data = _bytes(path)
    header, begin, body = data.partition(_BEGIN)
    if not begin:
        raise RecordingError(f"{path}: no line 'Begin File': expected a SynTouch .btd text file")
    first_line = header.count(b"\n") + 2
    table = _numbers(path, body, first_line)
    channel = table[:, 3]
    values, parity = table[:, _FIRST_PAIR::2], table[:, _FIRST_PAIR + 1 :: 2]

    present = (parity == 0).any(axis=0)
    if not present.any():
        cure = "expected at least one sensor; record again with one connected"
        raise RecordingError(f"{path}: no value has good parity: {cure}")
    if int(present.sum()) > _sensor.MAX_SENSORS:
        cure = f"expected at most {_sensor.MAX_SENSORS}; remove the columns of the others"
        raise RecordingError(f"{path}: {present.sum()} sensors: {cure}")
    values, good = values[:, present], parity[:, present] == 0
    wrong = good & ((values < 0) | (values > _sensor.FULL_SCALE_COUNT) | (values != np.floor(values)))
    if wrong.any():
        row, sensor = (int(k) for k in np.argwhere(wrong)[0])
        raise RecordingError(
            f"{path}: line {first_line + row} holds {values[row, sensor]:g} with good parity: "
            f"expected a whole count 0..{_sensor.FULL_SCALE_COUNT}; copy the file again"
        )
    words = np.where(good, values, INVALID_COUNT).astype(np.uint16)

    starts, skipped = _complete_frames(table[:, 1], table[:, 2], channel)
    if len(starts) == 0:
        raise RecordingError(
            f"{path}: no complete frame among {skipped}: expected {len(_sensor.SLOTS)} lines per frame with "
            "E1..E19, PDC, TAC and TDC once and PAC 22 times (the 54-slot frames of a BioTac SP are not supported)"
        )
    rows = starts[:, None] + np.arange(len(_sensor.SLOTS))
    # a stable sort by channel aligns the k-th sample of a channel in the file with its k-th slot in SLOTS
    here = np.argsort(channel[rows], axis=1, kind="stable")
    order = np.argsort(_SLOT_CHANNELS, kind="stable")
    samples = np.empty((len(starts), words.shape[1], len(_sensor.SLOTS)), dtype=np.uint16)
    samples[:, :, order] = words[np.take_along_axis(rows, here, axis=1)].transpose(0, 2, 1)
    serials = zip(_serials(header, len(present)), present, strict=True)
    return BtdFrames(samples, table[starts, 0], skipped, tuple(serial for serial, is_present in serials if is_present))


def _serials(header: bytes, places: int) -> list[bytes]:
    """Of the adapter's ``places``, by the line ``Serial Number: ,,BTSP050400018017``; b"" where there is none.

    A BioTac SP's is that of every place without one: no force must come of a file that names one anywhere.
    """
    line = re.search(rb"^\s*Serial Number:([^\r\n]*)", header, re.M)
    found = [re.sub(rb"[^!-~]", b"", text)[:SENSOR_SERIAL_BYTES] for text in (line[1] if line else b"").split(b",")]
    foreign = next((serial for serial in found if is_foreign(serial)), b"")
    return [serial or foreign for serial in [*found, *[b""] * places][:places]]


def _complete_frames(
    batch: npt.NDArray[np.float64], frame: npt.NDArray[np.float64], channel: npt.NDArray[np.float64]
) -> tuple[npt.NDArray[np.int64], int]:
    """First rows of the complete frames, and the number of incomplete ones."""
    change = np.flatnonzero((np.diff(batch) != 0) | (np.diff(frame) != 0)) + 1
    starts = np.concatenate([[0], change]).astype(np.int64)
    lengths = np.diff(np.append(starts, len(batch)))
    slots = len(_sensor.SLOTS)
    whole = starts[lengths == slots]
    expected = np.sort(_SLOT_CHANNELS)
    found = np.sort(channel[whole[:, None] + np.arange(slots)], axis=1)
    complete = whole[(found == expected).all(axis=1)]
    return complete, len(starts) - len(complete)


def _bytes(path: Path) -> bytes:
    packed = path.name.lower().endswith(".gz")
    try:
        limit = min(_MAX_BYTES, _PACKED_FREE_BYTES + _PACKED_RATIO * path.stat().st_size) if packed else _MAX_BYTES
        with gzip.open(path) if packed else path.open("rb") as file:
            data = file.read(limit + 1)
    except (OSError, EOFError, zlib.error) as error:
        seen = getattr(error, "strerror", None)  # only errors of the operating system have it, not damaged data
        cure = "check the path" if seen else "copy it again"
        raise RecordingError(f"{path}: cannot be read ({seen or error}): expected a .btd; {cure}") from None
    if len(data) > limit:
        raise RecordingError(f"{path}: holds more than {limit >> 20} MiB of text: expected at most that; split it")
    return data


def _numbers(path: Path, body: bytes, first_line: int) -> npt.NDArray[np.float64]:
    """The lines after ``Begin File`` as float64 (lines, 4 + 2 * sensors)."""
    if not body.strip():
        raise RecordingError(f"{path}: nothing after 'Begin File': expected one line per slot; record again")
    # drop the rest of the 'Begin File' line, so that row 0 is the line after it
    body = body.partition(b"\n")[2]
    try:
        table = _table(body)
    except ValueError:
        try:  # without its last line, if the file is cut within that
            table = _table(body[: body.rfind(b"\n") + 1])
        except ValueError:
            table = np.empty((0, 0))
    columns, parity = table.shape[1], table[:, _FIRST_PAIR + 1 :: 2]
    paired = columns >= _FIRST_PAIR + 2 and columns % 2 == 0
    if not paired or not np.isfinite(table).all() or not np.isin(parity, (0, 1)).all():
        raise RecordingError(f"{path}: {_first_fault(body, first_line)}")
    return table


def _table(body: bytes) -> npt.NDArray[np.float64]:
    if not body.strip():
        raise ValueError("no lines")
    return np.loadtxt(io.BytesIO(body), dtype=np.float64, ndmin=2, comments=None, encoding="latin-1")


def _first_fault(body: bytes, first_line: int) -> str:
    """Error text naming the first malformed line. Slow: only called when there is an error."""
    expected = "expected 't batch frame channel' and 'value parity' for each sensor; copy the file again"
    columns = 0
    for number, line in enumerate(body.split(b"\n"), first_line):
        parts = line.split()
        if not parts:
            continue
        columns = columns or len(parts)
        try:
            numbers = [float(part) for part in parts]
        except ValueError:
            numbers = []
        paired = len(numbers) == columns >= _FIRST_PAIR + 2 and columns % 2 == 0
        parity_good = all(parity in (0.0, 1.0) for parity in numbers[_FIRST_PAIR + 1 :: 2])
        if not paired or not parity_good or not np.isfinite(numbers).all():
            return f"line {number} is {line[:60].decode('latin-1').strip()!r}: {expected}"
    return f"not a table of numbers: {expected}"
