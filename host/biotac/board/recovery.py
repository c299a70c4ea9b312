"""Monitors a board's stream: keeps it alive, finds out when it has stopped, starts it again, reconnects.

A thread asks the board every third of a second which streams are on. The question prevents the board from stopping;
the answer feeds the clock, and is compared with the latest START: replies alone do not prove that the stream lives. An
unpaced board is not asked.
"""

from __future__ import annotations

import functools
import operator
import secrets
from collections.abc import Callable
from contextlib import suppress

from ..errors import CommandRefusedError, DeviceLostError, NotAGatewayError, PortError, StreamTakenError
from ..wire import messages_gen as wire
from .board import Board
from .connection import State
from .gap import Reason
from .stream import KEEPALIVE_S, Stream

LOOK_S = KEEPALIVE_S / 3
RETRY_S = 0.25
# This many looks without rows from a finger that is there, and the stream has stopped.
LOOKS_WITHOUT_ROWS = 3
STAYS_SILENT = "{} answers, but its stream stays silent; look for the cause with `biotac doctor`"
ROWS = functools.reduce(operator.or_, (wire.STREAMS_OF[message] for message in wire.EVERY_ROUND))
# Of a board that is not asked, times the link's patience.
SILENCE_S = 3.0


class StreamWatch:
    """Monitors ``stream`` of ``board``; where it reconnects, also brings back a board that was lost."""

    def __init__(self, board: Board, stream: Stream, *, tares: Callable[[], list[wire.TareSet]] = list) -> None:
        self._tares = tares
        self._board = board
        self._reader = board.reader
        self._stream = stream
        self._started: wire.Start | None = None  # the stream that was looked at last
        self._answered_us: int | None = None  # the board's time at the last look; None before the first after a START
        # At the last look; looks without rows since, and how often the stream was started again for that.
        self._rows = self._idle = self._faults = self._looks = self._restarts = 0
        self._thread = self._reader.connection.thread(self._run, "stream watch")
        self.start = self._thread.start

    def close(self) -> None:
        """Wait for the thread to end; the reader is closing."""
        self._board.host_clock.wake()
        self._reader.connection.wake()
        if self._thread.ident is not None:
            self._thread.join()

    def _run(self) -> None:
        reader, connection = self._reader, self._reader.connection
        try:
            while not connection.closed:
                try:
                    self._step()
                except DeviceLostError as error:
                    if not connection.closing:  # with a cause: the link's own error
                        connection.lose(error, "unplugged" if error.__cause__ else "silence")
                reader.connection.wait_for(self._is_due, LOOK_S)
        except BaseException as error:  # unforeseen errors too: without the keep-alive the stream would stop unseen
            reader.connection.fail(error)

    def _step(self) -> None:
        reader, stream, link = self._reader, self._stream, self._board.link
        if reader.connection.lost is not None:
            self._bring_back()
        elif stream.on and link.ended:
            self._board.command(wire.Ping(0))  # a barrier: the reply comes after the last frame
            reader.connection.play_out()
        elif stream.on and link.pace:
            self._look()
        elif stream.on and not link.lock_step and reader.silent_s > SILENCE_S * link.patience:
            raise DeviceLostError(f"{link.port} has been silent for {reader.silent_s:.0f} s while streaming")

    def _is_due(self) -> bool:
        reader, stream, link = self._reader, self._stream, self._board.link
        if reader.connection.state in (State.LOST, State.CLOSED):
            return True
        return stream.on and (link.ended or (link.pace != 0 and stream.started is not self._started))

    # ---- does it stream? -----------------------------------------------------------------------

    def _look(self) -> None:
        board = self._board
        with board.turn():  # so that no START or STOP gets in between
            started = self._stream.started
            if started is None or self._reader.connection.lost is not None:
                return
            is_new, self._started = started is not self._started, started
            try:
                status = board.ask(wire.GetStatus(0), wire.Status, timeout_s=LOOK_S * board.link.patience, quiet=True)
            except CommandRefusedError:
                return  # a recording that has no STATUS yet
            if is_new:
                self._looks, self._restarts, self._answered_us = 0, 0, None
                if self._has_restarted():  # while nothing streamed, so that nobody looked
                    return
            self._repeat_release()
            if board.link.owns_stream or board.link.keeps_time:  # a recording has other pauses
                self._check_stream(started, status)
            self._rows, self._idle, self._faults = self._reader.rows, status.frames_idle, status.faults
            self._answered_us = status.t_us

    def _repeat_release(self) -> None:
        with suppress(CommandRefusedError):  # a recording has no HOLD to end
            self._board.release()

    def _check_stream(self, started: wire.Start, status: wire.Status) -> None:
        if self._stream.started is not started:
            return  # it is being closed
        if self._board.link.owns_stream and status.streams != started.streams:
            self._stopped(started, status)
        elif not (started.fingers & status.fingers_present and started.streams & status.streams & ROWS):
            self._looks = 0  # no rows are due
        elif self._reader.rows != self._rows or status.frames_idle != self._idle:
            self._looks = self._restarts = 0
        else:
            self._looks += 1
            if self._looks >= LOOKS_WITHOUT_ROWS:
                self._restarts += 1
                if self._restarts > 1:
                    self._reader.connection.lose(DeviceLostError(STAYS_SILENT.format(self._board.link.port)), "silence")
                else:
                    self._start_again("silence")

    def _stopped(self, started: wire.Start, status: wire.Status) -> None:
        """The board answers, but sends no stream."""
        if self._has_restarted():
            return
        if status.faults & ~self._faults & wire.FaultFlags.HOST_SILENT or self._may_have_been_silent(started, status):
            self._start_again("paused")
        else:
            self._reader.connection.fail(
                StreamTakenError(
                    f"another program, or the board's other port, took the stream of {self._board.link.port}; end that "
                    "program and open the port again"
                )
            )

    def _may_have_been_silent(self, started: wire.Start, status: wire.Status) -> bool:
        """Whether the board may have heard nothing for a keep-alive time since the last look.

        By the board's clock: this computer's stands still in sleep, and a simulated board's goes in jumps. The
        answer is a little younger than the hearing of the question, hence a tenth.
        """
        if self._answered_us is None:
            return True
        return (status.t_us - self._answered_us) % 2**32 >= 900 * started.keepalive_ms

    def _has_restarted(self) -> bool:
        hello = self._board.ask(wire.HelloRequest(0, secrets.randbits(32)), wire.Hello, quiet=True)
        if hello.boot_id == self._reader.hello.boot_id:
            return False
        self._reader.connection.lose(DeviceLostError(f"{self._board.link.port} restarted; open it again"), "rebooted")
        return True

    def _start_again(self, reason: Reason) -> None:
        self._looks = 0
        self._reader.gaps.begin(reason)
        self._stream.resume()

    # ---- a board that was lost -----------------------------------------------------------------

    def _bring_back(self) -> None:
        reader, board = self._reader, self._board
        reader.connection.wait_until_parked()
        while (reason := self._found()) is None:
            if reader.connection.closing:
                return
            board.host_clock.sleep(RETRY_S)
        with board.turn():  # other threads' commands are about the board as it was
            board.restore()
            # Whatever the boot, as HOLD outlives a watchdog's reset; before the tares, which RELEASE would call likely.
            self._repeat_release()
            for tare in self._tares() if reason == "rebooted" else []:
                with suppress(CommandRefusedError):  # the sensor's counts are bad: it is untared without it, too
                    state = board.ask(wire.GetSensorStatus(0, tare.finger), wire.SensorStatus)
                    if state.tare_reason != wire.TareReason.RESTORED:  # else the board kept it over a hang
                        board.command(tare)
            self._stream.resume()
            self._answered_us = None
            self._started = None  # look at once: until a STATUS has come, no row has an age

    def _found(self) -> Reason | None:
        """Why the board was away, once it is back and read again."""
        board = self._board
        for port in board.link.ports():
            try:
                board.reopen(port)
                hello = board.handshake()
            except (PortError, DeviceLostError, NotAGatewayError):
                continue
            if hello.board_serial == self._reader.hello.board_serial:
                return self._reader.resume(hello)
        return None
