"""The state that the page shows, shared by the one reading thread and the many serving threads.

The reader never waits for a browser: rows go into ring buffers, and a browser that is too slow misses the oldest rows
and is told how many. News have this computer's time of sending: behind a slow line they are old.
"""

from __future__ import annotations

import threading
import time
from collections import deque
from dataclasses import asdict, dataclass, field
from itertools import islice
from typing import Any

from ..board.gap import Gap, fingers_in
from ..wire import messages_gen as wire
from ..wire.batches import Batch, LinkStats
from ..wire.counters import nearest
from ..wire.events import kind_name
from .player import Player
from .rows import compact, frame_rows, pac_rows

KEPT_ROWS = 300  # of each kind: 0.6 s of five fingers, longer than any picture takes
HEALTH_S = 0.25
RATE_S = 2.0
MARKS = 60  # more than can be shown in ten seconds of plots


class Ring:
    """The latest texts, each with a running number."""

    def __init__(self, kept: int) -> None:
        self._texts: deque[str] = deque(maxlen=kept)
        self.end = 0

    def extend(self, texts: list[str]) -> None:
        self._texts.extend(texts)
        self.end += len(texts)

    def clear(self) -> None:
        """Forget the texts; the numbers go on."""
        self._texts.clear()

    @property
    def begin(self) -> int:
        """Number of the oldest text still kept."""
        return self.end - len(self._texts)

    def since(self, begin: int) -> tuple[list[str], int]:
        """The texts from number ``begin`` on that are still kept, and how many of them are gone."""
        held = min(self.end - begin, len(self._texts))
        return list(islice(self._texts, len(self._texts) - held, None)), self.end - begin - held


@dataclass
class Cursor:
    """How far one browser has read."""

    frames: int
    pac: int
    health: int = -1
    dropped: int = 0  # frames it was too slow for


@dataclass
class Health:
    """Everything but the rows. ``link``: opening, live, playing, paused, over or lost; ``words`` explains it."""

    link: str = "opening"
    words: str = ""
    source: str = ""
    board: str = ""
    live: bool = True
    epoch: int = 0  # counts openings of the source; sequence numbers and times start over with each
    frames_per_s: float = 0.0
    stats: dict[str, int] = field(default_factory=dict)
    status: dict[str, int] = field(default_factory=dict)
    fingers: dict[int, dict[str, Any]] = field(default_factory=dict)
    recording: dict[str, Any] | None = None
    position_s: float | None = None  # in a recording, since the first row
    pace: float = 1.0
    events: deque[dict[str, Any]] = field(default_factory=lambda: deque(maxlen=MARKS))  # marks, oldest first


