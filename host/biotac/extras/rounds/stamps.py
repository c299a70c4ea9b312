"""Device times of messages by their stamps, and a count of the messages that have none or never came."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from ...errors import InputError
from .message import Message, RefusedError
from .rate import ROUND_US, Rate
from .tally import Tally

AHEAD_US = 3600 * 10**6  # a stamp that is so much later is none
ANCHOR_AGAIN = 5  # wrong stamps in a row, one after the other: the clock was set
WRONG = "its stamp is not after the one before, or more than an hour, or later than the next one's"


def by_header(first: list[Message]) -> bool:
    """Whether messages have stamps of their own. If not, the times at which they were logged are used."""
    return any(message.stamp_ns or message.logged_ns is None for message in first)


def timed(message: Message, is_header: bool) -> Message:
    """With the stamp that counts, 0 where there is none."""
    return message if is_header or message.logged_ns is None else replace(message, stamp_ns=message.logged_ns)


class MessageStamps:
    """Yields a source's messages with device time as stamp. ``begin_ns``: the stamp of device time 0, None before that.

    A file's messages are each held until the next is there: a single stamp that is ahead makes no hole. A file with a
    rate that changes is refused.
    """

    def __init__(self, port: str, rate: Rate, is_header: bool, begin_ns: int | None = None, live: bool = False) -> None:
        self.tally = Tally()
        self.notes: list[str] = []
        self.begin_ns = self._zero_ns = begin_ns
        self._port, self._rate, self._is_header, self._live = port, rate, is_header, live
        self._rate_change, self._is_changed = rate.change(), False
        self._last_us, self._last_ns = -int(rate.step_us), -1
        self._wrong, self._wrong_ns = 0, 0
        self._held: Message | None = None

    def all(self, messages: Iterable[Message | RefusedError | str | None]) -> Iterator[Message]:
        """Of a file."""
        for message in messages:
            yield from self.feed(message)
        if self._held is not None:
            yield from self._timed(self._held)

    def feed(self, message: Message | RefusedError | str | None) -> Iterator[Message]:
        if isinstance(message, str) and message not in self.notes:
            self.notes.append(message)
        elif isinstance(message, RefusedError):
            self.tally.add("refused", str(message))
        elif isinstance(message, Message):
            message = timed(message, self._is_header)
            if message.stamp_ns == 0 and message.logged_ns is not None:
                self.tally.add("refused", "its stamp is 0, those of others are not")
                return
            if self._live:
                yield from self._timed(message)
                return
            held, self._held = self._held, message
            if held is not None and self._last_ns < message.stamp_ns < held.stamp_ns:
                self.tally.add("refused", WRONG)
            elif held is not None:
                yield from self._timed(held)

    def _timed(self, message: Message) -> Iterator[Message]:
        ns = message.stamp_ns
        if self._zero_ns is None:
            self.begin_ns = self._zero_ns = ns
        t_us = (ns - self._zero_ns) // 1000
        if not 0 < t_us - self._last_us < AHEAD_US:
            self._wrong = self._wrong + 1 if ns > self._wrong_ns else 1
            self._wrong_ns = ns
            if self._wrong < ANCHOR_AGAIN:
                self.tally.add("refused", WRONG)
                return
            self.tally.add("stamped by a clock that had been set", "device time goes on, stamps are off by that")
            t_us = self._last_us + ROUND_US
            self._zero_ns = ns - t_us * 1000
        self._wrong = self._wrong_ns = 0
        for why in message.refused:
            self.tally.add("refused in part", why)
        step_us, self._last_us, self._last_ns = t_us - self._last_us, t_us, ns
        if missing := self._rate.missing(step_us):
            self.tally.add("missing", count=missing)
        self.tally.time_s = t_us / 1e6
        if change := self._rate_change.since(step_us):
            self._refuse_change(*change)
        yield replace(message, stamp_ns=t_us * 1000)

    def _refuse_change(self, hz: float, ago_s: float) -> None:
        text = f"{1e6 / self._rate.step_us:.0f} messages a second at first, {hz:.0f}"
        if not self._live:
            at_s = self.tally.time_s - ago_s
            raise InputError(f"{self._port}: {text} from {at_s:.1f} s on; expected one rate: split the file there")
        if not self._is_changed:
            self._is_changed = True
            self.notes.append(f"{text} later: what counts rounds takes longer or shorter; open it again")
