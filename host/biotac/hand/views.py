"""Fingers by name, and the latest values of each."""

from __future__ import annotations

import math
import threading
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from operator import index
from typing import Any, NoReturn, SupportsIndex, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from ..clock import LAST_SAMPLE_US, DeviceClock
from ..clock.host_clock import HostClock
from ..errors import InputError
from ..wire.batches import Batch
from ..wire.frames import FRAME_DTYPE, Frame, StructArray, frames_from_wire
from ..wire.messages_gen import INVALID_COUNT, FrameFlags
from ..wire.sensor_gen import MAX_SENSORS

T = TypeVar("T")
#: Several fingers: a bit mask of chip selects, a name, or names and chip selects.
Fingers: TypeAlias = int | str | Iterable[str | int]

#: Chip selects by name, unless ``biotac.open(..., fingers=...)`` says otherwise.
DEFAULT_NAMES = {"index": 0, "middle": 1, "ring": 2, "little": 3, "thumb": 4}

NOTHING_YET = (
    FrameFlags.UNTARED
    | FrameFlags.POC_INVALID
    | FrameFlags.ELECTRODE_MISSING
    | FrameFlags.PDC_MISSING
    | FrameFlags.TAC_MISSING
    | FrameFlags.TDC_MISSING
    | FrameFlags.FAULT
)


def checked_names(names: Mapping[str, int] | None) -> dict[str, int]:
    """A copy of ``names``, None for the default. Raises InputError unless each name has a chip select of its own."""
    chosen = dict(DEFAULT_NAMES if names is None else names)
    for name, finger in chosen.items():
        if not isinstance(finger, int) or not 0 <= finger < MAX_SENSORS:
            raise InputError(f"fingers: {name!r} is {finger!r}, expected a chip select 0 to {MAX_SENSORS - 1}")
        if list(chosen.values()).count(finger) > 1:
            raise InputError(f"fingers: {name!r} shares chip select {finger}; give each name its own")
    return chosen


def finger_index(names: Mapping[str, int], key: str | SupportsIndex) -> int:
    """Chip select of a name or an integer, NumPy's included. Raises KeyError for an unknown finger."""
    if isinstance(key, str):
        if key in names:
            return names[key]
    elif hasattr(key, "__index__") and 0 <= (number := index(key)) < MAX_SENSORS:
        return number
    raise KeyError(f"no finger {key!r}; expected one of {', '.join(map(repr, names))}, or 0 to {MAX_SENSORS - 1}")


# Batches wait until somebody looks at them, or until there are this many.
UNSEEN_BATCHES = 16


