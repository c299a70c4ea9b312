"""Rows that are missing from a board's stream, and why."""

from __future__ import annotations

import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from ..wire.batches import Batch
from ..wire.sensor_gen import MAX_SENSORS
from ..wire.slots import FRAME_HZ
from .lasting import Lasting

# More than this between two rows of a finger is told.
JUMP_US = 250_000
# In a longer batch, as of a board without real time, each finger's own latest row counts, not the batch's.
LONG_US = 50_000
NEXT_ROW_US = -1  # the time of anything before a board's first row: that row's

Reason = Literal["unplugged", "rebooted", "silence", "paused", "lost", "finger", "slow", "hold"]

WORDS: Mapping[Reason, str] = {
    "unplugged": "the port went away",
    "rebooted": "the board restarted",
    "silence": "the board fell silent",
    "paused": "this program stood still, so the board stopped streaming",
    "lost": "frames were lost on the link",
    "finger": "a sensor fell silent",
    "slow": "this reader was too slow",
    "hold": "a hold lapsed",
}
_FINGERS_IN = [tuple(f for f in range(MAX_SENSORS) if mask >> f & 1) for mask in range(1 << MAX_SENSORS)]


def fingers_in(mask: int) -> tuple[int, ...]:
    """The fingers in a bit mask that this library knows; -1, an unknown mask, has all. A newer board may have more."""
    return _FINGERS_IN[mask % len(_FINGERS_IN)]


@dataclass(frozen=True, slots=True)
class Gap:
    """Rows are missing here. It is in ``Batch.messages`` of the first batch with rows after the gap.

    ``reason`` is ``unplugged`` when the port went away, ``silence`` when it stayed but no rows came, and ``paused``
    when the board stopped because it did not hear this program: it was stopped, or the computer slept. It is
    ``rebooted``, whatever was seen first, when the board restarted: then the clock, sequence numbers and tares began
    anew. Rows of ``fingers``, a bit mask, were ``lost`` on the link for longer than 0.25 s, or the sensor gave none
    (``finger``). ``slow`` goes only to the slow reader, which lost batches to it. At a ``hold`` no row is missing:
    from ``next_t_us`` on, rows of fingers that were held say that they are not.

    ``last_t_us`` and ``next_t_us`` are the device times in us of the rows around the gap; after a reboot they are of
    different clocks, and ``last_t_us`` is None when no row had come before. ``lost_at_ns`` and ``back_at_ns`` are this
    computer's Unix time in ns. ``boot_id`` is the board's after the gap. ``frames_missed`` is how many rounds of all
    ``fingers`` are missing, None where that is unknown. ``holds_lapsed`` is the bit mask of the held fingers
    (``Hand.hold``) that are not held any more by their first row here: only the program itself can renew a hold. A
    finger that is silent here is reported with the next row.
    """

    reason: Reason
    last_t_us: int | None
    next_t_us: int | None
    lost_at_ns: int
    back_at_ns: int
    boot_id: int
    fingers: int = 0
    frames_missed: int | None = None
    holds_lapsed: int = 0

    def line(self) -> str:
        """One sentence for people."""
        if self.reason == "hold":
            return WORDS[self.reason]
        missed = "" if self.frames_missed is None else f", {self.frames_missed} frames missed"
        lapsed = "; a hold lapsed" if self.holds_lapsed else ""
        return f"gap of {self.seconds:.1f} s{missed}: {WORDS[self.reason]}{lapsed}"

    @property
    def seconds(self) -> float:
        """The gap's length by the device's clock; by this computer's where that restarted."""
        if self.reason == "rebooted" or self.last_t_us is None or self.next_t_us is None:
            return (self.back_at_ns - self.lost_at_ns) / 1e9
        return (self.next_t_us - self.last_t_us) / 1e6


