"""One board with its fingers: its life and its frames; streaming.py has who reads, commands.py the commands."""

from __future__ import annotations

import os
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING

from ..errors import DeviceLostError, InputError
from ..wire import messages_gen as wire
from ..wire.batches import Batch, join, split
from ..wire.frames import Frame, StructArray
from ..wire.sensor_gen import MAX_SENSORS
from .streams import SILENCE_S, Streaming
from .views import FingerView, finger_index

if TYPE_CHECKING:
    from ..recording.writer import Recorder


class Hand(Streaming):
    """A board. Use as a context manager; made by ``biotac.open``."""

    # ---- life ----------------------------------------------------------------------------------

    @property
    def fingers(self) -> list[int]:
        """Indices of the fingers whose sensor answered when this was opened."""
        return [f for f in range(MAX_SENSORS) if self.info.fingers_present >> f & 1]

    def __getitem__(self, finger: str | int) -> FingerView:
        """The latest of one finger, by name or chip select; KeyError in words. Follows what is read: see ``run``."""
        index = finger_index(self._names, finger)
        names = {number: name for name, number in self._names.items()}
        return FingerView(names.get(index, str(index)), index, self._latest)

    def __repr__(self) -> str:
        return f"<biotac.Hand on {self.port}, fingers {self.fingers}{', closed' if self._closed else ''}>"

    def __enter__(self) -> Hand:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._end()
        if error is None:
            self._report()

    def close(self) -> None:
        """Stop the stream, finish a recording, give the port back. Safe to call twice.

        Raises CallbackError, after all that, for what a callback has raised and nobody was told yet.
        """
        self._end()
        self._report()

    def _end(self) -> None:
        if self._closed:
            return
        self.closing.set()
        self.timing.wake()
        self._tell()
        try:
            if self._streaming and self.connected:
                self._streaming = False
                self._send(wire.Stop(self._next_req_id()))
        except DeviceLostError:
            pass  # it is gone already, which is what closing wants
        finally:
            if self._reader is not None:
                self._reader.join()
            self._closed = True
            try:
                if self._recorder is not None:
                    self._recorder.close()
            finally:
                self.link.close()

    # ---- frames --------------------------------------------------------------------------------

    def batches(self) -> Iterator[Batch]:
        """Yield batches as they arrive, starting the stream if need be.

        Ends with a simulated source, and when ``stop`` is called.
        """
        self._pulled = self._has_pulled = True
        if not self._streaming and not self._ended:
            self.check()
            self.start()
        while True:
            while (batch := self._batches.take()) is not None:
                self.took()
                yield batch
            self.check()
            if self._ended or not self._streaming:
                return
            self._pump_stream()

    def _pump_stream(self) -> None:
        """Wait until there may be a batch."""
        if self._reader is not None and not self._reader.is_here():
            self._wait_for(
                lambda: self._batches.rows or not self._streaming or self._failure or self.closing.is_set(), 1.0
            )
        elif self.link.ended:
            self._finish()
        elif not self._pump(self._silence_s()) and not self.link.ended:
            self._lost(self._silent(), "silence")

    def frames(self) -> Iterator[Frame]:
        """Yield typed frames as they arrive; ends only with a simulated source."""
        for batch in self.batches():
            for k in range(len(batch.frames)):
                yield Frame.from_row(batch.frames[k])

    def read(self, seconds: float) -> StructArray:
        """Return the frames of the next ``seconds`` of device time as one FRAME_DTYPE array (n,).

        Shorter when a simulated source ends first; empty when it has ended before, or when no sensor
        answered in that time. Raises ValueError unless seconds is a number above 0.
        """
        return self.read_batch(seconds).frames

    def read_batch(self, seconds: float) -> Batch:
        """Like read, with the wire messages, PAC and events of the same time."""
        if not 0 < seconds < float("inf"):
            raise ValueError(f"seconds is {seconds}, expected a number above 0")
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
            taken.append(now)
            self._batches.put_back(later)
            break
        return join(taken)

    def record(self, path: str | os.PathLike[str], *, overwrite: bool = False) -> Recorder:
        """Write everything that arrives from now on to an MCAP file, until close or the recorder's close.

        Frames that have arrived already and wait to be read are not in it; call it before ``start`` or
        the first read to have all. A board that restarts (reconnect) begins a further file (Recorder.paths).

        Raises InputError when the file exists and may not be overwritten, cannot be written, or when
        another recording of this hand is still open.
        """
        from ..recording.writer import Recorder

        if self._recorder is not None and not self._recorder.closed:
            raise InputError(f"this hand is being recorded to {self._recorder.path}; close that recorder first")
        settings, calibrations, sensors, maps = self._to_be_recorded()
        self._recorder = Recorder(
            Path(path),
            self.info,
            settings,
            calibrations,
            sensors,
            self.port,
            maps=maps,
            overwrite=overwrite,
            mid_stream=self._streaming,
        )
        return self._recorder