class Latest:
    """The newest frame or heartbeat of each finger, and when it came.

    The thread that reads the link only stores the batch: searching each one costs as much as decoding it, and most are
    never looked at.
    """

    def __init__(
        self, host_clock: HostClock, names: Mapping[str, int] | None = None, *, device_clock: DeviceClock | None = None
    ) -> None:
        self._monotonic_s = host_clock.monotonic_s
        self._device_clock = device_clock or DeviceClock()
        self.names = checked_names(names)
        #: Whether the board is being looked for, so that its last values say nothing about now; raises once it is lost.
        self.is_away: Callable[[], bool] = lambda: False
        self._unseen: deque[tuple[Batch, float]] = deque()
        self._unseen_fingers = 0  # bit mask
        # finger: (batch, row, row is a heartbeat, arrival in s)
        self._entries: dict[int, tuple[Batch, int, bool, float]] = {}
        self._looking = threading.Lock()

    def __getitem__(self, key: str | SupportsIndex) -> FingerView:
        """A finger by name or chip select. Raises KeyError for an unknown one."""
        finger = finger_index(self.names, key)
        return FingerView(self.name(finger), finger, self)

    def name(self, finger: int) -> str:
        """The name of a chip select, or its number as text if it has no name."""
        return next((name for name, number in self.names.items() if number == finger), str(finger))

    def mask(self, fingers: Fingers) -> int:
        """Bit mask of several fingers. Raises KeyError for an unknown one."""
        if isinstance(fingers, str):
            return 1 << finger_index(self.names, fingers)
        if isinstance(fingers, Iterable):
            return sum({1 << finger_index(self.names, finger) for finger in fingers})
        return index(fingers)

    def forked(self) -> None:
        """Renew the lock in a forked child: its holder may be a thread of the parent process."""
        self._looking = threading.Lock()

    def update(self, batch: Batch, when_s: float) -> None:
        """Store a batch that has arrived. To be called by one thread at a time."""
        unseen, fingers = self._unseen, batch.fingers
        if not unseen or (fingers >= 0 and not self._unseen_fingers & ~fingers):
            unseen.clear()  # nobody needs the older batches: all their fingers are in this one
            self._unseen_fingers = fingers
        else:
            self._unseen_fingers |= fingers
        unseen.append((batch, when_s))
        if len(unseen) >= UNSEEN_BATCHES:
            self._look()

    def _look(self) -> dict[int, tuple[Batch, int, bool, float]]:
        with self._looking:
            batches = []
            while self._unseen:
                with suppress(IndexError):  # the reading thread may clear it at the same time
                    batches.append(self._unseen.popleft())
            seen = 0
            for batch, when_s in reversed(batches):
                if not batch.fingers & ~seen:
                    continue  # later batches had all of these fingers
                for finger, (row, idle) in _last_of(batch).items():
                    if not seen >> finger & 1:
                        self._entries[finger] = (batch, row, idle, when_s)
                        seen |= 1 << finger
            return self._entries

    def last_t_us(self) -> int | None:
        """Device time of the latest frame or heartbeat of any finger, in us; None before any."""
        return max((self._t_us(*entry[:3]) for entry in list(self._look().values())), default=None)

    @staticmethod
    def _t_us(batch: Batch, row: int, idle: bool) -> int:
        return int(batch.idle["t_us"][row] if idle else batch.t_us[row])

    def row(self, finger: int) -> StructArray:
        """FRAME_DTYPE (1,): the latest frame, or the values of a heartbeat; without either all invalid, t_us -1."""
        is_away = self.is_away()
        entry = self._look().get(finger)
        if entry is None or is_away:
            return _empty(finger, -1, 0, NOTHING_YET)
        batch, row, idle, _ = entry
        if not idle:
            one = slice(row, row + 1)
            return frames_from_wire(batch.wire[one], batch.seq[one], batch.t_us[one])
        beat = batch.idle[row]
        flags = FrameFlags(int(beat["flags"])) | FrameFlags.POC_INVALID | FrameFlags.NOT_ASKED
        out = _empty(finger, int(beat["t_us"]), int(beat["seq"]), flags)
        out["pdc"], out["tdc"] = beat["pdc"], beat["tdc"]
        return out

    def age_s(self, finger: int) -> float:
        """Time since the samples of a finger's latest row were taken, at least since the row came; inf before any."""
        entry = self._look().get(finger)
        if entry is None:
            return math.inf
        now_s = self._monotonic_s()
        since_arrival_s = now_s - entry[3]
        # NaN while the clock knows nothing. A row was taken before it came, whatever the clock's estimate says.
        taken_s = self._device_clock.estimate_s(self._t_us(*entry[:3]) + LAST_SAMPLE_US)
        return max(since_arrival_s, now_s - taken_s)  # NaN is never larger


def _last_of(batch: Batch) -> dict[int, tuple[int, bool]]:
    """Each finger's latest row, and whether it is a heartbeat."""
    rows = _last_rows(batch.wire)
    out = {finger: (row, False) for finger, row in rows.items()}
    for finger, row in _last_rows(batch.idle).items() if len(batch.idle) else ():
        # A batch can hold a frame and a heartbeat of one finger: the later in device time counts.
        if finger not in rows or batch.idle["t_us"][row] > batch.t_us[rows[finger]]:
            out[finger] = (row, True)
    return out


def _last_rows(messages: StructArray) -> dict[int, int]:
    """Each finger's last row."""
    return {finger: row for row, finger in enumerate(messages["finger"].tolist())}


