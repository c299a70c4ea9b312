"""Hand: one board with its fingers, as users see it, composed of the parts in this folder."""

from __future__ import annotations

import os
import threading
import warnings as python_warnings
import weakref
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import replace
from functools import wraps
from pathlib import Path
from types import TracebackType
from typing import Any, Concatenate, NoReturn, ParamSpec, SupportsIndex, TypeVar, cast

from ..board import handshake
from ..board.board import Board
from ..board.consumers import Callbacks, Queue, Troubles, Unsubscribe
from ..board.gap import Gap
from ..board.handshake import HandWarning
from ..board.keeper import SILENCE_S, Keeper
from ..board.reader import THREADS
from ..board.stream import ALL_FINGERS, Stream
from ..clock import DeviceClock
from ..clock.host_clock import HostClock
from ..errors import DeviceLostError, InputError, ReadWarning
from ..link import Link
from ..markdown import html_table
from ..wire import messages_gen as wire
from ..wire.batches import Batch, LinkStats, join, split
from ..wire.frames import Frame, StructArray
from ..wire.sensor_gen import MAX_SENSORS
from .commands import Commands
from .configuration import Configuration
from .record import Mark, Recorder
from .views import Fingers, FingerView, Latest, checked_names, finger_index

P = ParamSpec("P")
R = TypeVar("R")
#: Values older than this are not shown as a finger's latest.
MAX_AGE_S = 0.25


def _of(method: Callable[Concatenate[Commands, P], R]) -> Callable[Concatenate[Hand, P], R]:
    """A method of Hand that calls the same method of its Commands."""

    @wraps(method)
    def call(self: Hand, /, *args: P.args, **kwargs: P.kwargs) -> R:
        return method(self._commands, *args, **kwargs)

    return call


