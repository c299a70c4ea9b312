"""A program's wants from the board: by name, as the flags of SUBSCRIBE and START, and as the board was told."""

from __future__ import annotations

from dataclasses import dataclass

from ..errors import CommandRefusedError, InputError
from ..wire.messages_gen import Error, Event, QuantityFlags, Start, Stop, StreamFlags, Subscribe, Touch
from ..wire.sensor_gen import MAX_SENSORS
from ..wire.slots import FRAME_HZ
from . import bandwidth
from .board import Board

#: The results of a FRAME with a contact.
RESULTS = QuantityFlags.POC | QuantityFlags.FORCE | QuantityFlags.TORQUE | QuantityFlags.PRESSURE
ALL_FINGERS = (1 << MAX_SENSORS) - 1
# A board stops streaming this long after the last packet of the host.
KEEPALIVE_S = 1.0

QUANTITIES = {
    "results": RESULTS,
    "force": QuantityFlags.FORCE,
    "poc": QuantityFlags.POC,
    "torque": QuantityFlags.TORQUE,
    "pressure": QuantityFlags.PRESSURE,
    "touch": QuantityFlags.TOUCH,
    "events": QuantityFlags.EVENTS,
}
IN_EVERY_FRAME = ("raw", "pdc", "temperature")
STREAMS = {"pac": StreamFlags.PAC, "status": StreamFlags.STATUS}
NAMES = (*QUANTITIES, *IN_EVERY_FRAME, *STREAMS)
# Messages that a board sends only on demand, by the name of their quantity or stream.
CARRIED_BY = {Touch: "touch", Event: "events"}


@dataclass(frozen=True, slots=True)
class Wants:
    """Flags for the board; this side keeps one of ``every`` frames."""

    quantities: QuantityFlags
    streams: StreamFlags
    fingers: int
    every: int

    @classmethod
    def named(cls, names: tuple[str, ...] = (), *, fingers: int = ALL_FINGERS, rest: bool = True,
              rate_hz: float | None = None, has_room: bool) -> Wants:  # fmt: skip
        """The flags for ``names``; for none, "results", with PAC where the line ``has_room``.

        Raises InputError for an unknown name, or a rate out of range.
        """
        for name in names:
            if name not in NAMES:
                raise InputError(f"unknown name {name!r}; expected some of {', '.join(NAMES)}")
        if rate_hz is not None and not 0 < rate_hz <= FRAME_HZ:
            raise InputError(f"rate_hz is {rate_hz}, expected above 0 and at most {FRAME_HZ:g}, the board's rate")
        quantities = QuantityFlags.REST_FRAMES if rest else QuantityFlags(0)
        # Status is the link's sign of life: without it, a hand without sensors would look dead.
        wants = cls(quantities, StreamFlags.STATUS, fingers, 1 if rate_hz is None else round(FRAME_HZ / rate_hz))
        for name in names or ("results",):
            wants = wants.plus(name)
            if name == "results" and has_room:
                wants = wants.plus("pac")
        return wants

    def plus(self, name: str) -> Wants:
        """These, and the quantity or stream ``name``; a FRAME carries all that is no stream."""
        streams = self.streams | STREAMS.get(name, StreamFlags.FRAMES)
        return Wants(self.quantities | QUANTITIES.get(name, QuantityFlags(0)), streams, self.fingers, self.every)


class Stream:
    """The board's stream: the START that it was sent, and whether it follows."""

    def __init__(self, board: Board) -> None:
        self._board = board
        self._has_room = board.link.bits_per_s is None
        self._wants = Wants.named(has_room=self._has_room)
        self._quantities = self._wants.quantities  # of the board's latest SUBSCRIBE or START
        self._implied: dict[str, None] = {}  # by callbacks, in order

    @property
    def started(self) -> Start | None:
        """The last START; None before the first, after a STOP, and once the source has ended."""
        return self._board.connection.started

    @property
    def on(self) -> bool:
        """Whether the board was told to stream, and has neither ended nor been stopped."""
        return self.started is not None

    def start(self, names: tuple[str, ...], *, fingers: int, rest: bool, rate_hz: float | None) -> None:
        """See Hand.stream."""
        self._send(Wants.named(names, fingers=fingers, rest=rest, rate_hz=rate_hz, has_room=self._has_room))

    def ensure_started(self) -> None:
        """Start the stream with the latest choice, unless it runs or the source has ended."""
        if not (self.on or self._board.connection.played):
            self._send(self._wants)

    def imply(self, kind: type) -> None:
        """Add the stream with messages of this kind, which a callback needs."""
        name = CARRIED_BY.get(kind)
        if name is not None and name not in self._implied:
            self._implied[name] = None
            if self.on:
                self._send(self._wants)

    def _send(self, wants: Wants) -> None:
        board, link = self._board, self._board.link
        asked = wants
        for name in self._implied:
            asked = asked.plus(name)
        present = asked.fingers & board.info.fingers_present
        if link.bits_per_s is not None:
            bandwidth.check(link.port, link.bits_per_s, asked.streams, present.bit_count())
        with board.turn():
            self._quantities = asked.quantities
            self._subscribe()
            start = Start(0, int(asked.streams), asked.fingers, self.keepalive_ms())
            board.command(start)
            self._wants = wants
            board.connection.streams(start)
            board.reader.thin_to(asked.every)
        board.connection.wake()
        link.release()

    def _subscribe(self) -> None:
        try:
            self._board.command(Subscribe(0, ALL_FINGERS, int(self._quantities)))
        except CommandRefusedError as error:
            # A recording, and a board that somebody else streams, have the quantities that were chosen there.
            if self._board.link.owns_stream and error.error != Error.NOT_HERE:
                raise

    def keepalive_ms(self) -> int:
        """After how long a silence of this side the board stops; 0: never."""
        # In device time, which may run fast on a simulated board. An unpaced one needs no keep-alive.
        pace = self._board.link.pace
        return 0 if pace == 0 else min(0xFFFF, round(1000 * KEEPALIVE_S * max(1.0, pace)))

    def resume(self) -> None:
        """Make a board that stopped stream again, if it did before.

        A board forgets subscriptions at a HELLO while it does not stream, also at the one that looks for a restart.
        """
        with self._board.turn():
            if self.started is not None:
                self._subscribe()
                self._board.command(self.started)

    def stop(self) -> None:
        """Stop the stream. Rows on their way have arrived when this returns."""
        with self._board.turn():
            self._board.connection.streams(None)
            self._board.command(Stop(0))
            self._board.reader.gaps.forget()
        self._board.connection.wake()

    def send_stop(self) -> None:
        """Tell the board to stop, without waiting for the answer."""
        connection = self._board.connection
        if self.on and connection.lost is None and connection.failure is None:
            connection.streams(None)
            self._board.send(Stop(0))
