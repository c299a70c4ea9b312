"""A board with rounds from another driver's messages: ``bag:``, ``csv:`` and ``foxglove://``.

The firmware's session runs on a thread of this process (host/binding/sbc.c), as it does on a bus. Device time is that
of the messages' stamps, from the first one on. A file's waits for the reader; a live one goes on with this computer's
between two messages.
"""

from __future__ import annotations

import secrets
import time
from collections.abc import Iterator
from typing import Protocol

import numpy as np

from ...errors import PortError
from ...link.in_process import OUTBOX_BYTES, InProcessLink
from ...wire.identity import SENSOR_SERIAL_BYTES
from ...wire.native import ffi, lib
from .message import Message, RefusedError
from .rate import ROUND_US, SILENCE_US
from .stamps import MessageStamps, by_header, timed
from .words import EMPTY, RoundMaker, WordRound

LIVE_SILENCE_US = 250_000  # on a network, messages may also be late
POLL_S = 0.01
STOOD_S = 0.3  # without a look at the bridge, which is polled every few ms
SPEAKS_S = 5.0  # at most, on a computer that is busy: a streaming host speaks every third of a second
# Messages that show a source's rate and fingers: the first of a topic, or the beginning of a file.
PREVIEW, FILE_PREVIEW, PREVIEW_S = 50, 400, 10.0


class MessageSource(Protocol):
    """The origin of messages: iterating yields each, or the RefusedError of one that is not a BioTac's.

    A live source yields None while nothing has come, and a str as news for the user. It raises when it ends, and begins
    anew when it is iterated again.
    """

    live: bool

    def __iter__(self) -> Iterator[Message | RefusedError | str | None]: ...