class Hand:
    """A board with its fingers. Made by ``biotac.open``; use it as a context manager."""

    def __init__(
        self,
        link: Link,
        *,
        reconnect: bool = False,
        fingers: Mapping[str, int] | None = None,
        max_age_s: float = MAX_AGE_S,
        host_clock: HostClock | None = None,
    ) -> None:
        names = checked_names(fingers)
        self._board = board = Board(link, host_clock=host_clock)
        self._reader = reader = board.reader
        self._troubles = Troubles()
        self._latest = Latest(reader, names, max_age_s=max_age_s, report=_reporter(board, self._troubles))
        self._commands = Commands(board, self._latest)
        #: Settings, calibrations and wrench maps that the board keeps, and its faults.
        self.board = Configuration(board, self._commands)
        self._stream = Stream(board)
        self._callbacks = Callbacks(reader, self._troubles)
        self._pulled = Queue(reader)
        self._has_pulled = False
        self._puller: threading.Thread | None = None  # the thread that reads
        self._pulling = threading.Lock()
        self._left = [0, 0]  # batches and frames skipped in queues that are closed
        self._others: list[Queue] = []  # of biotac.aio
        self._recorders: list[Recorder] = []  # the open one last
        self._keeper = Keeper(board, self._stream, self._callbacks, reconnect=reconnect)
        reader.add(self._latest)
        reader.add(self._pulled)
        self._keeper.start()
        # Neither the parts nor their threads refer to this object, so that it can be garbage-collected.
        parts = board, self._stream, self._keeper, self._callbacks, self._recorders
        self._finalizer = weakref.finalize(self, _end, *parts)
        #: The link that carries the bytes.
        self.link = link
        #: Converts device time to host time, fed by whatever is read. A simulated board's time is not a real clock: it
        #: waits for the computer, which shows up as ``resets``.
        self.clock: DeviceClock = reader.clock

    # ---- what it is ----------------------------------------------------------------------------

    @property
    def port(self) -> str:
        """The PORT this was opened as."""
        return self.link.port

    @property
    def info(self) -> wire.Hello:
        """What the board said about itself when it was opened, or when it last came back."""
        return self._board.info

    @property
    def fingers(self) -> list[int]:
        """Chip selects of the fingers whose sensor answered when the board was opened, or last came back."""
        return [f for f in range(MAX_SENSORS) if self.info.fingers_present >> f & 1]

    @property
    def warnings(self) -> list[HandWarning]:
        """Where this board's firmware and this library do not fit together; empty when they fit."""
        return handshake.warnings(self.info, self.port)

    @property
    def stats(self) -> LinkStats:
        """Counts since the handshake, over reboots too."""
        self._latest.report()
        queues = [self._callbacks.queue, *self._others, *([self._pulled] if self._has_pulled else [])]
        return replace(
            self._reader.stats,
            batches_skipped=self._left[0] + sum(queue.batches_skipped for queue in queues),
            frames_skipped=self._left[1] + sum(queue.frames_skipped for queue in queues),
        )

    @property
    def connected(self) -> bool:
        """Whether the board can be reached; false while reconnecting, once it is lost, and after ``close``."""
        return self._board.connected

    @property
    def streaming(self) -> bool:
        """Whether the board was told to stream, and has neither ended nor been stopped.

        Raises what has failed since the last call, like every other call: see ``check``.
        """
        self._latest.report()
        return self._stream.on and not self._reader.closing.is_set()

    @property
    def ended(self) -> bool:
        """Whether a simulated source has played to its end and all of it has arrived."""
        return self._stream.ended

    def __getitem__(self, finger: str | SupportsIndex) -> FingerView:
        """The latest values of one finger, by name or chip select.

        Raises KeyError for an unknown finger, and for one whose sensor has never answered.
        """
        number = self._latest.present(finger)
        self._let_pass()
        return FingerView(self._latest.name(number), number, self._latest, self._go)

    def __iter__(self) -> Iterator[str]:
        """Names of the fingers whose sensor answered; a chip select without a name is given as text."""
        return iter([self._latest.name(finger) for finger in self.fingers])

    def __len__(self) -> int:
        """How many fingers' sensors answered."""
        return len(self.fingers)

    def _ipython_key_completions_(self) -> list[str]:
        return list(self)

    def __bool__(self) -> bool:
        return True

    def __contains__(self, finger: object) -> bool:
        """Whether the sensor with that name or chip select answered."""
        with suppress(KeyError):
            return finger_index(self._latest.names, cast(Any, finger)) in self.fingers
        return False

    def __repr__(self) -> str:
        return f"<biotac.Hand on {self.port}, fingers {self.fingers}{', closed' if self._board.closed else ''}>"

    def _repr_html_(self) -> str:
        views = [FingerView(self._latest.name(finger), finger, self._latest, self._go) for finger in self.fingers]
        return html_table(repr(self), [[view.name, *view._now()] for view in views])

    # ---- life ----------------------------------------------------------------------------------

    def __enter__(self) -> Hand:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()
        if error is None:
            self._report_at_end()

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            f"{self!r} belongs to this process and cannot be sent to another; open the board there, or send arrays"
        )

    def close(self) -> None:
        """Stop the stream, finish a recording and give the port back. Safe to call twice.

        Afterwards raises the first error that has not been raised before: DeviceLostError if the board was lost,
        OSError or InputError if a recording failed, CallbackError if a callback raised. The end of a ``with`` block
        does the same, unless its body raised. What has arrived is passed to callbacks for up to one more second, and a
        running callback is waited for; the rest is counted in ``stats.batches_skipped``. A hand that is
        garbage-collected, or still open when its program ends, is closed too.
        """
        self._end()
        self._report_at_end()

    def _end(self) -> None:
        _end(self._board, self._stream, self._keeper, self._callbacks, self._recorders)

    def _report_at_end(self) -> None:
        if not self._reader.reported:
            self._reader.check()
        self._troubles.report()

    def check(self) -> None:
        """Raise what has failed: the board for good, or since the last call a recording or a callback.

        So does every other call on this hand and its fingers.
        """
        self._latest.report()

    # ---- commands (commands.py) ----------------------------------------------------------------

    ping = _of(Commands.ping)
    status = _of(Commands.status)
    sync = _of(Commands.sync)
    take_link = _of(Commands.take_link)
    sensor_status = _of(Commands.sensor_status)
    sensor_info = _of(Commands.sensor_info)
    point = _of(Commands.point)
    tare = _of(Commands.tare)
    set_tare = _of(Commands.set_tare)
    hold = _of(Commands.hold)
    release = _of(Commands.release)
    grasp = _of(Commands.grasp)

    # ---- what arrives --------------------------------------------------------------------------

    def stream(
        self, *names: str, fingers: Fingers = ALL_FINGERS, rest: bool = True, rate_hz: float | None = None
    ) -> None:
        """Choose what the board computes and sends, and start the stream; again, to choose anew.

        Names are force, poc, torque, pressure, sigma, touch, events, raw, pdc, temperature, pac, bands, status, and
        ``results``, the default: force, poc, torque and pressure, with pac unless the port is a UART, which is slow.
        Raw counts, pdc and temperature are in every FRAME, so each of them only asks for frames; status is always sent.
        What is left out is not computed; it arrives as NaN, with the flag NOT_ASKED. What callbacks wait for is added.

        ``fingers`` are names, chip selects, or a bit mask. With ``rest=False`` an untouched finger sends heartbeats
        (``Batch.idle``) in place of frames; no touch is missed: a frame comes as soon as the signals move. ``rate_hz``,
        above 0 and up to 100, keeps every n-th frame by seq, with n = 100 / rate_hz rounded. This happens on this side
        only, because boards cannot leave frames out: a recording has all of them, and PAC and messages are not thinned.

        The board is kept streaming until ``stop`` or ``close``: after a pause of this program, or with ``reconnect`` a
        loss of the board, it is started again, and a ``Gap`` tells what is missing. It stops within a second of this
        process's death. Raises InputError for an unknown name, a rate out of range, or more than a UART can carry;
        KeyError for a finger that is not there.
        """
        mask = self._latest.mask(fingers)
        self._stream.start(names, fingers=mask, rest=rest, rate_hz=rate_hz)
        self._latest.report()

    def stop(self) -> None:
        """Stop streaming. What was on its way has arrived, and is still delivered."""
        self._stream.stop()
        self._latest.report()

    def _go(self) -> None:
        """Start the stream, with what was chosen last, unless it runs."""
        self._latest.report()
        self._stream.go()

    def batches(self) -> Iterator[Batch]:
        """Yield batches as they arrive, starting the stream if need be.

        Ends when a simulated source ends, and when ``stop`` is called. All iterations of ``batches`` and ``frames``,
        and ``read``, share one queue, which only one thread at a time may use; another gets InputError. It begins with
        the stream, or, where a callback or a view was used before, with this call, and holds 16 384 rows, 10 to 20 s.
        """
        queue, stream, closing = self._pulled, self._stream, self._reader.closing
        with self._by_one_thread():
            if not self._has_pulled:
                self._has_pulled = True
                self._pulled.begin()
            self._go()
            while True:
                self._latest.report()
                over = not stream.on  # before the queue is emptied, so that nothing is left in it
                batch = queue.take(wait=not (over or closing.is_set()))
                if batch is not None:
                    yield batch
                elif closing.is_set():
                    self._reader.raise_closed()
                elif over:
                    return

    def _let_pass(self) -> None:
        """What arrives is looked at in another way: it need not be kept until somebody reads."""
        if not self._has_pulled and not self._pulled.lets_pass:
            self._pulled.lets_pass = True
            self._pulled.clear()

    @contextmanager
    def _by_one_thread(self) -> Iterator[None]:
        here = threading.current_thread()
        with self._pulling:
            before = self._puller
            if before is not None and before is not here and before.is_alive():
                raise InputError(
                    f"thread {before.name!r} is reading this hand, and {here.name!r} would take part of its data; "
                    "read in one thread, or give each an on_batch callback"
                )
            self._puller = here
        try:
            yield
        finally:
            self._puller = before

    def frames(self) -> Iterator[Frame]:
        """Yield typed frames as they arrive; starts and ends like ``batches``."""
        for batch in self.batches():
            for row in batch.frames:
                yield Frame.from_row(row)

    def read(self, seconds: float, *, fresh: bool = False) -> StructArray:
        """Return the frames of the next ``seconds`` of device time as one FRAME_DTYPE array (n,).

        They follow those of the previous read: after a pause they are as old as the pause, as far as the buffers
        reach, and any frame that is missing is counted in ``stats``. With ``fresh``, frames made before this call are
        discarded. A ReadWarning tells of a Gap among them, and when a simulated source ended first: the array is then
        shorter, and empty when it had ended before. It is empty too when no sensor answered in that time. Raises
        ValueError unless seconds is a number above 0.
        """
        batch = self.read_batch(seconds, fresh=fresh)
        for gap in (m for m in batch.messages if isinstance(m, Gap)):
            python_warnings.warn(gap.line(), ReadWarning, stacklevel=2)
        return batch.frames

    def read_batch(self, seconds: float, *, fresh: bool = False) -> Batch:
        """Like ``read``, but returns the Batch: also the wire messages, PAC, events and Gaps of the same time."""
        if not 0 < seconds < float("inf"):
            raise ValueError(f"seconds is {seconds}, expected a number above 0")
        if fresh and self._stream.on:
            self.ping()  # a barrier: its reply comes after everything made before
            self._pulled.clear()
        taken: list[Batch] = []
        end_us: int | None = None
        first_status_us: int | None = None
        for batch in self.batches():
            for status in (m for m in batch.messages if isinstance(m, wire.Status)):
                first_status_us = status.t_us if first_status_us is None else first_status_us
                if end_us is None and (status.t_us - first_status_us) % 2**32 > (seconds + SILENCE_S) * 1e6:
                    return join(taken)  # the board is there, its sensors are not
            first_us, last_us = batch.first_t_us(), batch.last_t_us()
            if end_us is None and first_us is not None:
                end_us = first_us + round(seconds * 1e6)
            if end_us is None or last_us is None or last_us < end_us:
                taken.append(batch)
                continue
            now, later = split(batch, end_us)
            self._pulled.put_back(later)
            return join([*taken, now])
        if self._stream.ended:
            text = f"the source of {self.port} ended before {seconds:g} s were read"
            python_warnings.warn(text, ReadWarning, stacklevel=3)
        return join(taken)

    # ---- callbacks (consumers.py) --------------------------------------------------------------

    def on_batch(self, fn: Callable[[Batch], Any]) -> Unsubscribe:
        """Call ``fn`` with every batch; returns a function that ends this.

        Callbacks of a hand run in one thread, in order, and may give commands. While they are slow they lose the oldest
        batches, counted in ``stats`` and told by a Gap; the link is read on. What one raises is logged, and raised as
        CallbackError by the next call of any kind on the hand or its fingers. The stream starts with ``stream``, or
        with the first read.
        """
        return self._on(Batch, fn)

    def on_event(self, fn: Callable[[wire.Event], Any]) -> Unsubscribe:
        """Call ``fn`` with every EVENT (touch, lift, jolt, slip and its end, see EventKind) as soon as it arrives.

        Adds events to what is streamed. Events older than ``max_age_s`` (biotac.open), which waited somewhere while
        this program stood still, are left out; batches and recordings have them. The same holds for ``on_touch`` and
        ``on_slip``.
        """
        return self._on(wire.Event, self._if_new(fn))

    def on_slip(self, fn: Callable[[wire.Event], Any]) -> Unsubscribe:
        """Call ``fn`` when what a finger holds begins to slip: with the events of ``on_event`` that are SLIP."""
        return self._on(wire.Event, self._if_new(fn, wire.EventKind.SLIP))

    def on_touch(self, fn: Callable[[wire.Touch], Any]) -> Unsubscribe:
        """Call ``fn`` as soon as a resting finger's signals move, within the round: a hint that CONTACT may follow.

        Adds touch to what is streamed.
        """
        return self._on(wire.Touch, self._if_new(fn))

    def on_bands(self, fn: Callable[[wire.Bands], Any]) -> Unsubscribe:
        """Call ``fn`` with how strongly dynamic pressure vibrated, by octave, 100 times a second for each finger.

        Adds bands to what is streamed.
        """
        return self._on(wire.Bands, fn)

    def on_tare(self, fn: Callable[[wire.Tare], Any]) -> Unsubscribe:
        """Call ``fn`` with every change of a tare."""
        return self._on(wire.Tare, fn)

    def on_status(self, fn: Callable[[wire.Status], Any]) -> Unsubscribe:
        """Call ``fn`` with each STATUS, the board's counters, which comes every second by default."""
        return self._on(wire.Status, fn)

    def on_gap(self, fn: Callable[[Gap], Any]) -> Unsubscribe:
        """Call ``fn`` when rows are missing and the next ones have come: see Gap."""
        return self._on(Gap, fn)

    def _on(self, kind: type[Any], fn: Callable[[Any], Any]) -> Unsubscribe:
        self._latest.report()
        self._let_pass()
        self._stream.imply(kind)
        return self._callbacks.add(kind, fn)

    def _if_new(self, fn: Callable[[Any], Any], kind: wire.EventKind | None = None) -> Callable[[Any], Any]:
        reader, max_age_s = self._reader, self._latest.max_age_s

        @wraps(fn)
        def call(message: Any) -> None:
            if kind in (None, getattr(message, "kind", None)) and reader.age_s(message.t_us) <= max_age_s:
                fn(message)

        return call

    def _open_queue(self, on_news: Callable[[], None]) -> Queue:
        """A queue of one's own for what arrives from now on; ``on_news`` is called on the reading thread."""
        self._latest.report()
        self._let_pass()
        queue = Queue(self._reader, on_news)
        self._others.append(queue)
        self._reader.add(queue)
        return queue

    def _close_queue(self, queue: Queue) -> None:
        """Close a queue made by _open_queue."""
        self._reader.remove(queue)
        if queue in self._others:
            self._others.remove(queue)
            self._left = [self._left[0] + queue.batches_skipped, self._left[1] + queue.frames_skipped]

    # ---- recording -----------------------------------------------------------------------------

    def mark(self, text: str, finger: str | SupportsIndex | None = None, **facts: str | float) -> Mark:
        """Label this moment in the open recording: the round that arrived last. With ``with``, label a span.

        ``facts`` are whatever else is to be found again, such as ``subject="S07"``, ``trial=3`` or ``video_s=12.4``;
        ``Recording.labels`` has them. Raises InputError when nothing is being recorded, KeyError for a finger that is
        not there.

        >>> with biotac.open("sim:press.toml") as hand, hand.record("press.mcap", note="a glass plate"):
        ...     with hand.mark("pressed", trial=1):
        ...         _ = hand.read(seconds=1)
        """
        self._latest.report()
        number = None if finger is None else self._latest.present(finger)
        if not self._recorders:
            raise InputError("nothing is being recorded; call hand.record(...) first")
        return self._recorders[-1].mark(text, number, facts)

    def record(
        self, path: str | os.PathLike[str], *, overwrite: bool = False, note: str = "", **facts: str | float
    ) -> Recorder:
        """Write everything that arrives from now on to an MCAP file, until this hand or the recorder is closed.

        Frames that have arrived but not been read yet are not recorded; to have all, call this before ``stream`` or the
        first read. When the board restarts (``reconnect``), a new file is begun (``Recorder.paths``). A program that
        ends without ``close`` loses nothing that has arrived; one that is killed loses up to a second. ``note``
        and ``facts``, such as subject="S03", trial=7, become a label of the whole recording.

        Raises InputError when the file exists and ``overwrite`` is false, when it cannot be written, or when another
        recording of this hand is still open.
        """
        self._latest.report()
        for recorder in self._recorders:
            if not recorder.closed:
                raise InputError(f"this hand is being recorded to {recorder.path}; close that recorder first")
        how = {"overwrite": overwrite, "mid_stream": self._stream.on}
        recorder = Recorder(self._board, self._commands, self.board, self._troubles, Path(path), **how)
        self._recorders[:] = [recorder]
        if note or facts:
            recorder.mark(note, None, facts, timed=False)
        return recorder


def _reporter(board: Board, troubles: Troubles) -> Callable[[], None]:
    """Raises what the program has not been told yet; callbacks and recorders are not the program."""

    def report() -> None:
        board.reader.check()
        if not board.reader.is_own():
            troubles.report()

    return report


def _end(board: Board, stream: Stream, keeper: Keeper, callbacks: Callbacks, recorders: list[Recorder]) -> None:
    """Close a hand's parts; also called when the hand is garbage-collected or the program ends."""
    reader = board.reader
    if reader.is_inherited():
        return
    if threading.current_thread() in THREADS:  # it cannot wait for itself, nor are other hands to wait
        threading.Thread(target=_end, args=(board, stream, keeper, callbacks, recorders), name="biotac end").start()
        return
    with board.ending, ExitStack() as last:  # these run even when one of them fails
        if board.closed:
            return
        last.callback(board.close)
        for recorder in recorders:
            last.callback(recorder.close)
        last.callback(callbacks.close)
        last.callback(keeper.close)
        reader.closing.set()
        with suppress(DeviceLostError):  # a board that is gone does not stream either
            stream.leave()
        reader.wake()
