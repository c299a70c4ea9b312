"""A board's streams, and who reads them.

There are two ways to read. Pull: the one thread that wants batches reads the link itself. If it is slow, the operating
system's buffer fills and then the board drops whole frames; if it only gives commands, it loses the oldest batches.
Live: after ``run``, or with callbacks or biotac.aio, threads of this package read all the time (reader.py), and a slow
caller loses the oldest batches on this side.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Any

from ..errors import DeviceLostError, InputError
from ..wire import messages_gen as wire
from ..wire.batches import Batch, LinkStats
from .board import POLL_S, Board
from .callbacks import Callbacks, Unsubscribe
from .commands import ALL_FINGERS
from .compatibility import BANDS_SINCE_MINOR, EVENTS_SINCE_MINOR, need
from .gap import Gap
from .keepalive import KeepAlive
from .queue import LIMIT_ROWS, BatchQueue
from .reader import Reader
from .subscription import Subscription, Wants
from .views import Fingers, Latest


class Streams:
    """Takes what ``board`` delivers, keeps ``latest`` up to date, and passes batches to all consumers."""

    def __init__(self, board: Board, latest: Latest) -> None:
        #: Whether the board was told to stream, and has neither ended nor been stopped.
        self.streaming = False
        #: Whether a simulated source has played to its end and all of it has arrived.
        self.ended = False
        self._board = board
        self._link = board.link
        self._latest = latest
        self._callbacks = Callbacks()
        self._subscription = Subscription(board, latest, self._callbacks)
        self._keepalive = KeepAlive(board)
        self._reader: Reader | None = None
        self._has_pulled = False
        self._pulled: BatchQueue | None = self._new_queue()  # for the pulling thread; never None without threads
        self._puller: threading.Thread | None = None  # the last to enter ``batches``
        self._pulling = 0
        self._queues: list[BatchQueue] = []  # for others, such as biotac.aio
        self._skipped = [0, 0]  # batches and frames skipped in queues that are now closed
        self._claiming = threading.Lock()
        board.deliver = self._deliver

    @property
    def stats(self) -> LinkStats:
        """Counts since the handshake, over reboots too."""
        queues = [self._callbacks.queue, *self._all_queues()]
        return replace(
            self._board.incoming.stats,
            batches_skipped=self._skipped[0] + sum(queue.batches_skipped for queue in queues),
            frames_skipped=self._skipped[1] + sum(queue.frames_skipped for queue in queues),
        )

    def check(self) -> None:
        """Raise an error of the board or the reading threads, of a recording or of a callback, if there was one."""
        self._board.check()
        self.report()

    def report(self) -> None:
        """Raise the first error of the board, a recording or a callback that has not been raised before."""
        self._board.report()
        incoming = self._board.incoming
        trouble, incoming.trouble = incoming.trouble, None
        if trouble is not None:
            raise trouble
        self._callbacks.report()

    def is_read_here(self) -> bool:
        """Whether the caller runs on a reading thread."""
        return self._reader is not None and self._reader.is_here()

    def close(self) -> None:
        """Stop the stream and the threads."""
        board = self._board
        board.closing.set()
        board.host_clock.wake()
        self._wake_all()
        try:
            if self.streaming and board.connected:
                self.streaming = False
                board.send(wire.Stop(0))
        except DeviceLostError:
            pass  # a board that is gone does not stream either
        finally:
            if self._reader is not None:
                self._reader.join()
                self._callbacks.leave()

    # ---- what the board sends ------------------------------------------------------------------

    def start(self, *, pac: bool | None = None, bands: bool = False, fingers: Fingers = ALL_FINGERS) -> None:
        """Start streaming frames, status and PAC; ``fingers`` are names, or a bit mask.

        ``pac``: None streams PAC unless the port is a UART, which is slow. ``bands`` adds BANDS (``on_bands``). After
        ``want``, its streams are started instead of these. Raises WireVersionError for a board without BANDS,
        InputError for more than a UART can carry.
        """
        streams = wire.StreamFlags.FRAMES | wire.StreamFlags.STATUS
        if self._link.bits_per_s is None if pac is None else pac:
            streams |= wire.StreamFlags.PAC
        if bands:
            streams |= wire.StreamFlags.BANDS
        wants = self._subscription.wants
        self._start(wants.streams if wants else streams, self._latest.mask(fingers))

    def _start(self, streams: int, fingers: int) -> None:
        # There is no keep-alive with pull alone, which reads, and so could ping, only when its caller asks.
        self._subscription.start(streams, fingers, self._keepalive.timeout_ms(self._reader is not None))
        self.streaming = True
        self._link.release()
        self._keepalive.start()

    def _start_again(self, streams: int | None = None) -> None:
        """Send START again if the board streams: with these streams (None: the same) and the current keep-alive."""
        started = self._subscription.started
        if self.streaming and started is not None:
            self._start(started.streams if streams is None else streams, started.fingers)

    def resume(self) -> None:
        """Make a board that was away stream again, if it did before."""
        self._subscription.resume()

    def stop(self) -> None:
        """Stop streaming. Frames already on their way are still delivered."""
        self._subscription.stop()
        self.streaming = False
        self._wake_all()

    def subscribe(self, quantities: wire.QuantityFlags, *, fingers: Fingers = ALL_FINGERS) -> None:
        """Choose what the board computes and sends in the frames of ``fingers`` (names, or a bit mask).

        What is left out is not computed; it arrives as NaN, with the flag NOT_ASKED. Without REST_FRAMES, an untouched
        finger sends heartbeats (``Batch.idle``) in place of frames. No touch is missed: a frame comes as soon as the
        signals move. The default is POC | FORCE | TORQUE | PRESSURE | REST_FRAMES; the choice lasts until the board
        restarts. A board without PRESSURE or EVENTS is not asked for them.
        """
        self._subscription.subscribe(quantities, fingers)

    def want(self, *names: str, rest: bool = True, rate_hz: float | None = None) -> None:
        """Choose what the board computes and sends, by name.

        Names are force, poc, torque, pressure, sigma, touch, events, raw, pdc, temperature, pac, bands and status. Raw
        counts, pdc and temperature are in every FRAME, so each of them only asks for frames. Status is always sent,
        named or not: it is the link's sign of life. With ``rest=False`` an untouched finger sends heartbeats in place
        of frames.

        ``rate_hz``, above 0 and up to 100, keeps every n-th frame by seq, with n = 100 / rate_hz rounded. This happens
        on this side only, because boards cannot leave frames out: a recording has all of them, and PAC and messages
        are not thinned. The choice holds for all fingers until the next ``want``; what ``on_touch``, ``on_event`` and
        ``on_tare`` need is added to it. Raises InputError for an unknown name or a rate out of range.
        """
        wants = Wants.of(names, rest=rest, rate_hz=rate_hz)
        self.subscribe(wants.quantities)
        self._subscription.wants = wants
        self._start_again(wants.streams)

    # ---- pull ----------------------------------------------------------------------------------

    def batches(self) -> Iterator[Batch]:
        """See Hand.batches."""
        with self._by_one_thread():
            self._has_pulled = True
            queue = self._pulled = self._pulled or self._new_queue()
            if not self.streaming and not self.ended:
                self.check()
                self.start()
            while True:
                while (batch := queue.take()) is not None:
                    yield batch
                self.check()
                if self.ended:
                    return
                if self._board.closing.is_set():
                    self._board.raise_closed()
                if not self.streaming:
                    return
                self._await_batch(queue)

    @contextmanager
    def _by_one_thread(self) -> Iterator[None]:
        with self._claiming:
            here, there = threading.current_thread(), self._puller
            if self._pulling and there is not here and there is not None and there.is_alive():
                raise InputError(
                    f"thread {there.name!r} is reading this hand, and {here.name!r} would take part of its data; "
                    "read in one thread, or give each an on_batch callback"
                )
            self._pulling = 1 if there is not here else self._pulling + 1
            self._puller = here
        try:
            yield
        finally:
            with self._claiming:
                if self._puller is here:
                    self._pulling -= 1

    def skip_old(self) -> None:
        """Discard what has arrived, and what was on its way until now."""
        if self.streaming:
            self._board.tell(wire.Ping(0))  # a barrier: its reply comes after everything made before
        if self._pulled is not None:
            self._pulled.clear()

    def _await_batch(self, queue: BatchQueue) -> None:
        """Wait until there may be a batch in ``queue``."""
        board = self._board
        if not board.is_read_here():
            board.wait_for(lambda: queue.rows or not self.streaming or board.failure or board.closing.is_set(), 1.0)
        elif self._link.ended:
            self._finish()
        else:
            self._keepalive.ask_time_if_due()
            silent_s = 0.0
            while not board.read(POLL_S) and not self._link.ended:
                silent_s += POLL_S
                if silent_s >= self._keepalive.silence_s():
                    self._keepalive.lose()
                    return

    def put_back(self, batch: Batch) -> None:
        """Return a batch that ``batches`` yielded and that was not used."""
        if self._pulled is not None:
            self._pulled.put_back(batch)

    # ---- live ----------------------------------------------------------------------------------

    def run(self, *, queue: bool = False) -> None:
        """See Hand.run."""
        if queue:
            self._pulled = self._pulled or self._new_queue()
        self._read_always(pulled=queue)
        if not self.streaming and not self.ended:
            self.start()

    def _read_always(self, *, pulled: bool = False) -> None:
        self.check()
        board = self._board
        if board.closed:
            board.raise_closed()
        if self._reader is not None:
            return
        if not (pulled or self._has_pulled):
            # Nobody takes these batches. If kept, they would be stale later, or hold up a board that waits for room.
            self._pulled = None
        self._reader = Reader(self, self._callbacks, board.closing, self._link.port)
        board.is_read_here, board.is_pulled = self._reader.is_here, False
        self._callbacks.queue.bound(self._limit_rows())
        self._keepalive.heard()
        self._reader.start()
        self._start_again()  # now with keep-alive

    def on_batch(self, fn: Callable[[Batch], Any]) -> Unsubscribe:
        """Call ``fn`` with every batch, on the reading thread; returns a function that ends this.

        Like every ``on_...``, this starts the reading threads; the stream starts with ``run`` or ``start``. ``fn`` may
        give commands. The link is read even while ``fn`` is slow, but then callbacks lose the oldest batches. What it
        raises is raised as CallbackError by the next ``check``, ``run``, ``on_...`` or read, or by ``close``.
        """
        return self._on(Batch, fn)

    def on_touch(self, fn: Callable[[wire.Touch], Any]) -> Unsubscribe:
        """Call ``fn`` as soon as a resting finger's signals move, within the round: a hint that CONTACT may follow.

        Adds TOUCH to every finger's subscription.
        """
        return self._on_told(wire.Touch, fn)

    def on_event(self, fn: Callable[[wire.Event], Any]) -> Unsubscribe:
        """Call ``fn`` with every EVENT (touch, lift, jolt, slip and its end, see EventKind) as soon as it arrives.

        Adds EVENTS to every finger's subscription. Raises WireVersionError for a board without events.
        """
        need(self._board.info, EVENTS_SINCE_MINOR, "events")
        return self._on_told(wire.Event, fn)

    def on_slip(self, fn: Callable[[wire.Event], Any]) -> Unsubscribe:
        """Call ``fn`` when what a finger holds begins to slip: with the events of ``on_event`` that are SLIP."""
        return self.on_event(lambda event: fn(event) if event.kind == wire.EventKind.SLIP else None)

    def on_bands(self, fn: Callable[[wire.Bands], Any]) -> Unsubscribe:
        """Call ``fn`` with how strongly dynamic pressure vibrated, by octave, 100 times a second for each finger.

        Adds BANDS to what is streamed. Raises WireVersionError for a board without BANDS.
        """
        need(self._board.info, BANDS_SINCE_MINOR, "bands of PAC")
        unsubscribe = self._on(wire.Bands, fn)
        self._hint(wire.StreamFlags.BANDS)
        return unsubscribe

    def _on_told(self, kind: type[Any], fn: Callable[[Any], Any]) -> Unsubscribe:
        unsubscribe = self._on(kind, fn)
        self._subscription.tell_of(kind)
        self._hint(wire.StreamFlags.FRAMES)
        return unsubscribe

    def on_tare(self, fn: Callable[[wire.Tare], Any]) -> Unsubscribe:
        """Call ``fn`` with every change of a tare."""
        unsubscribe = self._on(wire.Tare, fn)
        self._hint(wire.StreamFlags.FRAMES)
        return unsubscribe

    def _hint(self, streams: wire.StreamFlags) -> None:
        """Add ``streams``, which carry what a callback waits for, to what is streamed."""
        if self._subscription.hint(streams):
            self._start_again()

    def on_status(self, fn: Callable[[wire.Status], Any]) -> Unsubscribe:
        """Call ``fn`` with each STATUS, the board's counters, which comes every second by default."""
        return self._on(wire.Status, fn)

    def on_gap(self, fn: Callable[[Gap], Any]) -> Unsubscribe:
        """Call ``fn`` when the board was away (``reconnect``), and is back and sending again."""
        return self._on(Gap, fn)

    def _on(self, kind: type[Any], fn: Callable[[Any], Any]) -> Unsubscribe:
        self._read_always()
        return self._callbacks.add(kind, fn)

    def open_queue(self, wake: Callable[[], None] | None = None) -> BatchQueue:
        """A separate queue for what arrives from now on; ``wake`` is called on the reading thread."""
        self._read_always()
        queue = self._new_queue(wake)
        self._queues = [*self._queues, queue]
        return queue

    def close_queue(self, queue: BatchQueue) -> None:
        """Close a queue made by open_queue."""
        if queue in self._queues:
            self._queues = [one for one in self._queues if one is not queue]
            self._skipped[0] += queue.batches_skipped
            self._skipped[1] += queue.frames_skipped
        self._board.notify()

    # ---- queues --------------------------------------------------------------------------------

    def _new_queue(self, wake: Callable[[], None] | None = None) -> BatchQueue:
        # A board that waits for room may go on once something has been taken.
        queue = BatchQueue(wake, None if self._link.pace else self._board.notify)
        queue.bound(self._limit_rows())
        return queue

    def _limit_rows(self) -> int | None:
        return LIMIT_ROWS if self._link.pace else None  # pace 0: the board waits for its reader

    def _all_queues(self) -> list[BatchQueue]:
        return self._queues if self._pulled is None else [self._pulled, *self._queues]

    def _wake_all(self) -> None:
        """Wake everyone who waits, to look again."""
        self._board.notify()
        for queue in self._queues:
            queue.wake()

    # ---- on the thread that reads --------------------------------------------------------------

    def _deliver(self, batch: Batch) -> None:
        if self._subscription.wants is not None:
            batch = self._subscription.wants.thin(batch)
        now_s = self._keepalive.heard()  # before this batch wakes anybody
        self._latest.update(batch, now_s)
        if self._pulled is not None:
            self._pulled.put(batch)
        self._callbacks.put(batch)
        for queue in self._queues:
            queue.put(batch)

    def read(self, at_most_s: float) -> None:
        """Wait for bytes, and do what is due: ping, or notice silence or the end of a source."""
        if self._link.pace == 0:
            self._wait_for_room()
        if self.streaming and self._link.ended:
            self._finish()
        elif self.streaming:
            at_most_s = min(at_most_s, self._keepalive.serve(live=self._reader is not None))
        self._board.read(at_most_s)

    def _wait_for_room(self) -> None:
        """Where nothing may be dropped, wait until consumers have room or somebody awaits a reply."""
        if self._is_full():
            board = self._board
            board.wait_for(lambda: board.awaiting or board.closing.is_set() or not self._is_full())
            self._keepalive.heard()  # the silence was ours, not the board's

    def _is_full(self) -> bool:
        return any(one.rows >= LIMIT_ROWS for one in self._all_queues())

    def may_relieve(self) -> bool:
        """See reader.Source."""
        return bool(self._link.pace or self._board.awaiting)

    def fail(self, error: BaseException) -> None:
        """See reader.Source."""
        if not self._board.closing.is_set():
            self._board.fail(error)
            self.streaming = False
            self._wake_all()

    def _finish(self) -> None:
        """Note that a simulated source has ended, once all of it has arrived."""
        self._board.tell(wire.Ping(0))  # a barrier: its reply comes after the last frame
        self.ended = True
        self.streaming = False
        self._wake_all()
