"""How a program ends by a signal: Ctrl-C, SIGTERM, or SIGHUP, a terminal that closes.

A signal that was inherited as ignored stays ignored, as by ``nohup`` or behind ``&`` in a script.
"""

from __future__ import annotations

import contextlib
import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from types import FrameType

INTERRUPTED = 130
SIGNALS = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
ONCE_S = 1.0  # of several in this time, as of a terminal that closes, one counts: the first is being obeyed
AGAIN_S = 0.02

_held = 0
_pending = False
_last_s = -ONCE_S


def by_leaving() -> None:
    """From here on a signal ends the process at once, and silently: nothing has begun."""
    _install(lambda number, frame: os._exit(INTERRUPTED))


def by_interrupt() -> None:
    """From here on a signal raises KeyboardInterrupt in the main thread."""
    global _held, _pending
    _held, _pending = 0, False
    _install(_interrupt)


def by_itself() -> None:
    """From here on the process ends anyway, and no signal comes in between."""
    _install(signal.SIG_IGN)


def _install(handler: Callable[[int, FrameType | None], object] | signal.Handlers) -> None:
    if threading.current_thread() is threading.main_thread():
        for number in SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                signal.signal(number, handler)


def _interrupt(number: int, frame: FrameType | None) -> None:
    global _pending, _last_s
    if _held:
        _pending = True
        return
    while frame and frame.f_code.co_name != "__del__" and "importlib" not in frame.f_code.co_filename:
        frame = frame.f_back
    if frame is not None:
        # An error raised there is lost: of a __del__ it is printed, and C code that is being imported may clear it.
        threading.Timer(AGAIN_S, _again, [number]).start()
        return
    if time.monotonic() - _last_s >= ONCE_S:
        _last_s = time.monotonic()
        raise KeyboardInterrupt


def _again(number: int) -> None:
    if hasattr(signal, "pthread_kill"):  # so that the main thread's wait is interrupted
        signal.pthread_kill(threading.main_thread().ident or 0, number)
    else:
        signal.raise_signal(number)


@contextlib.contextmanager
def held() -> Iterator[Callable[[], None]]:
    """Put a signal off until the end of this, or until the yielded function is called: the block is done whole."""
    global _held

    def look() -> None:
        global _pending
        if _pending:
            _pending = False
            raise KeyboardInterrupt

    _held += 1
    try:
        yield look
    finally:
        _held -= 1
    if not _held:
        look()
