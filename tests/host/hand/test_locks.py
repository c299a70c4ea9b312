"""What the threads of a program and the reading thread share: who comes while another is inside waits."""

import threading
from collections.abc import Callable
from contextlib import suppress
from queue import SimpleQueue
from types import SimpleNamespace
from typing import Any

import pytest
from live_board import batch_of, frame

from biotac.board.consumers import Callbacks, DeferredErrors, Wanted
from biotac.board.gap import Gaps
from biotac.board.lasting import Lasting
from biotac.clock import DeviceClock

Doors = list[Callable[[], object]]
OTHER = threading.Condition()


class Told(threading.Condition):
    """A lock that tells when a thread has to wait for it."""

    def __init__(self) -> None:
        super().__init__(threading.RLock())
        self.news: SimpleQueue[str] = SimpleQueue()

    def __enter__(self) -> bool:
        if not self.acquire(blocking=False):
            self.news.put("waits")
            self.acquire()
        return True


def of_a_clock(lock: Told) -> tuple[object, Doors]:
    clock = DeviceClock()
    clock.arrived(0, 1.0)
    feeding: Doors = [lambda: clock.arrived(1, 1.0), lambda: clock.round_trip(1.0, 1, 1.0)]
    return clock, [*feeding, lambda: clock.estimate_s(1), clock.now, lambda: clock.host_time_s(1)]


def of_gaps(lock: Told) -> tuple[object, Doors]:
    gaps, batch = Gaps(Lasting(OTHER), lock), batch_of(frame(0))
    return gaps, [lambda: gaps.begin("silence"), gaps.forget, lambda: gaps.through(batch, 0, 1, [])]


def of_lasting(lock: Told) -> tuple[object, Doors]:
    lasting, batch = Lasting(lock), batch_of(frame(0))
    commands: Doors = [lambda: lasting.remember(("map", 0), print), lasting.commands]
    holds: Doors = [lambda: lasting.begin(1, 1), lambda: lasting.end(1), lambda: lasting.released(1)]
    return lasting, [*commands, *holds, lasting.restart, lambda: lasting.lapsed(batch, 0)]


def of_errors(lock: Told) -> tuple[object, Doors]:
    errors = DeferredErrors()
    return errors, [lambda: errors.add(ValueError()), errors.report]


def of_callbacks(lock: Told) -> tuple[object, Doors]:
    reader: Any = SimpleNamespace(connection=SimpleNamespace(thread=lambda *words: SimpleNamespace(ident=1)))
    wanted = Wanted()
    callbacks = Callbacks(reader, DeferredErrors(), wanted)
    return wanted, [lambda: callbacks.add(int, print)]


@pytest.mark.parametrize("of", [of_a_clock, of_gaps, of_lasting, of_errors, of_callbacks])
def test_who_comes_meanwhile_waits(of: Callable[[Told], tuple[object, Doors]], monkeypatch: pytest.MonkeyPatch) -> None:
    lock = Told()
    with monkeypatch.context() as patch:
        patch.setattr(threading, "Lock", lambda: lock)
        patch.setattr(threading, "RLock", lambda: lock)
        shared, doors = of(lock)
    for door in doors:

        def comes(door: Callable[[], object] = door) -> None:
            with suppress(ValueError):  # the error that is reported
                door()
            lock.news.put("has been inside")

        thread = threading.Thread(target=comes)
        with lock:
            before = repr(vars(shared))
            thread.start()
            assert lock.news.get() == "waits"
            assert repr(vars(shared)) == before
        thread.join()
        assert lock.news.get() == "has been inside"
