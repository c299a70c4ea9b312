"""The same work on many items: in this process, in several processes, or on a Dask cluster."""

from __future__ import annotations

import contextlib
import signal
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, as_completed
from multiprocessing import active_children, get_context
from typing import Any, TypeVar

from ..errors import BiotacError, InputError

Item = TypeVar("Item")
Result = TypeVar("Result")


def each(
    work: Callable[[Item], Result], items: Sequence[Item], jobs: int = 1, dask: str | None = None
) -> Iterator[tuple[int, Result | BiotacError]]:
    """Yield each item's index with the result of ``work`` or its error, as they complete; all must be picklable.

    ``dask`` is the address of a scheduler whose workers have this package and see the same files. Raises InputError
    when it cannot be reached, or Dask is not installed.
    """
    if dask is None and jobs == 1:
        for k, item in enumerate(items):
            yield k, _tried(work, item)
        return
    with _on_dask(dask) if dask is not None else _in_processes(jobs) as pool:
        with _unsignalled():
            index = {pool.submit(_tried, work, item): k for k, item in enumerate(items)}
        for done in as_completed(index):
            problem = done.exception()
            if isinstance(problem, ImportError):
                cure = "pip install 'biotac-gateway[lake]' distributed"
                raise InputError(f"a Dask worker lacks {problem.name}; {cure} there")
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
    # spawn: a fork of a process with threads (pyarrow's) may hang. Ctrl-C reaches all processes of a terminal, and the
    # parent ends its workers.
    ignoring = signal.SIGINT, signal.SIG_IGN
    with _unsignalled():  # the semaphores' keeper begins with them
        made = ProcessPoolExecutor(jobs, get_context("spawn"), initializer=signal.signal, initargs=ignoring)
    with made as pool:
        try:
            yield pool
        except BaseException:
            for worker in active_children():  # what it did not finish is no part of the lake
                worker.kill()
            raise
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


@contextlib.contextmanager
def _on_dask(address: str) -> Iterator[Executor]:
    try:
        import distributed
    except ImportError as error:
        raise InputError(f"--dask needs {error.name}, which is not installed; pip install distributed") from error
    connect: Any = distributed.Client  # untyped
    try:
        client = connect(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"no Dask scheduler answers at {address} ({error}); expected one at tcp://HOST:PORT: start `dask scheduler`"
        ) from error
    with client, client.get_executor(pure=False) as pool:
        yield pool
