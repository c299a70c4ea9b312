"""Round by round: the frames of all fingers and the events meanwhile, in one object."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from ..board.gap import Gap, fingers_in
from ..board.reader import Consumer, Reader
from ..wire.batches import ROUND_US, Batch
from ..wire.frames import Frame
from ..wire.messages_gen import Event
from .views import Latest, checked_timeout_s

MOST_EVENTS = 1024


@dataclass(frozen=True)
class FingerRound:
    """One finger in one round: ``frame``, None when the board sent none, and ``events``."""

    frame: Frame | None
    events: tuple[Event, ...]


@dataclass(frozen=True)
class Round:
    """One 10 ms round of a board: ``now["index"].frame``, ``now.events``.

    ``seq`` and ``t_us`` are the frames', -1 when there is none. ``missed`` counts the rounds that were skipped
    since the one before; their events are the ones older than this round. ``events_lost`` counts the events that are
    missing, because a program that stands still gets only the newest 1024.
    """

    seq: int
    t_us: int
    missed: int
    fingers: Mapping[str, FingerRound]
    events: tuple[Event, ...]
    events_lost: int = 0

    def __getitem__(self, finger: str) -> FingerRound:
        """A finger by name; one that sent nothing has no frame. Raises KeyError for an unknown name."""
        return self.fingers[finger]

    def __iter__(self) -> Iterator[str]:
        return iter(self.fingers)


class Rounds(Consumer):
    """Puts rows and events of a round together, for one program."""

    def __init__(self, reader: Reader, latest: Latest) -> None:
        self._reader = reader
        self._latest = latest
        self._rows: dict[int, dict[int, tuple[Batch, int]]] = {}  # by t_us, by finger
        self._events: list[tuple[int, Event]] = []
        self._events_lost = 0  # since a round was given
        self._expected = set(fingers_in(reader.present))  # fingers that have rows: with these a round is complete
        self._news = threading.Condition()
        self._given_us = -1  # the latest round that was given
        self._after_us = -1  # the awaited round is later
        self._is_new = True
        reader.add(self)

    # ---- the reading thread --------------------------------------------------------------------

    def put(self, batch: Batch) -> None:
        with self._news:
            if any(type(m) is Gap and m.reason == "rebooted" for m in batch.messages):  # the clock began anew
                self._rows, self._given_us, self._after_us = {}, -1, -1
                self._expected = set(fingers_in(self._reader.present))
                self._events = [(-1, event) for _, event in self._events]  # come with the next round at any time
            for row, (t_us, finger) in enumerate(zip(batch.t_us.tolist(), batch.wire["finger"].tolist(), strict=True)):
                if t_us > self._given_us:
                    self._rows.setdefault(t_us, {})[finger] = batch, row
                else:  # it came after the round was given without it: the next one awaits it
                    self._expected.add(finger)
            for old in sorted(self._rows)[:-2]:  # a program that is behind gets the newest
                del self._rows[old]
            events = [(self._reader.unwrap_t_us(m.t_us), m) for m in batch.messages if type(m) is Event]
            self._events_lost += max(0, len(self._events) + len(events) - MOST_EVENTS)
            self._events = [*self._events, *events][-MOST_EVENTS:]
            self._news.notify_all()

    def wake(self) -> None:
        with self._news:
            self._news.notify_all()

    # ---- the program ---------------------------------------------------------------------------

    def wait(self, after: Round | None, timeout_s: float) -> Round:
        """The newest complete round after ``after``, or after this call. Raises TimeoutError when none comes."""
        reader = self._reader

        def is_complete() -> bool:
            if reader.connection.closed:
                return True
            t_us = self._complete_us()  # rounds from while this program stood still are too old to act on
            return t_us > self._after_us and not self._latest.is_too_old(t_us, self._arrived_s(t_us))

        with self._news:
            # All that the first call finds has come since it was made. Rounds from before a restart are later by the
            # old clock than anything since.
            before_us = -1 if self._is_new else max(self._rows, default=-1)
            self._after_us = before_us if after is None else min(after.t_us, self._given_us)
            self._is_new = False
            came = self._news.wait_for(is_complete, checked_timeout_s(timeout_s))
        if reader.connection.closed:
            reader.connection.raise_closed()
        self._latest.report()
        if not came:
            raise TimeoutError(f"no new round in {timeout_s:g} s: is a finger there, and streamed with rest=True?")
        with self._news:  # else it may have been passed over meanwhile
            return self.pop(self._complete_us())

    def _complete_us(self) -> int:
        """The time of the newest round that has all expected fingers, or that a later one has followed; -1: none."""
        times = sorted(self._rows)
        if times and set(self._rows[times[-1]]) >= self._expected:
            return times[-1]
        return times[-2] if len(times) > 1 else -1

    def _arrived_s(self, t_us: int) -> float:
        return next(batch.arrived_s for batch, _ in self._rows[t_us].values())

    def pop(self, t_us: int | None = None) -> Round:
        """The round at ``t_us``, by default the newest that has come, and the events until then."""
        with self._news:
            newest = max(self._rows, default=None) if t_us is None else t_us
            rows = {} if newest is None or newest <= self._given_us else self._rows[newest]
            end_us = None if t_us is None else t_us + ROUND_US
            due = [event for at_us, event in self._events if end_us is None or at_us < end_us]
            self._events = self._events[len(due) :]
            lost, self._events_lost = self._events_lost, 0
            before_us = self._given_us
            if rows and newest is not None:
                self._expected, self._given_us = set(rows), newest
                self._rows = {at: row for at, row in self._rows.items() if at > newest}
        frames = {finger: Frame.from_row(batch.frames[row]) for finger, (batch, row) in rows.items()}
        fingers = {}
        for finger in sorted({*frames, *(event.finger for event in due), *fingers_in(self._reader.present)}):
            own = tuple(event for event in due if event.finger == finger)
            fingers[self._latest.name(finger)] = FingerRound(frames.get(finger), own)
        seq = next((frame.seq for frame in frames.values()), -1)
        if not frames or newest is None:
            return Round(-1, -1, 0, fingers, tuple(due), lost)
        missed = round((newest - before_us) / ROUND_US) - 1 if before_us >= 0 else 0
        return Round(seq, newest, missed, fingers, tuple(due), lost)
