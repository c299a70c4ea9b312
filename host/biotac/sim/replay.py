"""Recorded counts as sources: .npz arrays and .btd text.

A row is a frame and frames are played at 100 Hz whatever the recording's time stamps say: gaps and
jitter of the logger are not replayed.
"""

from __future__ import annotations

import struct
import zipfile
import zlib
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import RecordingError
from ..recording.btd_file import read_btd
from ..wire import sensor_gen as _sensor
from . import sampling, tape
from .source import Source

_TARE_FRACTION = 16  # TARE_SET: counts with four fractional bits
_SLOTS_OF = {
    "E": sampling.ELECTRODE_SLOT,
    "PDC": np.array([sampling.PDC_SLOT]),
    "TAC": np.array([sampling.TAC_SLOT]),
    "TDC": np.array([sampling.TDC_SLOT]),
    "PAC": sampling.PAC_SLOT,
}


def load_npz(path: Path, *, fingers: int | None = None, seconds: float | None = None) -> Source:
    """One recorded finger from an .npz file.

    Fields, counts 0..4095 of any number type: ``E`` (n, 19), required; ``PDC``, ``TAC``, ``TDC``
    (n,) and ``PAC`` (n, 22), whose absence the sensor answers as a channel it does not have; ``F``
    (n, 3) N as data/README.md has it (X lateral, Y to the tip, Z out of the pad), turned into Lin's
    frame; ``E_base`` (m, 19), the same finger in free air, whose mean becomes the stored tare.
    Others are ignored. Raises RecordingError naming the field.
    """
    fields = read_npz(path, (*_SLOTS_OF, "F", "E_base"))
    if "E" not in fields:
        seen = ", ".join(fields) or "none of the known fields"
        raise RecordingError(f"{path}: holds {seen}: expected a field E of shape (n, 19); save it as E")
    electrodes = counts_field(path, "E", fields["E"], None, len(sampling.ELECTRODE_SLOT))
    frames = len(electrodes)
    samples = np.full((frames, 1, sampling.SLOTS_PER_FRAME), tape.NO_CHANNEL, dtype=np.uint16)
    for name, slots in _SLOTS_OF.items():
        if name in fields:
            columns = None if name in ("PDC", "TAC", "TDC") else len(slots)
            samples[:, 0, slots] = counts_field(path, name, fields[name], frames, columns).reshape(frames, -1)
    tare_q4 = None
    if "E_base" in fields:
        base = counts_field(path, "E_base", fields["E_base"], None, len(sampling.ELECTRODE_SLOT))
        tare_q4 = np.rint(base.mean(axis=0) * _TARE_FRACTION).astype(np.uint16)[None, :]
    force_n = _force(path, fields["F"], frames)[:, None, :] if "F" in fields else None
    return _source(path, samples, fingers, seconds, tare_q4=tare_q4, force_n=force_n)


def load_btd(path: Path, *, fingers: int | None = None, seconds: float | None = None) -> Source:
    """The sensors of a .btd or .btd.gz file that were there, incomplete frames left out and counted.

    Raises RecordingError naming the line.
    """
    read = read_btd(path)
    return _source(path, read.samples, fingers, seconds, skipped=read.skipped)


def read_npz(path: Path, wanted: Collection[str]) -> dict[str, npt.NDArray[Any]]:
    """Those of the ``wanted`` arrays that the file has. Raises RecordingError for what is no .npz."""
    try:
        # opened here because np.load leaves a file it cannot read open
        with path.open("rb") as file:
            archive = np.load(file, allow_pickle=False)
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise RecordingError(f"{path}: one bare array: expected an .npz with field E; use numpy.savez")
            return {name: np.asarray(archive[name]) for name in archive.files if name in wanted}
    except (
        OSError, EOFError, ValueError, MemoryError, RuntimeError, struct.error, zipfile.BadZipFile, zlib.error,
    ) as error:  # fmt: skip
        seen = str(error).partition("\n")[0]
        raise RecordingError(
            f"{path}: cannot be read ({seen}): expected an .npz of number arrays; save it again"
        ) from None


def counts_field(
    path: Path, name: str, array: npt.NDArray[Any], rows: int | None, columns: int | None
) -> npt.NDArray[np.uint16]:
    """``array`` as counts; ``rows`` None: any number but 0; ``columns`` None: one-dimensional.

    Raises RecordingError naming file, field and row.
    """
    wanted = f"({rows if rows is not None else 'n'}{f', {columns}' if columns is not None else ','})"
    shape: tuple[int, ...] = array.shape
    good = len(shape) == (1 if columns is None else 2) and shape[0] > 0
    good = good and (rows is None or shape[0] == rows) and (columns is None or shape[1] == columns)
    if not good:
        raise RecordingError(f"{path}: field {name} has shape {shape}: expected {wanted}, one row a frame")
    expected = f"expected whole counts 0..{_sensor.FULL_SCALE_COUNT}; save raw counts"
    if array.dtype.kind not in "iuf":
        raise RecordingError(f"{path}: field {name} holds {array.dtype}: {expected}")
    # written so that NaN is wrong too
    right = (array >= 0) & (array <= _sensor.FULL_SCALE_COUNT) & (array == np.floor(array))
    if not right.all():
        row = int(np.argwhere(~right)[0][0])
        raise RecordingError(f"{path}: field {name} row {row} holds {array[~right][0]}: {expected}")
    counts: npt.NDArray[np.uint16] = array.astype(np.uint16)
    return counts


def _force(path: Path, array: npt.NDArray[Any], rows: int) -> npt.NDArray[np.float64]:
    """F (n, 3) as recorded -> force on the finger in Lin's frame: x = Fy, y = Fx, z = -Fz."""
    if array.shape != (rows, 3) or array.dtype.kind not in "iuf" or not np.isfinite(array).all():
        raise RecordingError(
            f"{path}: field F is {array.dtype} {array.shape}: expected finite numbers ({rows}, 3) in N"
        )
    return to_lin_frame(array)


def to_lin_frame(vectors: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Recorded vectors (n, 3), X lateral, Y to the tip, Z out of the pad, in Lin's frame: x = Y, y = X, z = -Z.

    That is a rotation, so torques turn as forces do.
    """
    recorded = vectors.astype(np.float64)
    return np.column_stack([recorded[:, 1], recorded[:, 0], -recorded[:, 2]])


def _source(
    path: Path,
    samples: npt.NDArray[np.uint16],
    fingers: int | None,
    seconds: float | None,
    *,
    tare_q4: npt.NDArray[np.uint16] | None = None,
    force_n: npt.NDArray[np.float64] | None = None,
    skipped: int = 0,
) -> Source:
    """Crop to ``seconds`` and cut or copy to ``fingers``."""
    end = None if seconds is None else max(1, round(seconds * sampling.FRAME_HZ))
    recorded = samples.shape[1]
    which = np.arange(recorded if fingers is None else fingers) % recorded
    return Source(
        name=path.name,
        samples=samples[:end, which],
        tare_q4=None if tare_q4 is None else tare_q4[which],
        truth_force_n=None if force_n is None else force_n[:end, which],
        serials=tuple(f"BTREC{k:011d}" for k in range(len(which))),
        skipped_frames=skipped,
    )
