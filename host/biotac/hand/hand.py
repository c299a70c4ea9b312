"""Hand: one board with its fingers, as users see it, composed of the parts in this folder."""

from __future__ import annotations

import os
import threading
import weakref
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, suppress
from functools import partial, wraps
from pathlib import Path
from types import TracebackType
from typing import Any, Concatenate, NoReturn, ParamSpec, SupportsIndex, TypeVar, cast

from ..clock import DeviceClock
from ..clock.host_clock import HostClock, SystemClock
from ..link import Link
from ..wire import messages_gen as wire
from ..wire.batches import Batch, LinkStats
from ..wire.frames import Frame, StructArray
from ..wire.sensor_gen import MAX_SENSORS
from . import compatibility
from .board import Board
from .commands import Commands
from .compatibility import HandWarning
from .keepalive import SILENCE_S
from .pull import take
from .reconnect import Reconnection
from .record import Recorded, Recorder
from .streams import Streams
from .views import FingerView, Latest, checked_names, finger_index

P = ParamSpec("P")
R = TypeVar("R")


def _of(part: str, method: Callable[Concatenate[Any, P], R]) -> Callable[Concatenate[Hand, P], R]:
    """A method of Hand that calls the same method of one of its parts."""

    @wraps(method)
    def call(self: Hand, /, *args: P.args, **kwargs: P.kwargs) -> R:
        return method(getattr(self, part), *args, **kwargs)

    return call


