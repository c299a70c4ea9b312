"""One board with its fingers, as users see it: what it is composed of, and its life."""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack
from functools import wraps
from pathlib import Path
from types import TracebackType
from typing import Any, Concatenate, ParamSpec, Protocol, TypeVar

from ..clock import DeviceClock
from ..clock.host_clock import HostClock, SystemClock
from ..errors import InputError
from ..link import Link
from ..wire import messages_gen as wire
from ..wire.batches import Batch, LinkStats
from ..wire.frames import Frame, StructArray
from ..wire.sensor_gen import MAX_SENSORS
from . import compatibility
from .board import Board
from .commands import Commands
from .compatibility import HandWarning
from .gap import GAP
from .pull import take
from .reconnect import Reconnection
from .streams import SILENCE_S, Streams
from .views import FingerView, Latest

P = ParamSpec("P")
R = TypeVar("R")


class Recorder(Protocol):
    """What Hand.record returns: a recording.Recorder, of which nothing else is needed here."""

    path: Path
    paths: list[Path]

    @property
    def closed(self) -> bool: ...
    def write(self, chunk: bytes) -> None: ...
    def mark(self, what: str, facts: dict[str, str]) -> None: ...
    def go_on(self, *board: Any) -> None: ...
    def close(self) -> None: ...


def _of(part: str, method: Callable[Concatenate[Any, P], R]) -> Callable[Concatenate[Hand, P], R]:
    """A method of Hand that is its part's."""

    @wraps(method)
    def call(self: Hand, /, *args: P.args, **kwargs: P.kwargs) -> R:
        return method(getattr(self, part), *args, **kwargs)

    return call


