"""Recorded counts as sources: .npz arrays and .btd text.

Each row is a frame. Frames are played at 100 Hz whatever the recording's time stamps say: gaps and jitter of the logger
are not replayed.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt

from ..errors import RecordingError
from ..recording.btd.file import read_btd
from ..recording.npz_file import counts_field, read_npz, to_lin_frame
from ..wire import slots
from ..wire.fields import Q4_PER_COUNT
from ..wire.messages_gen import INVALID_COUNT
from .fault_gen import EmuFault
from .source import Source

_SLOW = {name.upper(): np.array([slot]) for name, slot in slots.SLOW_SLOTS.items()}
_SLOTS_OF = {"E": slots.ELECTRODE_SLOT, **_SLOW, "PAC": slots.PAC_SLOT}


def load_npz(path: Path, *, fingers: int | None = None, seconds: float | None = None) -> Source:
    """One recorded finger from an .npz file.

    Fields, counts 0..4095 of any number type: ``E`` (n, 19), required; ``PDC``, ``TAC``, ``TDC``
    (n,) and ``PAC`` (n, 22), if absent played as channels that the sensor does not have; ``F``
    (n, 3) N as data/README.md has it (X lateral, Y to the tip, Z out of the pad), turned into Lin's
    frame; ``E_base`` (m, 19), the same finger in free air, with the stored tare as mean.
    Others are ignored. Raises RecordingError naming the field.
    """
    fields = read_npz(path, (*_SLOTS_OF, "F", "E_base"))
    if "E" not in fields:
        seen = ", ".join(fields) or "none of the known fields"
        raise RecordingError(f"{path}: holds {seen}: expected a field E of shape (n, 19); save it as E")
    electrodes = counts_field(path, "E", fields["E"], None, len(slots.ELECTRODE_SLOT))
    frames = len(electrodes)
    samples = np.full((frames, 1, slots.SLOTS_PER_FRAME), EmuFault.NO_CHANNEL, dtype=np.uint16)
    for name, where in _SLOTS_OF.items():
        if name in fields:
            columns = None if name in _SLOW else len(where)
            samples[:, 0, where] = counts_field(path, name, fields[name], frames, columns).reshape(frames, -1)
    tare_q4 = force_n = None
    if "E_base" in fields:
        base = counts_field(path, "E_base", fields["E_base"], None, len(slots.ELECTRODE_SLOT))
        tare_q4 = np.rint(base.mean(axis=0) * Q4_PER_COUNT).astype(np.uint16)[None, :]
    if "F" in fields:
        force = fields["F"]
        if force.shape != (frames, 3) or force.dtype.kind not in "iuf" or not np.isfinite(force).all():
            raise RecordingError(
                f"{path}: field F is {force.dtype} {force.shape}: expected ({frames}, 3) numbers in N without NaN or "
                "inf; correct F"
            )
        force_n = to_lin_frame(force)[:, None, :]
    return _source(path, samples, fingers, seconds, tare_q4=tare_q4, force_n=force_n)


def load_btd(path: Path, *, fingers: int | None = None, seconds: float | None = None) -> Source:
    """The sensors present in a .btd or .btd.gz file; incomplete frames are omitted and counted.

    The board's sensors have the file's serial numbers: a BioTac SP's gives no force.
    Raises RecordingError naming the line.
    """
    read = read_btd(path)
    samples = np.where(read.samples == INVALID_COUNT, EmuFault.BAD_PARITY, read.samples).astype(np.uint16)
    return _source(path, samples, fingers, seconds, skipped=read.skipped, serials=read.serials)


def _source(
    path: Path,
    samples: npt.NDArray[np.uint16],
    fingers: int | None,
    seconds: float | None,
    *,
    tare_q4: npt.NDArray[np.uint16] | None = None,
    force_n: npt.NDArray[np.float64] | None = None,
    skipped: int = 0,
    serials: tuple[bytes, ...] = (b"",),
) -> Source:
    """Crop to ``seconds`` and cut or copy to ``fingers``."""
    end = None if seconds is None else max(1, round(seconds * slots.FRAME_HZ))
    recorded = samples.shape[1]
    which = np.arange(recorded if fingers is None else fingers) % recorded
    return Source(
        name=path.name,
        samples=samples[:end, which],
        tare_q4=None if tare_q4 is None else tare_q4[which],
        truth_force_n=None if force_n is None else force_n[:end, which],
        serials=tuple(serials[f].decode() or f"BTREC{k:011d}" for k, f in enumerate(which)),
        skipped_frames=skipped,
    )
