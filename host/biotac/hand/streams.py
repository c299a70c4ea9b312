"""A board's streams, and who reads them.

Two ways to read. Pull: whoever wants batches reads the link, one thread, the same every time; a slow caller makes the
operating system's buffer fill and then the board drop whole frames. Live: after ``run``, or with callbacks or
biotac.aio, threads of this package read always (live/reader.py), and a slow caller loses the oldest batches on this
side.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from threading import get_ident
from typing import Any, TypeVar

from ..clock.wall import RealTiming, Timing
from ..errors import DeviceLostError
from ..link import Link
from ..wire import messages_gen as wire
from ..wire.batches import Batch, LinkStats
from ..wire.sensor_gen import MAX_SENSORS
from .callbacks import MESSAGES, Callbacks, Unsubscribe
from .commands import ALL_FINGERS
from .gap import Gap
from .queue import LIMIT_ROWS, BatchQueue
from .reader import Reader
from .reconnect import ComingBack
from .subscription import Wants
from .views import Latest, checked_names

#: What a FRAME can say of a contact, for Hand.subscribe.
RESULTS = wire.QuantityFlags.POC | wire.QuantityFlags.FORCE | wire.QuantityFlags.TORQUE | wire.QuantityFlags.PRESSURE
AT_FIRST = RESULTS | wire.QuantityFlags.REST_FRAMES
# A streaming board sends a status every second by default; three missing ones are a dead link.
SILENCE_S = 3.0
# A board whose live host has died stops streaming after this long.
KEEPALIVE_S = 1.0
PINGS_PER_KEEPALIVE = 3

Self = TypeVar("Self", bound="Streaming")


class Streaming(ComingBack):
    """What a Hand sends and reads."""

    def __init__(
        self,
        link: Link,
        *,
        reconnect: bool = False,
        fingers: Mapping[str, int] | None = None,
        timing: Timing | None = None,
    ) -> None:
        self._names = checked_names(fingers)
        timing = timing or RealTiming()
        self._batches = BatchQueue()  # for whoever pulls
        self._pulled = True  # new batches are kept for them; without threads always
        self._has_pulled = False
        self._queues: list[BatchQueue] = []  # for others, such as biotac.aio
        self._callbacks = Callbacks()
        self._for_callbacks = BatchQueue()
        self._latest = Latest(timing)
        self._wants: Wants | None = None
        self._quantities = dict.fromkeys(range(MAX_SENSORS), AT_FIRST)
        self._next: Batch | None = None  # for callbacks, before all that waits in _for_callbacks
        self._monotonic_s = timing.monotonic_s
        self._heard_s = self._ping_due_s = timing.monotonic_s()
        self._due_s = -math.inf  # until when keep_up has nothing to do while it streams
        self._ended = False
        super().__init__(link, reconnect=reconnect, timing=timing)

    # ---- what is on ---------------------------------------------------------------------------
    @property
    def stats(self) -> LinkStats:
        """Counts since the handshake, over reboots too."""
        queues = (self._batches, self._for_callbacks, *self._queues)
        return replace(
            super().stats,
            batches_skipped=sum(queue.batches_skipped for queue in queues),
            frames_skipped=sum(queue.frames_skipped for queue in queues),
        )

    @property
    def streaming(self) -> bool:
        """The board was told to stream, and has not ended or been stopped."""
        return self._streaming

    @property
    def ended(self) -> bool:
        """A simulated source has played to its end and everything of it has arrived."""
        return self._ended

    def _report(self) -> None:
        trouble, self._trouble = self._trouble, None
        if trouble is not None:
            raise trouble
        self._callbacks.report()

    # ---- streams -------------------------------------------------------------------------------

    def start(self, *, pac: bool = True, fingers: int = ALL_FINGERS) -> None:
        """Start streaming frames, status and, unless told otherwise, PAC; ``fingers`` is a bit mask."""
        streams = wire.StreamFlags.FRAMES | wire.StreamFlags.STATUS
        if pac:
            streams |= wire.StreamFlags.PAC
        self._start(self._wants.streams if self._wants else streams, fingers)

    def _start(self, streams: wire.StreamFlags, fingers: int) -> None:
        # Pull alone has no keep-alive: it reads, and so could ping, only when its caller asks.
        request = wire.Start(self._next_req_id(), int(streams), fingers, self._keepalive_ms())
        self._command(request)
        self._heard_s = self.timing.monotonic_s()
        self._due_s = self._ping_due_s = self._heard_s + KEEPALIVE_S / PINGS_PER_KEEPALIVE
        self._started = request
        self._streaming = True
        self.link.release()

    def _keepalive_ms(self) -> int:
        # In device time, which a simulated board can let run fast; one that waits for its reader knows no dead host.
        if self._reader is None or self.link.pace == 0:
            return 0
        return min(0xFFFF, round(1000 * KEEPALIVE_S * max(1.0, self.link.pace)))

    def stop(self) -> None:
        """Stop streaming. Frames already on their way are still delivered."""
        self._command(wire.Stop(self._next_req_id()))
        self._streaming = False
        self._started = None
        self._tell()

    def subscribe(self, quantities: wire.QuantityFlags, *, fingers: int = ALL_FINGERS) -> None:
        """See Commands.subscribe."""
        super().subscribe(quantities, fingers=fingers)
        self._quantities.update({f: quantities for f in range(MAX_SENSORS) if fingers >> f & 1})

    def want(self, *names: str, rest: bool = True, rate_hz: float | None = None) -> None:
        """Choose what the board computes and sends.

        Names are force, poc, torque, pressure, sigma, touch, raw, pdc, temperature and pac. Electrodes' raw counts,
        pdc and temperature travel in every FRAME, so each of them asks for frames and no more. Status always comes,
        it is the link's sign of life, whether ``status`` is named or not. With ``rest=False`` an untouched finger
        sends heartbeats in place of frames. ``rate_hz``, above 0 to 100, takes every n-th frame with n = 100 /
        rate_hz rounded, by seq: on this side only, for boards cannot leave frames out; a recording has them all, and
        PAC and messages are not thinned. Holds for all fingers until the next ``want``. Raises InputError for a name
        or rate that there is not.
        """
        wants = Wants.of(names, rest=rest, rate_hz=rate_hz)
        self.subscribe(wants.quantities)
        self._wants = wants
        if self._streaming and self._started is not None:
            self._start(wants.streams, self._started.fingers)

    # ---- live ----------------------------------------------------------------------------------

    def run(self: Self, *, queue: bool = False) -> Self:
        """Have threads read the board from now on, and let it stream; returns this hand.

        ``hand["index"]`` and callbacks then follow by themselves, the board stops within a second of this
        process's death, and with ``reconnect`` its return is noticed by itself. Batches are kept for ``batches``,
        ``frames`` and ``read`` from their first call on, or from now on with ``queue``; a caller that is slow
        loses the oldest (``stats.batches_skipped``). A simulated board that is not paced waits instead.
        """
        if queue:
            self._pulled = True
        self._begin(pulled=queue)
        if not self._streaming and not self._ended:
            self.start()
        return self

    def _begin(self, *, pulled: bool) -> None:
        self._report()
        if self._closed:
            raise DeviceLostError(f"this Hand on {self.port} was closed; open the port again")
        if self._reader is not None:
            return
        if not (pulled or self._has_pulled):
            # Nobody takes them: kept, they would be stale later, or hold up a board that waits for room.
            self._pulled = False
            self._batches = BatchQueue()
        limit = LIMIT_ROWS if self.link.pace else None
        for one in (self._batches, self._for_callbacks, *self._queues):
            one.bound(limit)
        self._reader = Reader(self, self.port)
        self._heard_s = self.timing.monotonic_s()
        self._reader.start()
        if self._streaming and self._started is not None:
            self._start(wire.StreamFlags(self._started.streams), self._started.fingers)  # now with keep-alive

    def on_batch(self, fn: Callable[[Batch], Any]) -> Unsubscribe:
        """Call ``fn`` with every batch, on the reading thread; returns what ends that.

        As with all ``on_...``: this starts the reading threads, the stream starts with ``run`` or ``start``. ``fn``
        may give commands. While it is slow the link is read all the same, and callbacks lose the oldest batches.
        What it raises comes up as CallbackError at the next call or at ``close``.
        """
        return self._subscribed(self._callbacks.on_batch(fn))

    def on_touch(self, fn: Callable[[wire.Touch], Any]) -> Unsubscribe:
        """Call ``fn`` as soon as a resting finger's signals move, inside the round: a hint, CONTACT may follow.

        Subscribes every finger to TOUCH besides what it is subscribed to.
        """
        touch = wire.QuantityFlags.TOUCH
        for quantities in {q for q in self._quantities.values() if touch not in q}:
            mask = sum(1 << f for f, q in self._quantities.items() if q == quantities)
            self.subscribe(quantities | touch, fingers=mask)
        return self._subscribed(self._callbacks.on_message(MESSAGES["touch"], fn))

    def on_tare(self, fn: Callable[[wire.Tare], Any]) -> Unsubscribe:
        """Call ``fn`` with every change of a tare."""
        return self._subscribed(self._callbacks.on_message(MESSAGES["tare"], fn))

    def on_status(self, fn: Callable[[wire.Status], Any]) -> Unsubscribe:
        """Call ``fn`` with the board's counters, every second."""
        return self._subscribed(self._callbacks.on_message(MESSAGES["status"], fn))

    def on_gap(self, fn: Callable[[Gap], Any]) -> Unsubscribe:
        """Call ``fn`` when the board has come back and sends again."""
        return self._subscribed(self._callbacks.on_message(MESSAGES["gap"], fn))

    def _subscribed(self, unsubscribe: Unsubscribe) -> Unsubscribe:
        self._begin(pulled=False)
        return unsubscribe

    def open_queue(self, wake: Callable[[], None] | None = None) -> BatchQueue:
        """A queue of one's own for what arrives from now on; ``wake`` is called on the reading thread."""
        self._begin(pulled=False)
        queue = BatchQueue(wake)
        queue.bound(LIMIT_ROWS if self.link.pace else None)
        self._queues = [*self._queues, queue]
        return queue

    def close_queue(self, queue: BatchQueue) -> None:
        """End what open_queue began."""
        self._queues = [one for one in self._queues if one is not queue]
        self.took()

    def took(self) -> None:
        """Something was taken from a queue: a board that waits for room may go on."""
        if self.link.pace == 0:
            with self._changed:
                self._changed.notify_all()

    def check(self) -> None:
        """Raise what the reading threads or callbacks have come to, if anything."""
        if self._failure is not None:
            raise self._failure
        self._report()

    # ---- the reading threads' side (live/reader.py) ------------------------------------------------

    def _arrived(self, batch: Batch) -> None:
        if self._wants is not None:
            batch = self._wants.thin(batch)
        self._latest.update(batch, self._monotonic_s())
        if self._pulled:
            self._batches.put(batch)
        if self._callbacks.wanted:
            reader = self._reader
            if self._next is None and not self._for_callbacks.rows and reader and reader.dispatcher == get_ident():
                self._next = batch  # it is this thread's turn to hand it out, as the next thing it does
            else:
                self._for_callbacks.put(batch)
        for queue in self._queues:
            queue.put(batch)

    def _last_t_us(self) -> int | None:
        return self._latest.last_t_us()

    def read_once(self, timeout_s: float) -> None:
        """See live.reader.Read."""
        if self._pump(timeout_s):
            self._heard_s = self._monotonic_s()

    def keep_up(self) -> float:
        """See live.reader.Read."""
        silence_s = self._silence_s()
        if not self._streaming:
            return silence_s
        if self.link.ended:
            self._finish()
            return silence_s
        now_s = self._monotonic_s()
        if now_s < self._due_s:
            return self._due_s - now_s
        if now_s - self._heard_s >= silence_s:
            self._lost(self._silent(), "silence")
            self._heard_s = now_s = self.timing.monotonic_s()
        silent_s = self._heard_s + silence_s
        if not self._keepalive_ms():
            self._due_s = silent_s
            return silent_s - now_s
        if now_s >= self._ping_due_s:
            self._ping_due_s = now_s + KEEPALIVE_S / PINGS_PER_KEEPALIVE
            try:
                self._send(wire.Ping(self._next_req_id()))
            except DeviceLostError as error:
                self._lost(error, "unplugged")
        self._due_s = min(self._ping_due_s, silent_s)
        return self._due_s - now_s

    def wait_for_room(self) -> None:
        """See live.reader.Read."""
        if self.link.pace:
            return
        full = self._is_full()
        self._wait_for(lambda: self._awaiting or self.closing.is_set() or not self._is_full())
        if full:
            self._heard_s = self.timing.monotonic_s()  # it was not the board that was silent

    def _is_full(self) -> bool:
        return any(one.rows >= LIMIT_ROWS for one in (self._batches, *self._queues))

    def dispatch(self) -> bool:
        """See live.reader.Read."""
        batch = self._next
        if batch is not None:
            self._next = None
        elif (batch := self._for_callbacks.take()) is None:
            return False
        self._callbacks.call(batch)
        return True

    def may_relieve(self) -> bool:
        """See live.reader.Read."""
        return bool(self.link.pace or self._awaiting)

    def fail(self, error: BaseException) -> None:
        """See live.reader.Read."""
        if self.closing.is_set():
            return
        with self._changed:
            self._failure = self._failure or error
            self._streaming = False
        self._tell()

    def _finish(self) -> None:
        """A simulated source is over."""
        self.ping()  # a barrier: its reply comes behind the last frame
        with self._changed:
            self._ended = True
            self._streaming = False
        self._tell()

    def _tell(self) -> None:
        """Whoever waits is to look again."""
        with self._changed:
            self._changed.notify_all()
        for queue in self._queues:
            queue.wake()

    def _silence_s(self) -> float:
        """How long a board that streams may be silent."""
        return SILENCE_S * self.link.patience

    def _silent(self) -> DeviceLostError:
        return DeviceLostError(
            f"{self.port} has been silent for {self._silence_s():.0f} s while streaming; "
            "check the cable and open it again"
        )
