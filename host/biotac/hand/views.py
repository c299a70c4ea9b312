"""Fingers by name, and the latest values of each."""

from __future__ import annotations

import math
import threading
import time
from collections.abc import Callable, Iterable, Mapping
from operator import index
from typing import Any, NoReturn, SupportsIndex, TypeAlias, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from ..board.consumers import DeferredErrors
from ..board.gap import fingers_in
from ..board.reader import Consumer, Reader
from ..errors import InputError
from ..wire.batches import Batch
from ..wire.frames import Frame, StructArray, age_ms, frames_from_wire, invalid_frames, trust_of
from ..wire.messages_gen import INVALID_COUNT, FrameFlags, TareSet, Trust
from ..wire.sensor_gen import MAX_SENSORS

T = TypeVar("T")
#: Several fingers: a bit mask of chip selects, a name, or names and chip selects.
Fingers: TypeAlias = int | str | Iterable[str | int]

#: Chip selects by name, unless ``biotac.open(..., fingers=...)`` says otherwise.
DEFAULT_NAMES = {"index": 0, "middle": 1, "ring": 2, "little": 3, "thumb": 4}

_MISSING = FrameFlags.ELECTRODE_MISSING | FrameFlags.PDC_MISSING | FrameFlags.TAC_MISSING | FrameFlags.TDC_MISSING
NOTHING_YET = FrameFlags.UNTARED | FrameFlags.POC_INVALID | FrameFlags.FAULT | _MISSING


def checked_names(names: Mapping[str, int] | None) -> dict[str, int]:
    """A copy of ``names``, None for the default. Raises InputError unless each name has a chip select to itself."""
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


def checked_timeout_s(timeout_s: float) -> float:
    """``timeout_s``, at most the longest that a thread can wait. Raises InputError unless it is a time."""
    if not timeout_s >= 0:
        raise InputError(f"timeout_s is {timeout_s}, expected seconds, 0 or more")
    return min(timeout_s, threading.TIMEOUT_MAX)


