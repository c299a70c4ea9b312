"""The compact form of a recording: the wire's integers by finger and column, small and quick to load.

A zip archive of stored members. ``meta.json`` says what there is; each other member is one field of one
finger, ``finger0/frames/counts``: its columns one after another, differences of neighbours where those have
less entropy, folded to small positive numbers (zigzag), byte planes apart, zstd.
"""

from __future__ import annotations

import json
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import zstandard
from numpy.typing import NDArray

from ..errors import RecordingError
from ..wire.frames import StructArray
from .reader import Recording

FORMAT_VERSION = 1
SUFFIX = ".btc"
LEVEL = 9
_META = "meta.json"
KINDS = ("frames", "pac", "idle")

Fields = dict[str, NDArray[Any]]


@dataclass(frozen=True)
class Compact:
    """``frames``, ``pac`` and ``idle``: by finger, by field, arrays (n,) or (n, parts) of the wire's integers.

    Names, units and invalid marks are those of FRAME, PAC and IDLE in MESSAGES.md; ``seq`` and ``t_us`` are
    int64 and unwrapped. ``metadata`` is the recording's.
    """

    metadata: dict[str, str]
    frames: dict[int, Fields] = field(default_factory=dict)
    pac: dict[int, Fields] = field(default_factory=dict)
    idle: dict[int, Fields] = field(default_factory=dict)


def compact(recording: Recording) -> Compact:
    """The columns of a recording."""
    out = Compact(recording.metadata)
    for finger in recording.fingers:
        mine = recording.wire["finger"] == finger
        fields = _fields(recording.wire[mine]) | _counters(recording.frames[mine])
        for kind, rows in (("pac", recording.pac), ("idle", recording.idle)):
            own = rows[rows["finger"] == finger]
            if len(own):
                getattr(out, kind)[finger] = _fields(own) | _counters(own)
        if mine.any():
            out.frames[finger] = fields
    return out


def _fields(rows: StructArray) -> Fields:
    names = rows.dtype.names or ()
    return {name: np.ascontiguousarray(rows[name]) for name in names if name not in ("finger", "seq", "t_us")}


def _counters(rows: StructArray) -> Fields:
    return {name: rows[name].astype(np.int64) for name in ("seq", "t_us")}


def write_compact(path: Path, content: Compact, show: Callable[[float], None] = lambda share: None) -> None:
    """Write ``content`` to ``path``, telling ``show`` the share that is done."""
    todo = [
        (kind, finger, name, values)
        for kind in KINDS
        for finger, fields in getattr(content, kind).items()
        for name, values in fields.items()
    ]
    members: dict[str, Any] = {}
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED) as archive:
        packer = zstandard.ZstdCompressor(level=LEVEL)
        for k, (kind, finger, name, values) in enumerate(todo):
            member = f"finger{finger}/{kind}/{name}"
            columns = series(kind, name, values)
            differences = [entropy_bits(np.diff(c, prepend=c[:1])) < entropy_bits(c) for c in columns]
            archive.writestr(member, packer.compress(_pack(columns, differences)))
            members[member] = {
                "dtype": values.dtype.newbyteorder("<").str,
                "shape": values.shape,
                "columns": len(columns),
                "differences": [int(k) for k in np.flatnonzero(differences)],
            }
            show((k + 1) / len(todo))
        meta = {"format": FORMAT_VERSION, "metadata": content.metadata, "members": members}
        archive.writestr(_META, json.dumps(meta))


def load_compact(path: str | Path) -> Compact:
    """Read a file that write_compact, or ``biotac export REC OUT.btc``, wrote.

    Raises RecordingError when it is none, or damaged.
    """
    place = Path(path)
    try:
        with zipfile.ZipFile(place) as archive:
            meta = json.loads(archive.read(_META))
            if meta["format"] != FORMAT_VERSION:
                raise RecordingError(
                    f"{place} has compact format {meta['format']}, this version reads {FORMAT_VERSION}; "
                    "install a newer biotac-gateway"
                )
            out = Compact(meta["metadata"])
            unpacker = zstandard.ZstdDecompressor()
            for member, about in meta["members"].items():
                finger, kind, name = member.split("/")
                values = _unpack(unpacker.decompress(archive.read(member)), about)
                getattr(out, kind).setdefault(int(finger.removeprefix("finger")), {})[name] = values
    except OSError as error:
        raise RecordingError(f"{place} cannot be read ({error.strerror}); check the path") from error
    except (zipfile.BadZipFile, zstandard.ZstdError, KeyError, TypeError, ValueError, AttributeError) as error:
        raise RecordingError(f"{place} is no compact recording, or damaged ({error}); export it again") from error
    return out


def series(kind: str, name: str, values: NDArray[Any]) -> NDArray[Any]:
    """The columns (c, m) that are coded: a field's own, but PAC's 22 samples are one signal of 2200 Hz."""
    if values.ndim == 1 or (kind, name) == ("pac", "pac"):
        return values.reshape(1, -1)
    return np.ascontiguousarray(values.T)


def entropy_bits(values: NDArray[Any]) -> float:
    """Order-0 entropy of ``values``, in bits for all of them together."""
    _, counts = np.unique(values, return_counts=True)
    return float(-(counts * np.log2(counts / len(values))).sum())


def _pack(columns: NDArray[Any], differences: list[bool]) -> bytes:
    signed = np.dtype(f"<i{columns.itemsize}")
    unsigned = np.dtype(f"<u{columns.itemsize}")
    out = columns.astype(unsigned, copy=True)
    which = np.flatnonzero(differences)
    out[which, 1:] = columns[which, 1:].astype(unsigned) - columns[which, :-1].astype(unsigned)
    folded = out.view(signed)
    # Zigzag: 0, -1, 1, -2 ... become 0, 1, 2, 3 ..., so that the upper bytes of what is small are all zero.
    out[which] = ((folded << 1) ^ (folded >> (8 * columns.itemsize - 1))).view(unsigned)[which]
    planes = out.view(np.uint8).reshape(*out.shape, columns.itemsize)
    return np.moveaxis(planes, -1, 0).tobytes()


def _unpack(data: bytes, about: dict[str, Any]) -> NDArray[Any]:
    dtype = np.dtype(about["dtype"])
    unsigned = np.dtype(f"<u{dtype.itemsize}")
    planes = np.frombuffer(data, np.uint8).reshape(dtype.itemsize, about["columns"], -1)
    out = planes[0].astype(unsigned)
    for k in range(1, dtype.itemsize):
        if planes[k].any():
            out |= planes[k].astype(unsigned) << unsigned.type(8 * k)
    for row in about["differences"]:
        folded = out[row]
        signs = folded & unsigned.type(1)
        folded >>= unsigned.type(1)
        folded ^= np.negative(signs)
        np.cumsum(folded, dtype=unsigned, out=folded)
    values = out.view(dtype)
    shaped: NDArray[Any] = values.reshape(about["shape"]) if about["columns"] == 1 else values.T
    return shaped
