"""Hand: one board with its fingers, as users see it, composed of the parts in this folder."""

from __future__ import annotations

import os
import threading
import warnings
import weakref
from collections.abc import Iterator, Mapping
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import Any, NoReturn, SupportsIndex, cast

from ..board import handshake
from ..board.board import Board
from ..board.connection import THREADS
from ..board.consumers import Callbacks, DeferredErrors, Wanted
from ..board.gap import Gap, fingers_in
from ..board.handshake import HandWarning
from ..board.reader import Consumer
from ..board.recovery import StreamWatch
from ..board.stream import ALL_FINGERS, Stream
from ..clock import DeviceClock
from ..clock.host_clock import HostClock
from ..errors import DeviceLostError, InputError, ReadWarning
from ..link import Link
from ..markdown import html_table
from ..wire import messages_gen as wire
from ..wire.batches import Batch, LinkStats
from ..wire.frames import Frame, StructArray
from .commands import Commands, Requests
from .configuration import Configuration
from .reading import Reading
from .record import Mark, Recorder
from .rounds import Round, Rounds
from .subscriptions import Subscriptions
from .views import Fingers, FingerView, Latest, checked_names, finger_index

#: Values older than this are not shown as a finger's latest.
MAX_AGE_S = 0.25


class Hand(Commands, Subscriptions):
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
        if not max_age_s > 0:
            raise InputError(f"max_age_s is {max_age_s}, expected more than 0: no value would ever be shown")
        self._board = board = Board(link, reconnects=reconnect, host_clock=host_clock)
        self._reader = reader = board.reader
        self._troubles = DeferredErrors()
        self._latest = Latest(reader, names, max_age_s=max_age_s, troubles=self._troubles)
        reader.add(self._latest)  # before every queue: a consumer that gets a batch finds the frames here, too
        self._requests = Requests(board, self._latest)
        #: The board's settings, calibrations, wrench maps and faults.
        self.board = Configuration(board, self._requests)
        self._stream = Stream(board)
        self._wanted = Wanted()  # by callbacks, which may refer to this object: the threads do not refer to them
        self._callbacks = Callbacks(reader, self._troubles, self._wanted)
        self._reading = Reading(board, self._stream, self._latest)
        self._recorders: list[Recorder] = []  # the open one last
        self._rounds: Rounds | None = None  # once a program asks for rounds
        self._watch = StreamWatch(board, self._stream, tares=self._latest.tares)
        self._watch.start()
        # Neither the parts nor their threads refer to this object, so that it can be garbage-collected.
        self._parts = board, self._stream, self._watch, self._callbacks, self._recorders
        self._finalizer = weakref.finalize(self, _end, *self._parts)
        #: The link that carries the bytes.
        self.link = link
        #: Converts device time to host time, fed by everything that is read. A simulated board's time waits for the
        #: computer and is no real clock, which shows up as ``resets``.
        self.clock: DeviceClock = reader.clock
        #: Passes on the bytes that a function reads, as the reading thread does: for a program that advances a board's
        #: time.
        self.take = reader.take
        #: The force on simulated fingers (n,) in rounds at device times (n,); None on a real one.
        self.applied_n = reader.applied_n

    # ---- state ---------------------------------------------------------------------------------

    @property
    def port(self) -> str:
        """The PORT this was opened as."""
        return self.link.port

    @property
    def info(self) -> wire.Hello:
        """The board's HELLO, from when it was opened or last came back."""
        return self._board.info

    @property
    def fingers(self) -> list[int]:
        """Chip selects of the fingers that answered when the board was opened, or last came back."""
        return list(fingers_in(self.info.fingers_present))

    @property
    def warnings(self) -> list[HandWarning]:
        """Where firmware and library do not fit together, and findings about rounds that another driver made."""
        own = handshake.warnings(self.info, self.port, self._reader.stats.unknown_messages)
        return [*own, *(HandWarning("rounds", text) for text in self.link.notes)]

    @property
    def stats(self) -> LinkStats:
        """Counts since the handshake, over reboots too."""
        self._latest.report()
        return self._reader.stats

    @property
    def connected(self) -> bool:
        """Whether the board can be reached; false while reconnecting, once it is lost, and after ``close``."""
        return self._board.connected

    @property
    def closed(self) -> bool:
        """Whether it was closed, by whomever."""
        return self._board.connection.given_back

    @property
    def streaming(self) -> bool:
        """Whether the board was told to stream, and has neither ended nor been stopped.

        Raises errors since the last call, like every other call: see ``check``.
        """
        self._latest.report()
        return self._stream.on and not self._board.connection.closing

    @property
    def ended(self) -> bool:
        """Whether a simulated source has ended and all rows of it have arrived."""
        return self._board.connection.played

    def __getitem__(self, finger: str | SupportsIndex) -> FingerView:
        """The latest values of one finger, by name or chip select.

        Raises KeyError for an unknown finger, and for a sensor that has never answered.
        """
        number = self._latest.present(finger)
        self._reading.stop_buffering()
        return FingerView(self._latest.name(number), number, self._latest, self.start)

    def __iter__(self) -> Iterator[str]:
        """Names of the fingers that answered; a chip select without a name is given as text."""
        return iter([self._latest.name(finger) for finger in self.fingers])

    def __len__(self) -> int:
        """How many fingers answered."""
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
        return f"<biotac.Hand on {self.port}, fingers {self.fingers}{', closed' if self.closed else ''}>"

    def _repr_html_(self) -> str:
        views = [FingerView(self._latest.name(finger), finger, self._latest, self.start) for finger in self.fingers]
        return html_table(repr(self), [[view.name, *view.line()] for view in views])

    # ---- life ----------------------------------------------------------------------------------

    def __enter__(self) -> Hand:
        return self

    def __exit__(self, kind: object, error: object, trace: object) -> None:
        if error is None:
            self.close()
        else:
            _end(*self._parts)

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            f"{self!r} belongs to this process and cannot be sent to another; open the board there, or send arrays"
        )

    def close(self) -> None:
        """Stop the stream, finish a recording and give the port back. Safe to call twice.

        Afterwards raises the first error that has not been raised before: DeviceLostError if the board was lost,
        OSError or InputError if a recording failed, CallbackError if a callback raised. The end of a ``with`` block
        does the same, unless the body raised. Callbacks get the remaining batches for up to one more second, and a
        running callback is waited for; ``stats.batches_skipped`` counts the others. A hand that is garbage-collected,
        or still open when its program ends, is closed too.
        """
        _end(*self._parts)
        if not self._board.connection.reported:
            self._board.connection.check()
        self._troubles.report()

    def check(self) -> None:
        """Raise the board's loss, or the first error of a recording or a callback since the last call.

        So does every other call on this hand and the fingers.
        """
        self._latest.report()

    # ---- the stream ----------------------------------------------------------------------------

    def stream(
        self, *names: str, fingers: Fingers = ALL_FINGERS, rest: bool = True, rate_hz: float | None = None
    ) -> None:
        """Choose what the board computes and sends, and start the stream; again, to choose anew.

        Names are force, poc, torque, pressure, touch, events, raw, pdc, temperature, pac, status, and
        ``results``, the default: force, poc, torque and pressure, with pac unless the port is a UART, which is slow.
        Raw counts, pdc and temperature are in every FRAME, so each of them only asks for frames; status is always sent.
        Omitted results are not computed: they are NaN, flagged NOT_ASKED. Quantities that callbacks need are added.

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
        """Stop streaming. Rows on their way have arrived, and are still delivered."""
        self._stream.stop()
        self._latest.report()

    def batches(self, every_s: float | None = None) -> Iterator[Batch]:
        """Yield batches as they arrive, starting the stream if need be; after ``every_s`` without any, an empty one.

        Ends when a simulated source ends, and when ``stop`` is called. All iterations of ``batches`` and ``frames``,
        and ``read``, share one queue of 16 384 rows, 10 to 20 s. Only one thread at a time may use it; another gets
        InputError. It begins with the stream, or, after a callback or a view, with the first batch asked for.
        """
        yield from self._reading.batches(every_s)  # in a generator of the hand's, so that it is not collected meanwhile

    def frames(self) -> Iterator[Frame]:
        """Yield typed frames as they arrive; starts and ends like ``batches``. After a break, the others come next."""
        for batch in self.batches():
            k = 0
            try:
                for k, row in enumerate(batch.frames, 1):  # noqa: B007 (used below)
                    yield Frame.from_row(row)
            except GeneratorExit:
                if k < len(batch.wire):
                    rest = replace(batch, wire=batch.wire[k:], seq=batch.seq[k:], t_us=batch.t_us[k:])
                    self._reading.put_back(rest)
                raise

    def start(self) -> None:
        """Start the stream with the latest choice, unless it runs or the source has ended."""
        self._reading.start()

    def add(self, consumer: Consumer) -> None:
        """Pass everything that arrives from now on to ``consumer`` too, on the reading thread, which must not wait.

        For programs that build on a hand: a Tap gets the bytes as well, and commands are ``hand.board.ask``. Unless the
        stream is being read, no rows are buffered for a first ``read``.
        """
        self._latest.report()
        self._reading.stop_buffering()
        self._reader.add(consumer)

    def remove(self, consumer: Consumer) -> None:
        """Pass nothing more to ``consumer``."""
        self._reader.remove(consumer)

    def rounds(self) -> Rounds:
        """The rounds from now on, for a program that uses each; see ``next_round``."""
        return Rounds(self._reader, self._latest)

    def read(self, seconds: float, *, fresh: bool = False) -> StructArray:
        """Return the frames of the next ``seconds`` of device time as one FRAME_DTYPE array (n,).

        They follow those of the previous read: after a pause they are as old as the pause, as far as the buffers
        reach, and any frame that is missing is counted in ``stats``. With ``fresh``, frames made before this call are
        discarded. A ReadWarning tells of a Gap among them. Where a simulated source or a replay ends first, the array
        is shorter, and empty when it had ended before. It is empty too when no sensor answered in that time. Raises
        ValueError unless seconds is a number above 0.
        """
        batch = self.read_batch(seconds, fresh=fresh)
        for gap in (m for m in batch.messages if isinstance(m, Gap)):
            warnings.warn(gap.line(), ReadWarning, stacklevel=2)
        return batch.frames

    def read_batch(self, seconds: float, *, fresh: bool = False) -> Batch:
        """Like ``read``, but returns the Batch: also the wire messages, PAC, events and Gaps of the same time."""
        return self._reading.read_batch(seconds, fresh)

    def next_round(self, after: Round | None = None, timeout_s: float = 1.0) -> Round:
        """The frames of all fingers of one round and the events up to its end, starting the stream if need be.

        Waits for a round later than ``after``, or, without it, for one that is complete after this call. Returns the
        newest, never one older than ``max_age_s`` (biotac.open), and counts skipped rounds. A loop that passes the last
        round each time gets every event once, however slow it is. A finger that sends heartbeats (``rest=False``) has
        no frame. One thread at a time may call this. Adds events to the stream. Raises TimeoutError when no round comes
        in time, also while a board is away that ``reconnect`` looks for; DeviceLostError when it is lost for good.
        """
        self._reading.stop_buffering()
        if self._rounds is None:
            self._rounds = self.rounds()
        try:
            self._stream.imply(wire.Event)
            self.start()
        except DeviceLostError:
            if self._board.connection.lost is None:  # else it is looked for, and that is no reason to leave a loop
                raise
        return self._rounds.wait(after, timeout_s)

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
        parts = self._board, self._requests, self.board, self._troubles
        recorder = Recorder(*parts, Path(path), overwrite=overwrite)
        self._recorders[:] = [recorder]
        if note or facts:
            recorder.mark(note, None, facts, timed=False)
        return recorder


def _end(board: Board, stream: Stream, watch: StreamWatch, callbacks: Callbacks, recorders: list[Recorder]) -> None:
    """Close a hand's parts; also called when the hand is garbage-collected or the program ends."""
    reader = board.reader
    if reader.connection.is_inherited():
        return
    if threading.current_thread() in THREADS:  # it cannot wait for itself, nor are other hands to wait
        threading.Thread(target=_end, args=(board, stream, watch, callbacks, recorders), name="biotac end").start()
        return
    with board.ending, ExitStack() as last:  # these run even when one of them fails
        if board.connection.given_back:
            return
        last.callback(board.close)
        for recorder in recorders:
            last.callback(recorder.close)
        last.callback(callbacks.close)
        last.callback(watch.close)
        board.connection.close()
        with suppress(DeviceLostError):  # a board that is gone does not stream either
            stream.send_stop()
        board.connection.wake()