class Latest(Consumer):
    """The newest frame or heartbeat of each finger, and how old it is.

    The reading thread only stores the batch: a search costs as much as decoding, and most batches are never looked at.
    Values older than ``max_age_s`` are not shown.
    """

    def __init__(self, reader: Reader, names: Mapping[str, int], *, max_age_s: float, troubles: DeferredErrors) -> None:
        self.names = names
        self.max_age_s = max_age_s
        self._troubles = troubles
        self._reader = reader
        self._batches: dict[int, Batch] = {}  # by finger: the latest with a row of it
        self._trusted: dict[int, Batch] = {}  # likewise, of those with a FRAME whose force may be acted on
        self._news = threading.Condition()
        self._waiters = 0

    def report(self) -> None:
        """Raise errors that the program has not seen yet; threads of callbacks and recorders are not the program."""
        self._reader.connection.check()
        if not self._reader.connection.is_own():
            self._troubles.report()

    def name(self, finger: int) -> str:
        """The name of a chip select, or the number as text if it has no name."""
        return next((name for name, number in self.names.items() if number == finger), str(finger))

    def present(self, key: str | SupportsIndex) -> int:
        """Chip select of a finger that answers, or did. Raises KeyError for any other, naming those."""
        finger = finger_index(self.names, key)
        if not self._reader.present >> finger & 1:
            present = [repr(self.name(f)) for f in fingers_in(self._reader.present)]
            raise KeyError(f"no sensor answers as {key!r}; those that do: {', '.join(present) or 'none'}")
        return finger

    def mask(self, fingers: Fingers) -> int:
        """Bit mask of several fingers. Raises KeyError for one that is not there."""
        if isinstance(fingers, str):
            return 1 << self.present(fingers)
        if isinstance(fingers, Iterable):
            return sum({1 << self.present(finger) for finger in fingers})
        return index(fingers)

    def put(self, batch: Batch) -> None:
        for finger in fingers_in(batch.fingers):
            self._batches[finger] = batch
        for finger in set(batch.wire["finger"][batch.wire["trust"] >= Trust.INTERVAL].tolist()):
            self._trusted[finger] = batch
        if self._waiters:
            self.wake()

    def tares(self) -> list[TareSet]:
        """The commands that give a board that restarted the latest tares with trust, and their age."""
        commands = []
        for finger, batch in self._trusted.items():
            rows = batch.wire[(batch.wire["finger"] == finger) & (batch.wire["trust"] >= Trust.INTERVAL)]
            if (rows["tare_q4"][-1] != INVALID_COUNT).all():
                tare_q4, pdc_q4 = tuple(rows["tare_q4"][-1].tolist()), int(rows["pdc_tare_q4"][-1])
                commands.append(TareSet(0, finger, tare_q4, pdc_q4, age_ms(time.monotonic() - batch.arrived_s)))
        return commands

    def wake(self) -> None:
        with self._news:
            self._news.notify_all()

    def state(self, finger: int) -> tuple[StructArray, float, str]:
        """The latest row, FRAME_DTYPE (1,), the row's age in s, and why it may not be used; empty when it may.

        Without a row, and where it may not be used, all values are invalid and ``t_us`` is -1.
        """
        self.report()
        batch = self._batches.get(finger)
        row = _empty(finger, -1, 0, NOTHING_YET) if batch is None else _latest_row(batch, finger)
        age_s = math.inf if batch is None else self._age_s(int(row["t_us"][0]), batch.arrived_s)
        why = self._why_stale(age_s)
        return (_empty(finger, -1, 0, NOTHING_YET) if why else row), age_s, why

    def _age_s(self, t_us: int, arrived_s: float) -> float:
        reader = self._reader
        if reader.link.pace == 0:  # device time stands still while nobody reads
            return ((reader.last_t_us or t_us) - t_us) * 1e-6
        return time.monotonic() - reader.taken_s(t_us, arrived_s)

    def is_too_old(self, t_us: int, arrived_s: float) -> bool:
        """Whether a row is older than ``max_age_s``; false while the board's clock is not known yet."""
        return self._age_s(t_us, arrived_s) > self.max_age_s

    def _why_stale(self, age_s: float) -> str:
        if self._reader.connection.closed:
            return "the hand is closed"
        if self._reader.connection.lost is not None:
            return "the board is away and being looked for"
        if math.isinf(age_s):
            return "nothing has arrived yet; wait for next_frame(), or call hand.stream() first"
        if age_s <= self.max_age_s:
            return ""
        if math.isnan(age_s):
            return "the board's clock is not known yet"
        return f"{age_s:.2f} s old, at most {self.max_age_s:g} s is allowed"

    def wait(self, finger: int, timeout_s: float) -> None:
        """Wait for a row that comes after this call and is not stale. Raises TimeoutError."""
        before, reader, why = self._batches.get(finger), self._reader, ""

        def has_come() -> bool:
            nonlocal why
            if reader.connection.closed:
                return True
            why = self.state(finger)[2]
            return not why and self._batches.get(finger) is not before

        with self._news:
            self._waiters += 1
            try:
                came = self._news.wait_for(has_come, checked_timeout_s(timeout_s))
            finally:
                self._waiters -= 1
        if reader.connection.closed:
            reader.connection.raise_closed()
        self.report()
        if not came:
            raise TimeoutError(f"no new frame of finger {self.name(finger)!r} in {timeout_s:g} s: {why or 'none came'}")


def _latest_row(batch: Batch, finger: int) -> StructArray:
    rows = np.flatnonzero(batch.wire["finger"] == finger)[-1:]
    beats = np.flatnonzero(batch.idle["finger"] == finger)[-1:]
    # A batch can hold a frame and a heartbeat of one finger: the later in device time counts.
    if len(rows) and not (len(beats) and batch.idle["t_us"][beats[0]] > batch.t_us[rows[0]]):
        return frames_from_wire(batch.wire[rows], batch.seq[rows], batch.t_us[rows])
    beat = batch.idle[beats[0]]
    flags = FrameFlags(int(beat["flags"])) | FrameFlags.POC_INVALID | FrameFlags.NOT_ASKED
    out = _empty(finger, int(beat["t_us"]), int(beat["seq"]), flags)
    out["pdc"], out["tdc"], out["trust"] = beat["pdc"], beat["tdc"], beat["trust"]
    return out


def _empty(finger: int, t_us: int, seq: int, flags: FrameFlags) -> StructArray:
    out = invalid_frames(1)
    out["finger"], out["t_us"], out["seq"], out["flags"] = finger, t_us, seq, int(flags)
    return out


def _value(name: str, convert: Callable[[Any], T], doc: str) -> T:
    """A property of FingerView; for the type checker, the value's type."""
    return cast(T, property(lambda finger: convert(finger._row()[name]), doc=doc))


def _vector(name: str, doc: str) -> NDArray[np.float64]:
    return _value(name, lambda row: np.asarray(row, np.float64), doc)


