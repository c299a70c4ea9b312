"""The live API for asyncio: ``async with biotac.aio.open(port) as hand: async for batch in hand.batches(): ...``

The Hand's own thread reads (reader.py) and wakes the event loop; nothing here blocks the loop.
"""

from __future__ import annotations

import asyncio
import os
import threading
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import suppress
from typing import NoReturn, TypeVar

from ..errors import DeviceLostError
from ..wire.batches import Batch, LinkStats
from ..wire.frames import Frame
from .hand import MAX_AGE_S, Hand
from .opening import open as open_hand
from .views import FingerView

Answer = TypeVar("Answer")


class AsyncHand:
    """A Hand inside an event loop. Made by ``biotac.aio.open``; use with ``async with``."""

    def __init__(self, opener: Callable[[], Hand]) -> None:
        self._opener = opener
        self._hand: Hand | None = None

    async def __aenter__(self) -> AsyncHand:
        given_up = False
        taking = threading.Lock()

        def open_it() -> None:
            hand = self._opener()
            with taking:
                if not given_up:
                    self._hand = hand
                    return
            hand.close()

        try:
            await asyncio.to_thread(open_it)
        except asyncio.CancelledError:
            # The other thread cannot be interrupted; a hand that it still opens has no user and is closed.
            with taking:
                given_up, hand, self._hand = True, self._hand, None
            if hand is not None:
                hand.close()
            raise
        return self

    def __reduce__(self) -> NoReturn:
        raise TypeError(f"{self!r} belongs to this process and cannot be sent to another; open the board there")

    async def __aexit__(self, kind: object, error: object, trace: object) -> None:
        await asyncio.to_thread(self.hand.__exit__, kind, error, trace)

    @property
    def hand(self) -> Hand:
        """The Hand itself. Commands on it block: see ``ask``. Raises DeviceLostError before ``async with``."""
        if self._hand is None:
            raise DeviceLostError("this hand is not open yet; use `async with biotac.aio.open(port) as hand:`")
        return self._hand

    @property
    def stats(self) -> LinkStats:
        """See Hand.stats."""
        return self.hand.stats

    def __getitem__(self, finger: str | int) -> FingerView:
        """See Hand.__getitem__."""
        return self.hand[finger]

    async def ask(self, command: Callable[[Hand], Answer]) -> Answer:
        """Run a command in another thread: ``await hand.ask(lambda h: h.status())``.

        A command that is cancelled, as by ``asyncio.timeout``, ends at once. Rows that it had read come with the next
        read.
        """
        hand = self.hand
        threads: list[threading.Thread] = []

        def run() -> Answer:
            threads.append(threading.current_thread())
            try:
                return command(hand)
            finally:
                hand._reading.may_read(threads.pop())

        try:
            return await asyncio.to_thread(run)
        except asyncio.CancelledError:
            for thread in [*threads]:  # it has begun, and not ended
                hand._reading.give_up(thread)
            raise

    async def batches(self) -> AsyncIterator[Batch]:
        """Batches as they arrive, starting the stream if need be. Each iteration begins with the next batch.

        Ends when a simulated source ends, and when the stream is stopped. A slow loop loses the oldest batches, which
        ``stats.batches_skipped`` counts; a simulated board that is not paced waits instead.
        """
        hand = self.hand
        loop = asyncio.get_running_loop()
        news = asyncio.Event()

        def wake() -> None:
            # The loop may already be closed while the reading thread is ending.
            with suppress(RuntimeError):
                loop.call_soon_threadsafe(news.set)

        queue = hand._reading.add_queue(wake)
        try:
            await asyncio.to_thread(hand.start)
            while True:
                news.clear()
                over = not hand.streaming  # before the queue is emptied, so that nothing is left in it
                while (batch := queue.get()) is not None:
                    yield batch
                hand.check()
                if over:
                    return
                await news.wait()
        finally:
            hand.remove(queue)

    async def frames(self) -> AsyncIterator[Frame]:
        """Typed frames as they arrive; see ``batches``."""
        async for batch in self.batches():
            for row in batch.frames:
                yield Frame.from_row(row)


def open(
    port: str | os.PathLike[str],
    *,
    pace: float = 0.0,
    reconnect: bool = False,
    fingers: Mapping[str, int] | None = None,
    max_age_s: float = MAX_AGE_S,
) -> AsyncHand:
    """Like biotac.open; the board is opened by ``async with``."""
    return AsyncHand(lambda: open_hand(port, pace=pace, reconnect=reconnect, fingers=fingers, max_age_s=max_age_s))
