"""The same work on many items, in this process or in several."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from multiprocessing import active_children, get_context
from typing import TypeVar

from ..errors import BiotacError, InputError

Item = TypeVar("Item")
Result = TypeVar("Result")


def each(
    work: Callable[[Item], Result], items: Sequence[Item], jobs: int = 1
) -> Iterator[tuple[int, Result | BiotacError]]:
    """Yield each item's index with the result of ``work`` or the error, as they complete; all must be picklable."""
    if jobs == 1:
        for k, item in enumerate(items):
            yield k, _tried(work, item)
        return
    with _in_processes(jobs) as pool:
        with _unsignalled():
            index = {pool.submit(_worked, work, item): k for k, item in enumerate(items)}
        for done in as_completed(index):
            problem = done.exception()
            if problem is not None:
                problem = InputError(
                    f"{items[index[done]]}: its worker died before finishing (out of memory?); run again with fewer "
                    f"workers ({type(problem).__name__})"
                )
            yield index[done], problem or done.result()


def _tried(work: Callable[[Item], Result], item: Item) -> Result | BiotacError:
    try:
        return work(item)
    except BiotacError as error:
        return error
    except OSError as error:
        return InputError(f"{item}: {error.strerror or error}")


def _worked(work: Callable[[Item], Result], item: Item) -> Result | BiotacError:
    try:
        return _tried(work, item)
    except SystemExit:  # of the signal below; half-written files have been removed by now
        os._exit(1)


def _begin() -> None:
    """Of a worker: Ctrl-C reaches all processes of a terminal, and the parent ends its workers."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    if hasattr(signal, "SIGUSR1"):
        signal.signal(signal.SIGUSR1, lambda *_: sys.exit(1))


@contextlib.contextmanager
def _unsignalled() -> Iterator[None]:
    """Processes that are begun meanwhile get no signal of a terminal's: their parent ends them."""
    if not hasattr(signal, "pthread_sigmask"):
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT, signal.SIGTERM, signal.SIGHUP})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextlib.contextmanager
def _in_processes(jobs: int) -> Iterator[Executor]:
    # spawn: a fork of a process with threads (pyarrow's) may hang.
    with _unsignalled():  # the semaphores' keeper begins with them
        made = ProcessPoolExecutor(jobs, get_context("spawn"), initializer=_begin)
    with made as pool:
        try:
            yield pool
        except BaseException:
            for worker in active_children():
                if hasattr(signal, "SIGUSR1") and worker.pid is not None:
                    os.kill(worker.pid, signal.SIGUSR1)
                else:
                    worker.kill()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)