def _counts(row: Any) -> NDArray[np.uint16]:
    return np.asarray(row, np.uint16)


class FingerView:
    """The latest values of one finger, ``hand["index"]``, read without waiting.

    Values are those of the latest frame, NaN or 65535 where invalid, as in FRAME_DTYPE. For an untouched finger that
    sends heartbeats they are those of the latest heartbeat: results are NaN, and ``flags`` has NOT_ASKED. Values older
    than ``max_age_s`` (biotac.open) are never shown: then, before anything has arrived, and while a lost board is
    looked for, everything is invalid, ``t_us`` is -1, and ``stale`` says why. Two properties may come from different
    frames; those of ``frame`` come from one. Every property raises DeviceLostError when the board is lost for good, and
    CallbackError or OSError when a callback or a recording has failed since the last call.
    """

    def __init__(self, name: str, finger: int, latest: Latest, start: Callable[[], None]) -> None:
        self.name = name
        self.finger = finger
        self._latest = latest
        self._start = start  # starts the stream; holds the hand, which would be closed with its last reference

    def __reduce__(self) -> NoReturn:
        raise TypeError(f"{self!r} belongs to this process and cannot be sent to another; open the board there")

    def __repr__(self) -> str:
        return f"<biotac finger {self.name!r}, chip select {self.finger}: {', '.join(self.line())}>"

    def line(self) -> list[str]:
        """Force, trust, flags and age in words, or why there is none."""
        row, age_s, why = self._latest.state(self.finger)
        force = ", ".join(f"{value:.3f}" for value in row["force_n"][0])
        flags, trust = FrameFlags(int(row["flags"][0])), trust_of(row["trust"][0])
        return [why] if why else [f"force ({force}) N", trust.name, repr(flags), f"{age_s * 1e3:.0f} ms old"]

    def _row(self) -> Any:
        return self._latest.state(self.finger)[0][0]

    def next_frame(self, timeout_s: float = 1.0) -> Frame:
        """Wait for the next frame or heartbeat of this finger, starting the stream if need be.

        Raises TimeoutError when none comes in time, DeviceLostError when the board is lost.
        """
        self._start()
        self._latest.wait(self.finger, timeout_s)
        return self.frame

    @property
    def stale(self) -> str:
        """Why the values may not be used, and are NaN; empty when they may be."""
        return self._latest.state(self.finger)[2]

    @property
    def frame(self) -> Frame:
        """All values of one frame or heartbeat."""
        return Frame.from_row(self._row())

    force_n = _vector("force_n", "Force on the finger, (3,) in N.")
    torque_nmm = _vector("torque_nmm", "Torque on the finger, (3,) in N*mm.")
    poc_mm = _vector("poc_mm", "Point of contact, (3,) in mm.")
    normal_n = _value("normal_n", float, "How hard the contact presses into the skin, in N.")
    normal_half_n = _value("normal_half_n", float, "Half the width of the 95 % interval about normal_n, in N.")
    shear_n = _value("shear_n", float, "The rest of the force, along the skin, in N.")
    shear_half_n = _value("shear_half_n", float, "Half the width of the 95 % interval about shear_n, in N.")
    pressure_force_n = _value("pressure_force_n", float, "Force by static pressure, in N; NaN unless calibrated.")
    torsion_nmm = _value("torsion_nmm", float, "Torque about the contact's normal, in N*mm; NaN without a map of it.")
    counts = _value("counts", _counts, "Electrodes E1..E19, (19,) in counts 0..4095, 65535 where missing.")
    pdc = _value("pdc", int, "Static pressure in counts, 65535 where missing.")
    tac = _value("tac", int, "Thermal flux in counts, 65535 where missing.")
    tdc = _value("tdc", int, "Temperature in counts, 65535 where missing.")
    touched = _value("flags", lambda bits: bool(int(bits) & FrameFlags.CONTACT), "The finger is touched.")
    flags = _value("flags", lambda bits: FrameFlags(int(bits)), "What to think of the results.")
    trust = _value("trust", trust_of, "What the force is good for, an enum Trust; NONE where the values are stale.")
    t_us = _value("t_us", int, "Device time in us, unwrapped; -1 before anything came.")

    @property
    def age_s(self) -> float:
        """How long ago the round's last sample was taken, in s, by ``Hand.clock``.

        Infinite before anything arrived, NaN while that clock knows nothing. A simulated board that is not in real
        time has no such clock: then how long ago it was read, or, unpaced, how far device time has gone on since.
        """
        return self._latest.state(self.finger)[1]