class PageState:
    """Written by the reader, read by any thread."""

    def __init__(self, source: str) -> None:
        self._news = threading.Condition()
        self._frames = Ring(KEPT_ROWS)
        self._pac = Ring(KEPT_ROWS)
        self._health = Health(source=source, words=f"opening {source}")
        self._health_text = ""
        self._health_number = 0
        self._health_due_s = 0.0
        self._arrived: deque[tuple[float, int]] = deque()
        self.closed = False  # nothing more will come
        self.recording: dict[str, Any] | None = None  # overview.py's, of a recording
        with self._news:
            self._publish()

    # ---- the reader's side ---------------------------------------------------------------------

    def report(self, link: str, words: str) -> None:
        """Change the link's state and publish it at once."""
        with self._news:
            self._health.link, self._health.words = link, words
            if link in ("lost", "opening", "paused"):
                self._health.frames_per_s = 0.0
                self._health.recording = None
                self._arrived.clear()
            self._publish()

    def begin(self, player: Player) -> None:
        """Start a new epoch, and forget rows, status and tares of the previous one."""
        with self._news:
            source, epoch = self._health.source, self._health.epoch + 1
            self._health = Health(source=source, board=player.board, live=player.live, epoch=epoch)
            self._frames.clear()
            self._pac.clear()
            self._arrived.clear()

    def add(self, batch: Batch, player: Player) -> None:
        frames, pac = frame_rows(batch, player.applied_n(batch.wire["finger"], batch.t_us)), pac_rows(batch)
        now_s = time.monotonic()
        with self._news:
            self._frames.extend(frames)
            self._pac.extend(pac)
            self._arrived.append((now_s, len(batch.frames)))
            for message in batch.messages:
                self._add_message(message, batch.last_t_us() or 0)
            for finger, t_us in zip(batch.frames["finger"].tolist(), batch.frames["t_us"].tolist(), strict=True):
                self._finger(finger)["t_us"] = t_us
            if now_s >= self._health_due_s:
                self._measure(player.stats(), now_s)
                self._health.recording = player.recording()
                self._health.position_s, self._health.pace = player.position()
                self._publish()
            elif frames or pac:
                self._news.notify_all()

    def _finger(self, finger: int) -> dict[str, Any]:
        return self._health.fingers.setdefault(finger, {"present": 1})

    def _add_message(self, message: Any, now_us: int) -> None:
        if isinstance(message, wire.Status):
            self._health.status = asdict(message)
        elif isinstance(message, wire.SensorStatus):
            self._finger(message.finger).update(asdict(message), status_t_us=message.t_us, t_us=message.t_us)
        elif isinstance(message, wire.Event):
            t_us, name = nearest(message.t_us, now_us), kind_name(message).lower()
            self._health.events.append({"finger": message.finger, "t_us": t_us, "name": name})
            self._health_due_s = 0.0  # publish at once
        elif isinstance(message, Gap):
            for finger in fingers_in(message.fingers):
                self._health.events.append({"finger": finger, "t_us": message.next_t_us or now_us, "name": "gap"})
        elif isinstance(message, wire.Tare):
            self._finger(message.finger).update(
                tare_state=message.tare_state, tare_reason=message.reason, tare_age_ms=0, status_t_us=message.t_us
            )

    def _measure(self, stats: LinkStats, now_s: float) -> None:
        while len(self._arrived) > 1 and now_s - self._arrived[0][0] > RATE_S:
            self._arrived.popleft()
        span_s = now_s - self._arrived[0][0]
        # The first batch only marks the start of counting.
        rate = sum(count for _, count in islice(self._arrived, 1, None)) / span_s if span_s > 0 else 0.0
        self._health.frames_per_s = round(rate, 1)
        self._health.stats = asdict(stats)

    def _publish(self) -> None:
        health = asdict(self._health)
        health["events"] = list(self._health.events)
        health["fingers"] = [tared(finger, facts) for finger, facts in sorted(self._health.fingers.items())]
        self._health_text = compact(health)
        self._health_number += 1
        self._health_due_s = time.monotonic() + HEALTH_S
        self._news.notify_all()

    def close(self) -> None:
        """Release all waiting threads."""
        with self._news:
            self.closed = True
            self._news.notify_all()

    # ---- the browsers' side --------------------------------------------------------------------

    def cursor(self) -> Cursor:
        """Cursor of a new browser: at the rows still kept, so that it shows something even if nothing new comes."""
        with self._news:
            return Cursor(self._frames.begin, self._pac.begin)

    def wait(self, cursor: Cursor, timeout_s: float) -> str:
        """Wait for news; return them as one JSON text and advance ``cursor``. Empty after timeout_s without any."""
        with self._news:
            self._news.wait_for(lambda: self.closed or self._is_news(cursor), timeout_s)
            if not self._is_news(cursor):
                return ""
            frames, lost = self._frames.since(cursor.frames)
            pac, _ = self._pac.since(cursor.pac)
            health = self._health_text if cursor.health != self._health_number else "null"
            cursor.frames, cursor.pac, cursor.health = self._frames.end, self._pac.end, self._health_number
        cursor.dropped += lost
        parts = f'"frames":[{",".join(frames)}],"pac":[{",".join(pac)}]'
        sent_ms = round(time.monotonic() * 1000)
        return f'{{{parts},"health":{health},"dropped":{cursor.dropped},"sent_ms":{sent_ms}}}'

    def _is_news(self, cursor: Cursor) -> bool:
        return (cursor.frames, cursor.pac, cursor.health) != (self._frames.end, self._pac.end, self._health_number)


def tared(finger: int, facts: dict[str, Any]) -> dict[str, Any]:
    """A finger's facts, with the tare's age as of the latest frame; the board sends the age only once a second."""
    out = {"finger": finger} | {k: v for k, v in facts.items() if k not in ("t_us", "status_t_us", "req_id")}
    if "tare_age_ms" in facts:
        later_ms = (facts["t_us"] - facts["status_t_us"]) % 2**32 // 1000
        # The difference wraps if the frame is older than the status; no real age is that long.
        out["tare_age_ms"] = facts["tare_age_ms"] + (later_ms if later_ms < 2**31 // 1000 else 0)
    return out
