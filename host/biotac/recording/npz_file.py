"""Reading and checking trials in .npz files, and rotating their vectors into Lin's frame."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from ..errors import RecordingError
from ..wire import sensor_gen as _sensor
from ..wire.identity import columns_text

# Of all wanted fields: an hour of every channel as float64 is 150 MB; one zipped byte can unpack to 1000.
MAX_BYTES = 192 << 20
MAX_ROWS = 360_000  # an hour


def read_npz(path: Path, wanted: Collection[str]) -> dict[str, npt.NDArray[Any]]:
    """The ``wanted`` arrays that the file has. Raises RecordingError if it is not a valid .npz, or too large."""
    try:
        # opened here because np.load does not close a file that it cannot read
        with path.open("rb") as file:
            archive = np.load(file, allow_pickle=False)
            if not isinstance(archive, np.lib.npyio.NpzFile):
                raise RecordingError(
                    f"{path}: holds a single array: expected an .npz with field E; save it with numpy.savez"
                )
            names = [name for name in archive.files if name in wanted]
            assert archive.zip is not None  # until it is closed
            for member in archive.zip.infolist():
                archive.zip.open(member).close()  # refuses a member that has another name in its own header
                if member.comment:  # NumPy writes none: a wrong length takes the next member for one
                    raise RecordingError(f"{path}: {member.filename} is damaged; copy it again")
            size = sum(archive.zip.getinfo(f"{name}.npy").file_size for name in names)
            if size > MAX_BYTES:
                raise RecordingError(
                    f"{path}: its fields take {size >> 20} MiB: expected at most {MAX_BYTES >> 20}; split it"
                )
            fields = {}
            for name in names:
                fields[name] = np.asarray(archive[name])
                if fields[name].shape[:1] > (MAX_ROWS,):
                    raise RecordingError(
                        f"{path}: field {name} has {len(fields[name])} rows: expected at most {MAX_ROWS}; split it"
                    )
            return fields
    except RecordingError:
        raise
    except OSError as error:
        raise RecordingError(f"{path} cannot be read ({error.strerror or error}); check the path") from None
    except Exception as error:  # a damaged header is parsed as Python and can fail in many ways
        seen = str(error).partition("\n")[0]
        raise RecordingError(
            f"{path}: cannot be read ({seen}): expected an .npz of numeric arrays; save it again"
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
        sp = columns_text(shape[-1]) if len(shape) == 2 else ""
        raise RecordingError(f"{path}: field {name} has shape {shape}: expected {wanted}, one row per frame{sp}")
    expected = f"expected whole counts 0..{_sensor.FULL_SCALE_COUNT}; save raw counts"
    if array.dtype.kind not in "iuf":
        raise RecordingError(f"{path}: field {name} holds {array.dtype}: {expected}")
    # written so that NaN fails too
    right = (array >= 0) & (array <= _sensor.FULL_SCALE_COUNT) & (array == np.floor(array))
    if not right.all():
        row = int(np.argwhere(~right)[0][0])
        raise RecordingError(f"{path}: field {name} row {row} holds {array[~right][0]}: {expected}")
    return array.astype(np.uint16)


def to_lin_frame(vectors: npt.NDArray[Any]) -> npt.NDArray[np.float64]:
    """Recorded vectors (n, 3) (X lateral, Y to the tip, Z out of the pad) in Lin's frame: x = Y, y = X, z = -Z.

    This is a rotation, so torques transform as forces do.
    """
    recorded = vectors.astype(np.float64)
    return np.column_stack([recorded[:, 1], recorded[:, 0], -recorded[:, 2]])
