"""One message of another driver: each finger's counts, and their time."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...wire import sensor_gen as sensor

KINDS = (len(sensor.ELECTRODE_NAMES), sensor.FOREIGN_ELECTRODES)
SLOT_US = (np.arange(len(sensor.SLOTS)) * 1e6 / sensor.SLOT_HZ).astype(np.uint32)
ALTERNATE_NS = 10**9  # two senders, or two sensors, that take turns within that are two hands
MAX_PAC = 4096  # in one message: two seconds


class RefusedError(Exception):
    """A message that is none of a BioTac's; its text says what was seen and expected."""


@dataclass(frozen=True)
class Counts:
    """A finger's: ``electrodes`` int64 (19,) or (24,), in range or not; None, or no PAC, where nothing was said."""

    electrodes: NDArray[np.int64]
    pdc: int | None = None
    tac: int | None = None
    tdc: int | None = None
    pac: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    serial: bytes = b""


@dataclass(frozen=True)
class Message:
    """``fingers``: five, or those at ``positions`` of the hand; None where there is no sensor. ``slot_us`` (44,): when
    each slot was sampled after the stamp, None where unknown.

    ``logged_ns`` is for a source whose stamps are 0, None where a stamp may be 0. ``refused``: why single fingers are
    left out.
    """

    stamp_ns: int
    fingers: tuple[Counts | None, ...]
    slot_us: NDArray[np.uint32] | None = None
    logged_ns: int | None = None
    positions: tuple[int, ...] = ()
    refused: tuple[str, ...] = ()


class Found:
    """A message's fingers, of which one that is wrong is left out alone."""

    def __init__(self) -> None:
        self.fingers: list[Counts | None] = []
        self.refused: list[str] = []

    def add(self, *words: Any) -> None:
        """Of ``counts_of``'s."""
        try:
            self.fingers.append(counts_of(*words))
        except RefusedError as error:
            self.fingers.append(None)
            self.refused.append(str(error))

    def message(self, stamp_ns: int, *, places: int, **more: Any) -> Message:
        """Raises RefusedError when no finger is left."""
        if self.refused and not any(own is not None for own in self.fingers):
            raise RefusedError(self.refused[0])
        fingers = tuple([*self.fingers, *[None] * places][:places])
        return Message(stamp_ns, fingers, refused=tuple(self.refused), **more)


def counts_of(
    finger: int | str, electrodes: Any, pdc: Any, tac: Any, tdc: Any, pac: Any = (), serial: bytes = b""
) -> Counts | None:
    """Counts as a message has them; None when all is zero: no sensor.

    Raises RefusedError for another number of electrodes, and for values that are no integers.
    """
    values = _integers(f"finger {finger}: electrodes", electrodes)
    samples = _integers(f"finger {finger}: PAC", pac)
    slow = [None if word is None else int(_integers(f"finger {finger}", [word])[0]) for word in (pdc, tac, tdc)]
    if not values.any() and not any(slow) and not samples.any():
        return None
    if len(values) not in KINDS:
        raise RefusedError(f"finger {finger} has {len(values)} electrodes, expected 19, or a BioTac SP's 24")
    if len(samples) > MAX_PAC:
        raise RefusedError(f"finger {finger} has {len(samples)} samples of PAC, expected at most {MAX_PAC}")
    valid = [word if word is not None and 0 <= word <= sensor.FULL_SCALE_COUNT else None for word in slow]
    return Counts(values, valid[0], valid[1], valid[2], samples, serial)


def _integers(name: str, values: Any) -> NDArray[np.int64]:
    array = np.asarray(values)
    if array.ndim != 1 or (array.size and array.dtype.kind not in "iuf"):
        raise RefusedError(f"{name} are {array.dtype} of shape {array.shape}, expected integers in a row")
    if array.dtype.kind == "f" and not (np.isfinite(array) & (array == np.floor(array)) & (abs(array) < 1e9)).all():
        raise RefusedError(f"{name} hold what is no whole number; expected counts")
    return array.astype(np.int64)
