"""The same work on many items: in this process, in several processes, or on a Dask cluster."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from typing import Any, TypeVar

from ..errors import BiotacError, InputError

Item = TypeVar("Item")
Result = TypeVar("Result")
_work: Callable[[Any], Any] | None = None  # in a worker
_ENDED = "its worker died before finishing (out of memory?); run again with fewer workers"


def each(
    work: Callable[[Item], Result], items: Sequence[Item], jobs: int = 1, dask: str | None = None
) -> Iterator[tuple[Item, Result | BiotacError]]:
    """Yield each item with the result of ``work`` or its error, as they complete; ``work`` and items must be picklable.

    ``dask`` is the address of a scheduler whose workers have this package and see the same files. Raises InputError
    when it cannot be reached, or Dask is not installed.
    """
    if dask is not None:
        yield from _on_dask(work, items, dask)
    elif jobs == 1:
        for item in items:
            yield item, _tried(work, item)
    else:
        yield from _in_processes(work, items, jobs)


def _tried(work: Callable[[Item], Result], item: Item) -> Result | BiotacError:
    try:
        return work(item)
    except BiotacError as error:
        return error
    except OSError as error:
        return InputError(f"{item}: {error.strerror or error}")


def _in_processes(
    work: Callable[[Item], Result], items: Sequence[Item], jobs: int
) -> Iterator[tuple[Item, Result | BiotacError]]:
    from concurrent.futures import ProcessPoolExecutor, as_completed
    from concurrent.futures.process import BrokenProcessPool
    from multiprocessing import get_context

    # spawn: a fork of a process with threads (pyarrow's) may hang.
    with ProcessPoolExecutor(jobs, get_context("spawn"), initializer=_begin, initargs=(work,)) as pool:
        of = {pool.submit(_tried_here, item): item for item in items}
        try:
            for done in as_completed(of):
                try:
                    yield of[done], done.result()
                except BrokenProcessPool:
                    yield of[done], InputError(f"{of[done]}: {_ENDED}")
        finally:
            pool.shutdown(wait=True, cancel_futures=True)


def _begin(work: Callable[[Any], Any]) -> None:
    """Initialize a worker. ``work`` is sent once, not with each item, because it can hold the index of a large lake.

    Ctrl-C is ignored here: it reaches all processes of a terminal, and the parent ends its workers.
    """
    global _work
    _work = work
    signal.signal(signal.SIGINT, signal.SIG_IGN)


def _tried_here(item: Any) -> Any:
    assert _work is not None
    return _tried(_work, item)


def _on_dask(
    work: Callable[[Item], Result], items: Sequence[Item], address: str
) -> Iterator[tuple[Item, Result | BiotacError]]:
    try:
        import distributed
    except ImportError as error:
        raise InputError(
            f"--dask needs {error.name}, which is not installed; pip install 'biotac-gateway[dask]'"
        ) from error
    connect: Any = distributed.Client  # untyped
    as_completed: Any = distributed.as_completed
    try:
        client = connect(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(
            f"no Dask scheduler answers at {address} ({error}); expected one at tcp://HOST:PORT: start `dask scheduler`"
        ) from error
    with client:
        futures = client.map(_tried, [work] * len(items), items, pure=False)
        of = dict(zip(futures, items, strict=True))
        for done in as_completed(futures, loop=client.loop, raise_errors=False):
            problem = done.exception()
            if isinstance(problem, ImportError):
                raise InputError(f"a Dask worker lacks {problem.name}; pip install 'biotac-gateway[lake,dask]' there")
            if problem is not None:
                yield of[done], InputError(f"{of[done]}: {_ENDED} ({type(problem).__name__})")
            else:
                yield of[done], done.result()