class MessagesLink(InProcessLink):
    """A Link to the board that gets ``source``'s rounds."""

    def __init__(self, port: str, source: MessageSource) -> None:
        super().__init__(port)
        self._source = source
        self.pace, self.keeps_time = float(source.live), source.live
        self._held = True
        first = self._preview()
        self._is_header = by_header(first)
        first = [m for m in (timed(m, self._is_header) for m in first) if m.stamp_ns or m.logged_ns is None]
        self._rounds = RoundMaker(port, first)
        self._seen = self._stamps = self._new_stamps(first[0].stamp_ns if source.live else None)
        if not source.live:
            self._look_at(first)
        self._gaps: list[tuple[int, int]] = []  # how long, and when, by the stamps
        self._now_us, self._last_us, self._last_s = 0, -ROUND_US, time.monotonic()
        self._announced: dict[int, tuple[bytes, bool]] = {}  # to the board, of each finger's sensor
        self.begin(lib.bt_sbc_new(self._handle, 0, self._rounds.timed, secrets.randbits(32)))

    @property
    def zero_ns(self) -> int:
        """See Link; of this wrap of the wire's 32 bits."""
        return (self._stamps.begin_ns or 0) + (self._now_us >> 32 << 32) * 1000

    @property
    def notes(self) -> list[str]:
        notes = [*self._rounds.notes, *self._early, *self._seen.notes, *self._seen.tally.lines()]
        if not self._gaps:
            return notes
        long_us, at_us = max(self._gaps)
        longest = f"the longest {long_us / 1e6:.2f} s, {at_us / 1e6:.2f} s after the first message"
        return [*notes, f"{len(self._gaps)} gap(s) of more than {SILENCE_US / 1e6:.2f} s, {longest}"]

    def _preview(self) -> list[Message]:
        first: list[Message] = []
        self._early: list[str] = []
        enough, refused, why = PREVIEW if self._source.live else FILE_PREVIEW, 0, "none came"
        deadline_s = time.monotonic() + PREVIEW_S
        self._messages: Iterator[Message | RefusedError | str | None] = iter(self._source)
        for message in self._messages:
            if isinstance(message, Message):
                first.append(message)
            elif isinstance(message, str):
                self._early.append(message)
            elif message is not None:
                refused, why = refused + 1, str(message)
            if len(first) >= enough or refused > enough or time.monotonic() > deadline_s:
                break
        if len(first) < 2:
            raise PortError(f"{self.port}: no messages of a BioTac: {why}; expected some within {PREVIEW_S:.0f} s")
        return first

    def _new_stamps(self, begin_ns: int | None) -> MessageStamps:
        return MessageStamps(self.port, self._rounds.rate, self._is_header, begin_ns, self._source.live)

    def _look_at(self, first: list[Message]) -> None:
        """Of a file, all is known before the first round."""
        self._rounds.look_at(self._seen.all(self._source))
        known = self._rounds.positions.order
        if known != sorted(known):  # one came late that is another finger than the next
            self._rounds, self._seen = RoundMaker(self.port, first, known), self._new_stamps(None)
            self._rounds.look_at(self._seen.all(self._source))
        self._stamps = self._new_stamps(self._seen.begin_ns)
        self._messages = self._stamps.all(self._source)

    def release(self) -> None:
        self._held = False

    def close(self) -> None:
        super().close()
        self._messages = iter(())  # closes the file or the connection

    def ports(self) -> list[str]:
        return [self.port] if self._source.live else []

    def reopen(self, port: str) -> None:
        self._thread.join()
        self._messages = iter(self._source)
        self._accept(next(self._messages))  # raises when it is not there
        self._failure = None
        self._start()

    # ---- the board's thread ----------------------------------------------------------------------

    def _us(self) -> int:
        return self._now_us

    def _run(self) -> None:
        try:
            if not self._announced:
                lib.bt_sbc_start(self._board)
                self._announce_sensors()
            while not self._closing and self._failure is None:
                lib.bt_sbc_poll(self._board)
                if self._source.live:
                    self._live()
                elif self._held or self.ended or len(self._outbox) > OUTBOX_BYTES // 4:
                    with self._changed:
                        self._changed.wait(POLL_S)
                else:
                    message = next(self._messages, None)
                    self.ended = message is None
                    if isinstance(message, Message):
                        self._add(message)
        except Exception as error:  # as of a network, or unforeseen: the host gets it
            self._fail(error)

    def _live(self) -> None:
        message = next(self._messages)
        now_s = time.monotonic()
        if now_s - self._polled_s > STOOD_S:  # the host stood still too: let it speak before device time goes on
            with self._changed:
                self._changed.wait_for(lambda: self._inbox or self._closing, SPEAKS_S)
        self._polled_s = time.monotonic()
        # Until then, not until now: a stop in between is seen by the next look.
        since_us = int((now_s - self._last_s) * 1e6)
        self._now_us = max(self._now_us, self._last_us + since_us)
        self._accept(message)
        if message is None and since_us > LIVE_SILENCE_US:
            self._fall_silent()

    def _accept(self, message: Message | RefusedError | str | None) -> None:
        for own in self._stamps.feed(message):
            self._add(own)

    def _add(self, message: Message) -> None:
        t_us = message.stamp_ns // 1000
        round_ = self._rounds.add(message)
        if round_ is None:
            return
        if self._last_us >= 0 and t_us - self._last_us > SILENCE_US:
            self._gaps.append((t_us - self._last_us, self._last_us))
            self._fall_silent()
        self._announce_sensors()
        self._put(t_us, round_)
        self._silent = False
        self._last_us, self._last_s = t_us, time.monotonic()
        self._now_us = max(self._now_us, t_us if self._source.live else t_us + ROUND_US)

    _silent, _polled_s = True, float("inf")

    def _fall_silent(self) -> None:
        """A round without a word, so that readers learn that the sensors are away."""
        if not self._silent:
            self._silent = True
            self._put(self._last_us + int(self._rounds.period_us) // 2, EMPTY)

    def _put(self, t_us: int, round_: WordRound) -> None:
        words, slot_us, sp = map(np.ascontiguousarray, (round_.words, round_.slot_us, round_.sp))
        words_at, sp_at = (ffi.from_buffer("uint16_t[]", array) for array in (words, sp))
        slots_at = ffi.from_buffer("uint32_t[]", slot_us)
        lib.bt_sbc_round(self._board, t_us % 2**32, slots_at, words_at, round_.sp_fingers, sp_at)

    def _announce_sensors(self) -> None:
        for f, check in self._rounds.checks.items():
            now = self._rounds.serials[f], bool(check.foreign)
            if self._announced.get(f) != now:
                self._announced[f] = now
                lib.bt_sbc_sensor(self._board, f, now[0].ljust(SENSOR_SERIAL_BYTES, b"\0"), now[1])