class Gaps:
    """Puts a Gap into the first batch after rows are missing. Any thread may report that the stream stopped."""

    def __init__(self, lasting: Lasting, lock: threading.Condition) -> None:
        self.count = 0  #: without those of holds, at which no row is missing
        self._lasting = lasting
        self._lock = lock
        self._latest: dict[int, tuple[int, Batch]] = {}  # by finger: time of the latest row, to LONG_US, and batch
        self._last_s = time.monotonic()  # when the latest row arrived
        self._begun: tuple[Reason, int | None, int] | None = None

    def begin(self, reason: Reason) -> None:
        """The stream has stopped. Two losses without a row in between are one gap."""
        if reason == "rebooted":
            self._lasting.restart()
        with self._lock:
            if self._begun is None:
                lost_at_ns = time.time_ns() - round((time.monotonic() - self._last_s) * 1e9)
                self._begun = reason, max((seen_us for seen_us, _ in self._latest.values()), default=None), lost_at_ns
            elif reason == "rebooted":
                self._begun = (reason, *self._begun[1:])

    def forget(self) -> None:
        """The stream was stopped on purpose, and all of it has come: no gap follows."""
        with self._lock:
            self._latest = {}

    def through(self, batch: Batch, last_us: int, boot_id: int, lost_after: list[tuple[int, int, int]]) -> None:
        """Put a Gap into ``batch``, up to ``last_us``, for each that ends here.

        ``lost_after`` has (finger, seq, frames missing).
        """
        with self._lock:
            gaps = self._gaps(batch, last_us, lost_after)
        self.count += len(gaps)
        if lapsed := self._lasting.lapsed(batch, last_us):
            gaps = _with_lapsed(gaps, lapsed)
        batch.messages[:0] = [replace(gap, back_at_ns=time.time_ns(), boot_id=boot_id) for gap in gaps]

    def _gaps(self, batch: Batch, last_us: int, lost_after: list[tuple[int, int, int]]) -> list[Gap]:
        latest, fingers = self._latest, fingers_in(batch.fingers)
        gaps: list[Gap] = []
        first_us = batch.first_t_us()
        if self._begun is not None:
            gaps = [self._loss(*self._begun, last_us if first_us is None else first_us)]
            self._begun = None
        is_long = first_us is not None and last_us - first_us > LONG_US
        jumps = not gaps and any(last_us - latest[finger][0] > JUMP_US for finger in fingers if finger in latest)
        rows = _rows(batch) if is_long or jumps else {}
        if not gaps and rows:
            gaps = self._jumps(rows, {(finger, seq + n + 1) for finger, seq, n in lost_after[-64:]})
        latest |= dict.fromkeys(fingers, (last_us, batch))
        if is_long:
            latest |= {finger: (int(own[-1, 0]), batch) for finger, own in rows.items()}
        self._last_s = batch.taken_s if batch.taken_s == batch.taken_s else batch.arrived_s
        return gaps

    def _loss(self, reason: Reason, last_us: int | None, lost_at_ns: int, next_us: int) -> Gap:
        missed = sum(_rounds_between(seen, next_us) for seen, _ in self._latest.values())
        fingers = sum(1 << finger for finger in self._latest)
        self._latest.clear()
        known = None if reason == "rebooted" else missed
        return Gap(reason, last_us, next_us, lost_at_ns, 0, 0, fingers, known)

    def _jumps(self, rows: dict[int, NDArray[np.int64]], losses: set[tuple[int, int]]) -> list[Gap]:
        """Gaps of single fingers, while the stream went on; none where heartbeats cover the time."""
        gaps: list[Gap] = []
        for finger in rows:
            own = rows[finger]
            latest_us, batch = self._latest.get(finger, (int(own[0, 0]), None))
            if batch is not None and finger in (before := _rows(batch)):
                latest_us = int(before[finger][-1, 0])
            since_us = np.append(latest_us, own[:-1, 0])
            for k in np.flatnonzero(own[:, 0] - since_us - own[:, 1] > JUMP_US).tolist():
                last_us, (t_us, _, seq) = int(since_us[k]), own[k].tolist()
                reason: Reason = "lost" if (finger, seq) in losses else "finger"
                lost_at_ns = time.time_ns() - 1000 * (t_us - last_us)
                at = next((k for k, gap in enumerate(gaps) if _is_same(gap, last_us, t_us)), len(gaps))
                gap = [*gaps, Gap(reason, last_us, t_us, lost_at_ns, 0, 0, frames_missed=0)][at]
                missed = (gap.frames_missed or 0) + _rounds_between(last_us, t_us)
                gaps[at : at + 1] = [replace(gap, fingers=gap.fingers | 1 << finger, frames_missed=missed)]
        return sorted(gaps, key=lambda gap: gap.next_t_us or 0)


def _with_lapsed(gaps: list[Gap], lapsed: dict[int, int]) -> list[Gap]:
    """These, each with the fingers that lost a hold, and one for the others, at the time of that row."""
    marked: list[Gap] = []
    for gap in gaps:
        fingers = [finger for finger in lapsed if gap.fingers >> finger & 1]
        marked.append(replace(gap, holds_lapsed=sum(1 << finger for finger in fingers)))
        lapsed = {finger: at_us for finger, at_us in lapsed.items() if finger not in fingers}
    if lapsed:
        mask, at_us = sum(1 << finger for finger in lapsed), min(lapsed.values())
        marked.append(Gap("hold", at_us, at_us, time.time_ns(), 0, 0, mask, 0, mask))
    return marked


def _is_same(gap: Gap, last_us: int, next_us: int) -> bool:
    """Whether another finger's gap has the same time, to within a batch's resolution."""
    return max(abs((gap.last_t_us or 0) - last_us), abs((gap.next_t_us or 0) - next_us)) < JUMP_US


def _rows(batch: Batch) -> dict[int, NDArray[np.int64]]:
    """Each finger's rows (n, 3) in order: device time, the time in us that it covers (a heartbeat), seq."""
    beats = batch.idle
    covered = np.round(beats["frames"] * (1e6 / FRAME_HZ))
    frames = (batch.t_us, np.zeros(len(batch.t_us)), batch.seq, batch.wire["finger"])
    both = zip(frames, (beats["t_us"], covered, beats["seq"], beats["finger"]), strict=True)
    columns = [np.concatenate(pair).astype(np.int64) for pair in both]
    rows, fingers = np.column_stack(columns[:3]), columns[3]
    order = np.lexsort((columns[2], columns[0]))
    return {finger: rows[order[fingers[order] == finger]] for finger in np.unique(fingers).tolist()}


def _rounds_between(last_us: int, next_us: int) -> int:
    """How many rounds lie between two rows of one finger."""
    return max(0, round((next_us - last_us) * 1e-6 * FRAME_HZ) - 1)