def _empty(finger: int, t_us: int, seq: int, flags: FrameFlags) -> StructArray:
    out = np.zeros(1, FRAME_DTYPE)
    for name in ("counts", "pdc", "tac", "tdc"):
        out[name] = INVALID_COUNT
    for name in ("poc_mm", "force_n", "torque_nmm", "poc_sigma_mm", "force_sigma_n"):
        out[name] = np.nan
    out["pdc_filtered"] = out["pressure_force_n"] = out["torsion_nmm"] = np.nan
    out["finger"], out["t_us"], out["seq"], out["flags"] = finger, t_us, seq, int(flags)
    return out


def _value(name: str, convert: Callable[[Any], T], doc: str) -> T:
    """A property of FingerView; for the type checker, the type of its value."""
    return cast(T, property(lambda view: convert(view._row()[name]), doc=doc))


def _vector(name: str, doc: str) -> NDArray[np.float64]:
    return _value(name, lambda row: np.asarray(row, np.float64), doc)


def _counts(row: Any) -> NDArray[np.uint16]:
    return np.asarray(row, np.uint16)


class FingerView:
    """The latest values of one finger, ``hand["index"]``, read without waiting.

    Values are those of the latest frame, NaN or 65535 where invalid, as in FRAME_DTYPE. For an untouched finger that
    sends heartbeats they are those of the latest heartbeat: results are NaN, and ``flags`` has NOT_ASKED. Before
    anything has arrived, and while a lost board is looked for, everything is invalid and ``t_us`` is -1. Two
    properties may come from different frames; those of ``frame`` come from one. Raises DeviceLostError when the board
    is lost for good.
    """

    def __init__(self, name: str, finger: int, latest: Latest, keeps: object = None) -> None:
        self.name = name
        self.finger = finger
        self._latest = latest
        self._keeps = keeps  # the Hand, which would be closed with its last reference

    def __reduce__(self) -> NoReturn:
        raise TypeError(f"{self!r} belongs to this process and cannot be sent to another; open the board there")

    def __repr__(self) -> str:
        return f"<biotac finger {self.name!r}, chip select {self.finger}, {self.age_s:.3f} s old>"

    def _row(self) -> Any:
        return self._latest.row(self.finger)[0]

    @property
    def frame(self) -> Frame:
        """All values of one frame or heartbeat."""
        return Frame.from_row(self._row())

    force_n = _vector("force_n", "Force on the finger, (3,) in N.")
    torque_nmm = _vector("torque_nmm", "Torque on the finger, (3,) in N*mm.")
    poc_mm = _vector("poc_mm", "Point of contact, (3,) in mm.")
    force_sigma_n = _vector("force_sigma_n", "One standard deviation of the force, (3,) in N; NaN unless wanted.")
    poc_sigma_mm = _value("poc_sigma_mm", float, "One standard deviation of poc_mm, in mm; NaN unless wanted.")
    pressure_force_n = _value("pressure_force_n", float, "Force by static pressure, in N; NaN unless calibrated.")
    torsion_nmm = _value("torsion_nmm", float, "Torque about the contact's normal, in N*mm; NaN without a map of it.")
    counts = _value("counts", _counts, "Electrodes E1..E19, (19,) in counts 0..4095, 65535 where missing.")
    pdc = _value("pdc", int, "Static pressure in counts, 65535 where missing.")
    tac = _value("tac", int, "Thermal flux in counts, 65535 where missing.")
    tdc = _value("tdc", int, "Temperature in counts, 65535 where missing.")
    touched = _value("flags", lambda bits: bool(int(bits) & FrameFlags.CONTACT), "The finger is touched.")
    flags = _value("flags", lambda bits: FrameFlags(int(bits)), "What to think of the results.")
    t_us = _value("t_us", int, "Device time in us, unwrapped; -1 before anything came.")

    @property
    def age_s(self) -> float:
        """How long ago the round's last sample was taken, in s, by ``Hand.clock``; inf before anything arrived.

        While that clock knows nothing, as with a simulated board that is not in real time: how long ago it was read.
        """
        return self._latest.age_s(self.finger)
