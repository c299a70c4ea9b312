"""One block of a recording, about a second: the packets as the board sent them, and a head that describes them.

The packets are those that passed their CRC, in order of arrival, as id, length and payload. The head is a line of
JSON, enough to number a block's rows without the blocks before it. The forces on simulated fingers are a separate
part, which no board sends.
"""

from __future__ import annotations

import json
from collections.abc import Collection
from dataclasses import dataclass, field, fields
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..wire import messages_gen as wire
from ..wire.batches import Batch
from ..wire.fields import FORCE_LSB_PER_N
from ..wire.frames import to_units

_APPLIED = np.dtype(("<i4", 3))


class FingerRows(NamedTuple):
    """A finger's rows in a block: the number of FRAMEs, the unwrapped numbers of the first row and the first PAC."""

    finger: int
    frames: int
    seq: int | None
    pac_seq: int | None


@dataclass
class Head:
    """The description of a block.

    ``clock_us`` is device time before it, None at the beginning. ``first_us`` and ``last_us`` are the first and last
    time of FRAMEs and heartbeats, None without any. ``rows`` has each finger with rows. ``frames``, ``frames_lost``,
    ``pac_lost`` and ``disordered`` count from the beginning of the file to the end of this block. ``rejected`` counts
    damaged packets, by the names of FramingCounts. ``gaps`` are times during which the board was away, before this
    block's first row. ``labels`` were made during the block. ``has_applied``: the forces on the fingers are known.
    """

    clock_us: int | None = None
    first_us: int | None = None
    last_us: int | None = None
    rows: list[FingerRows] = field(default_factory=list)
    frames: int = 0
    frames_lost: int = 0
    pac_lost: int = 0
    disordered: int = 0
    rejected: dict[str, int] = field(default_factory=dict)
    gaps: list[dict[str, Any]] = field(default_factory=list)
    labels: list[dict[str, Any]] = field(default_factory=list)
    has_packets: bool = True
    has_applied: bool = False

    def pack(self) -> bytes:
        """A line of JSON."""
        return json.dumps(vars(self), separators=(",", ":")).encode()

    @classmethod
    def unpack(cls, data: bytes) -> Head:
        """Inverse of ``pack``. Raises ValueError, TypeError or KeyError for anything else."""
        stored = json.loads(data)
        names = [one.name for one in fields(cls)]
        head = {name: stored[name] for name in names if name in stored}  # a newer version may have more
        head["rows"] = [FingerRows(*map(_whole, row)) for row in head["rows"]]
        counts = ("frames", "frames_lost", "pac_lost", "disordered")
        head |= {name: int(head[name]) for name in counts}
        head |= {name: _whole(head[name]) for name in ("clock_us", "first_us", "last_us")}
        head["rejected"] = {str(kind): int(count) for kind, count in head["rejected"].items()}
        return cls(**head)

    @property
    def fingers(self) -> list[int]:
        """Those with rows."""
        return [row.finger for row in self.rows]


def _whole(value: Any) -> Any:
    return None if value is None else int(value)


def rows_of(batch: Batch) -> list[FingerRows]:
    """The rows of ``batch``, as a head has them."""
    frames, beats = _first(batch.wire["finger"], batch.seq), _first(batch.idle["finger"], batch.idle["seq"])
    pacs, counts = _first(batch.pac["finger"], batch.pac["seq"]), np.bincount(batch.wire["finger"], minlength=256)
    rows = []
    for finger in sorted({*frames, *beats, *pacs}):
        seq = min((of[finger] for of in (frames, beats) if finger in of), default=None)
        rows.append(FingerRows(finger, int(counts[finger]), seq, pacs.get(finger)))
    return rows


def _first(fingers: NDArray[np.uint8], seq: NDArray[np.int64]) -> dict[int, int]:
    numbers, at = np.unique(fingers, return_index=True)
    return dict(zip(numbers.tolist(), seq[at].tolist(), strict=True))


def of_fingers(batch: Batch, fingers: Collection[int]) -> tuple[Batch, NDArray[np.bool_]]:
    """Those rows of ``batch`` that are of ``fingers``, and the mask of their FRAMEs."""
    chosen = np.isin(np.arange(256), list(fingers))
    frames, pac, idle = (chosen[rows["finger"]] for rows in (batch.wire, batch.pac, batch.idle))
    rows = batch.wire[frames], batch.seq[frames], batch.t_us[frames], batch.pac[pac], batch.idle[idle]
    return Batch(*rows, batch.messages), frames


def pack_applied(applied_n: NDArray[np.float64]) -> bytes:
    """Forces (n, 3) in N as 0.1 mN, at the wire's invalid mark where they are not known."""
    steps = np.nan_to_num(np.clip(np.rint(applied_n * FORCE_LSB_PER_N), -2e9, 2e9), nan=wire.INVALID_I32)
    return bytes(steps.astype("<i4"))


def unpack_applied(data: bytes, frames: int) -> NDArray[np.float64]:
    """Inverse of ``pack_applied``. Raises ValueError for another number of frames."""
    steps = np.frombuffer(data, _APPLIED)
    if len(steps) != frames:
        raise ValueError(f"the forces applied to {len(steps)} frames, expected {frames}")
    return to_units(steps, FORCE_LSB_PER_N)