class Hand:
    """A board with its fingers. Made by ``biotac.open``; use it as a context manager."""

    def __init__(
        self,
        link: Link,
        *,
        reconnect: bool = False,
        fingers: Mapping[str, int] | None = None,
        host_clock: HostClock | None = None,
    ) -> None:
        host_clock = host_clock or SystemClock()
        names = checked_names(fingers)
        self._board = Board(link, host_clock=host_clock)
        self._latest = Latest(host_clock, names, device_clock=self._board.incoming.clock)
        self._latest.is_away = self._board.is_away
        self._commands = Commands(self._board, self._latest.names)
        self._streams = Streams(self._board, self._latest)
        self._recorded = Recorded(self._board, self._commands, self._latest.names)
        if reconnect:
            Reconnection(self._board, self._latest.last_t_us, partial(_resume, self._recorded, self._streams))
        # Neither the parts nor their threads refer to this object, so that it can be garbage-collected.
        self._finalizer = weakref.finalize(self, _end, self._board, self._streams, self._recorded)
        _HANDS.add(self)
        #: The link that carries the bytes.
        self.link = link
        #: Converts device time to host time, fed by whatever is read; known after a first ``status`` or ``sync``.
        #: A simulated board's time is not a real clock: it waits for the computer, which shows up as ``resets``.
        self.clock: DeviceClock = self._board.incoming.clock

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
        return compatibility.warnings(self.info, self.port)

    @property
    def stats(self) -> LinkStats:
        """Counts since the handshake, over reboots too."""
        return self._streams.stats

    @property
    def connected(self) -> bool:
        """Whether the board can be reached; false while reconnecting, once it is lost, and after ``close``."""
        return self._board.connected

    @property
    def streaming(self) -> bool:
        """Whether the board was told to stream, and has neither ended nor been stopped."""
        return self._streams.streaming

    @property
    def ended(self) -> bool:
        """Whether a simulated source has played to its end and all of it has arrived."""
        return self._streams.ended

    def __getitem__(self, finger: str | SupportsIndex) -> FingerView:
        """The latest values of one finger, by name or chip select. They follow what is read: see ``run``.

        Raises KeyError when there is no such finger.
        """
        return FingerView((its := self._latest[finger]).name, its.finger, self._latest, self)

    def __iter__(self) -> Iterator[str]:
        """Names of the fingers whose sensor answered; a chip select without a name is given as text."""
        return iter([self._latest.name(finger) for finger in self.fingers])

    def __len__(self) -> int:
        """How many fingers' sensors answered."""
        return len(self.fingers)

    def __bool__(self) -> bool:
        return True

    def __contains__(self, finger: object) -> bool:
        """Whether the sensor with that name or chip select answered."""
        with suppress(KeyError):
            return finger_index(self._latest.names, cast(Any, finger)) in self.fingers
        return False

    def __repr__(self) -> str:
        return f"<biotac.Hand on {self.port}, fingers {self.fingers}{', closed' if self._board.closed else ''}>"

    # ---- life ----------------------------------------------------------------------------------

    def __enter__(self) -> Hand:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._end()
        if error is None:
            self._streams.report()

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
        self._streams.report()

    def _end(self) -> None:
        _end(self._board, self._streams, self._recorded)

    def _forked(self) -> None:
        """This process is a child of the one that opened the board."""
        self._board.forked()
        self._recorded.forked()
        self._latest.forked()

    # ---- commands (commands.py) ----------------------------------------------------------------

    ping = _of("_commands", Commands.ping)
    status = _of("_commands", Commands.status)
    faults = _of("_commands", Commands.faults)
    clear_faults = _of("_commands", Commands.clear_faults)
    sync = _of("_commands", Commands.sync)
    sensor_status = _of("_commands", Commands.sensor_status)
    sensor_info = _of("_commands", Commands.sensor_info)
    point = _of("_commands", Commands.point)
    tare = _of("_commands", Commands.tare)
    set_tare = _of("_commands", Commands.set_tare)
    hold = _of("_commands", Commands.hold)
    release = _of("_commands", Commands.release)
    grasp = _of("_commands", Commands.grasp)
    setting = _of("_commands", Commands.setting)
    set_setting = _of("_commands", Commands.set_setting)
    settings = _of("_commands", Commands.settings)
    save_settings = _of("_commands", Commands.save_settings)
    calibration = _of("_commands", Commands.calibration)
    calibration_state = _of("_commands", Commands.calibration_state)
    set_calibration = _of("_commands", Commands.set_calibration)
    clear_calibration = _of("_commands", Commands.clear_calibration)
    calibrations = _of("_commands", Commands.calibrations)
    finger_settings = _of("_commands", Commands.finger_settings)
    get_map = _of("_commands", Commands.get_map)
    map_state = _of("_commands", Commands.map_state)
    set_map = _of("_commands", Commands.set_map)
    clear_map = _of("_commands", Commands.clear_map)
    maps = _of("_commands", Commands.maps)
    reboot_bootloader = _of("_commands", Commands.reboot_bootloader)

    # ---- streams (streams.py) ------------------------------------------------------------------

    start = _of("_streams", Streams.start)
    stop = _of("_streams", Streams.stop)
    subscribe = _of("_streams", Streams.subscribe)
    want = _of("_streams", Streams.want)
    on_batch = _of("_streams", Streams.on_batch)
    on_touch = _of("_streams", Streams.on_touch)
    on_event = _of("_streams", Streams.on_event)
    on_slip = _of("_streams", Streams.on_slip)
    on_bands = _of("_streams", Streams.on_bands)
    on_tare = _of("_streams", Streams.on_tare)
    on_status = _of("_streams", Streams.on_status)
    on_gap = _of("_streams", Streams.on_gap)
    check = _of("_streams", Streams.check)

    def run(self, *, queue: bool = False) -> Hand:
        """Read the board in threads from now on, and start the stream if need be; returns this hand.

        ``hand["index"]`` and callbacks then follow without further calls, and with ``reconnect`` so does the return of
        a lost board. The board stops within a second of this process's death. Batches are kept for ``batches``,
        ``frames`` and ``read`` from their first call on, or from now on with ``queue``. A slow caller loses the oldest
        (``stats.batches_skipped``); a simulated board that is not paced waits instead.
        """
        self._streams.run(queue=queue)
        return self

    def batches(self) -> Iterator[Batch]:
        """Yield batches as they arrive, starting the stream if need be.

        Ends when a simulated source ends, and when ``stop`` is called. All iterations of ``batches`` and ``frames``,
        and ``read``, share one queue. Only one thread at a time may use it; another gets InputError.
        """
        yield from self._streams.batches()  # a generator here, so that this hand lives as long as its iteration

    def frames(self) -> Iterator[Frame]:
        """Yield typed frames as they arrive; starts and ends like ``batches``."""
        for batch in self.batches():
            for row in batch.frames:
                yield Frame.from_row(row)

    def read(self, seconds: float, *, fresh: bool = False) -> StructArray:
        """Return the frames of the next ``seconds`` of device time as one FRAME_DTYPE array (n,).

        They follow those of the previous read: after a pause they are as old as the pause, as far as the buffers
        reach, and any frame that is missing is counted in ``stats``. With ``fresh``, frames made before this call are
        discarded. The array is shorter when a simulated source ends first, and empty when it had ended before or when
        no sensor answered in that time. Raises ValueError unless seconds is a number above 0.
        """
        return self.read_batch(seconds, fresh=fresh).frames

    def read_batch(self, seconds: float, *, fresh: bool = False) -> Batch:
        """Like ``read``, but returns the Batch: also the wire messages, PAC and events of the same time."""
        if fresh:
            self._streams.skip_old()
        batch, later = take(self.batches(), seconds, silence_s=SILENCE_S)
        if later is not None:
            self._streams.put_back(later)
        return batch

    # ---- recording -----------------------------------------------------------------------------

    def record(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Recorder:
        """Write everything that arrives from now on to an MCAP file, until this hand or the recorder is closed.

        Frames that have arrived but not been read yet are not recorded; to have all, call this before ``start`` or the
        first read. When the board restarts (``reconnect``), a new file is begun (``Recorder.paths``). A program that
        ends without ``close`` loses nothing that has arrived; one that is killed loses up to a second.

        Raises InputError when the file exists and ``overwrite`` is false, when it cannot be written, or when another
        recording of this hand is still open.
        """
        return self._recorded.record(Path(path), self.streaming, overwrite=overwrite)


def _resume(recorded: Recorded, streams: Streams, restarted: bool) -> None:
    """Go on recording and streaming after the board came back."""
    if restarted:
        recorded.go_on()
    streams.resume()


def _end(board: Board, streams: Streams, recorded: Recorded) -> None:
    """Close a hand's parts; also called when the hand is garbage-collected or the program ends."""
    if board.closed:
        return
    if streams.is_read_here():  # the garbage collector may run on a reading thread, which cannot wait for itself
        threading.Thread(target=_end, args=(board, streams, recorded), name="biotac end").start()
        return
    with ExitStack() as last:  # these run even when streams.close() fails
        last.callback(board.close)
        last.callback(recorded.close)
        streams.close()


_HANDS: weakref.WeakSet[Hand] = weakref.WeakSet()


def _forked() -> None:
    for hand in list(_HANDS):
        hand._forked()


if hasattr(os, "register_at_fork"):
    os.register_at_fork(after_in_child=_forked)