class Hand:
    """A board. Use as a context manager; made by ``biotac.open``."""

    def __init__(
        self,
        link: Link,
        *,
        reconnect: bool = False,
        fingers: Mapping[str, int] | None = None,
        host_clock: HostClock | None = None,
    ) -> None:
        host_clock = host_clock or SystemClock()
        self._latest = Latest(host_clock, fingers)
        self._board = Board(link, host_clock=host_clock)
        self._commands = Commands(self._board, self._latest.names)
        self._streams = Streams(self._board, self._latest)
        if reconnect:
            Reconnection(self._board, self._latest.last_t_us, self._resume)
        self._recorder: Recorder | None = None
        #: What carries the bytes.
        self.link = link
        #: Device time as host time, fed by whatever is read; known after a first ``status`` or ``sync``.
        #: A simulated board's time is no clock: it waits for the computer, which shows as ``resets``.
        self.clock: DeviceClock = self._board.clock

    # ---- what it is ----------------------------------------------------------------------------

    @property
    def port(self) -> str:
        """The PORT this was opened as."""
        return self.link.port

    @property
    def info(self) -> wire.Hello:
        """What the board said of itself when it was opened, or came back."""
        return self._board.info

    @property
    def fingers(self) -> list[int]:
        """Indices of the fingers whose sensor answered when this was opened."""
        return [f for f in range(MAX_SENSORS) if self.info.fingers_present >> f & 1]

    @property
    def warnings(self) -> list[HandWarning]:
        """What speaks against this board and this library together, in words; empty when nothing does."""
        return compatibility.warnings(self.info, self.port)

    @property
    def stats(self) -> LinkStats:
        """Counts since the handshake, over reboots too."""
        return self._streams.stats

    @property
    def connected(self) -> bool:
        """The board can be talked to; false while it is looked for."""
        return self._board.connected

    @property
    def streaming(self) -> bool:
        """The board was told to stream, and has not ended or been stopped."""
        return self._streams.streaming

    @property
    def ended(self) -> bool:
        """A simulated source has played to its end and everything of it has arrived."""
        return self._streams.ended

    def __getitem__(self, finger: str | int) -> FingerView:
        """The latest of one finger, by name or chip select; KeyError in words. Follows what is read: see ``run``."""
        return self._latest[finger]

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

    def close(self) -> None:
        """Stop the stream, finish a recording, give the port back. Safe to call twice.

        Raises CallbackError, after all that, for what a callback has raised and nobody was told yet.
        """
        self._end()
        self._streams.report()

    def _end(self) -> None:
        if self._board.closed:
            return
        with ExitStack() as last:  # whatever fails before
            last.callback(self._board.close)
            if self._recorder is not None:
                last.callback(self._recorder.close)
            self._streams.close()

    # ---- commands (commands.py) ----------------------------------------------------------------

    ping = _of("_commands", Commands.ping)
    status = _of("_commands", Commands.status)
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
    batches = _of("_streams", Streams.batches)
    on_batch = _of("_streams", Streams.on_batch)
    on_touch = _of("_streams", Streams.on_touch)
    on_tare = _of("_streams", Streams.on_tare)
    on_status = _of("_streams", Streams.on_status)
    on_gap = _of("_streams", Streams.on_gap)
    check = _of("_streams", Streams.check)

    def run(self, *, queue: bool = False) -> Hand:
        """Have threads read the board from now on, and let it stream; returns this hand.

        ``hand["index"]`` and callbacks then follow by themselves, the board stops within a second of this
        process's death, and with ``reconnect`` its return is noticed by itself. Batches are kept for ``batches``,
        ``frames`` and ``read`` from their first call on, or from now on with ``queue``; a caller that is slow
        loses the oldest (``stats.batches_skipped``). A simulated board that is not paced waits instead.
        """
        self._streams.run(queue=queue)
        return self

    def frames(self) -> Iterator[Frame]:
        """Yield typed frames as they arrive; ends only with a simulated source."""
        for batch in self.batches():
            for row in batch.frames:
                yield Frame.from_row(row)

    def read(self, seconds: float) -> StructArray:
        """Return the frames of the next ``seconds`` of device time as one FRAME_DTYPE array (n,).

        Shorter when a simulated source ends first; empty when it has ended before, or when no sensor
        answered in that time. Raises ValueError unless seconds is a number above 0.
        """
        return self.read_batch(seconds).frames

    def read_batch(self, seconds: float) -> Batch:
        """Like read, with the wire messages, PAC and events of the same time."""
        batch, later = take(self.batches(), seconds, silence_s=SILENCE_S)
        if later is not None:
            self._streams.put_back(later)
        return batch

    # ---- recording -----------------------------------------------------------------------------

    def record(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Recorder:
        """Write everything that arrives from now on to an MCAP file, until close or the recorder's close.

        Frames that have arrived already and wait to be read are not in it; call it before ``start`` or
        the first read to have all. A board that restarts (reconnect) begins a further file (Recorder.paths).

        Raises InputError when the file exists and may not be overwritten, cannot be written, or when
        another recording of this hand is still open.
        """
        if self._recorder is not None and not self._recorder.closed:
            raise InputError(f"this hand is being recorded to {self._recorder.path}; close that recorder first")
        hello, settings, calibrations, sensors, maps = self._to_be_recorded()
        # The one way up from this room.
        writer = importlib.import_module("...recording.writer", __name__)
        recorder: Recorder = writer.Recorder(
            Path(path),
            hello,
            settings,
            calibrations,
            sensors,
            self.port,
            maps=maps,
            overwrite=overwrite,
            mid_stream=self.streaming,
        )
        self._record_to(recorder)
        return recorder

    def _to_be_recorded(self) -> tuple[Any, ...]:
        """HELLO, settings, calibrations, sensors and maps: what a recording's results rest on."""
        sensors = [self.sensor_info(finger) for finger in self.fingers]
        return self.info, self.settings(), self.calibrations(), sensors, self.maps()

    def _record_to(self, recorder: Recorder) -> None:
        self._recorder = recorder
        self._board.record = recorder.write
        self._board.record_gap = lambda gap: recorder.mark(GAP, gap.as_text())

    def _resume(self, restarted: bool) -> None:
        """The board is back; a restarted one's rows go into a file of their own."""
        if restarted and self._recorder is not None and not self._recorder.closed:
            try:
                self._recorder.go_on(*self._to_be_recorded())
            except (OSError, InputError) as error:
                self._recorder, self._board.record, self._board.trouble = None, None, error
        self._streams.resume()
