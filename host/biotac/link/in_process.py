"""A board that is a thread of this process: the link, and the port that the firmware's code calls (binding/sbc.c)."""

from __future__ import annotations

import threading
from abc import abstractmethod
from typing import Any

from ..errors import DeviceLostError
from ..wire.native import ffi, lib
from .base import Link

# As much as a board and the operating system would buffer for a slow host; beyond that, whole frames are dropped.
OUTBOX_BYTES = 262_144


class InProcessLink(Link):
    """A Link to a gateway that runs in this process, on a thread that ``begin`` starts.

    A subclass has ``_run``; ``_us``, the board's time; and, with a bus, ``_delay`` and ``_exchange``.
    """

    cure = "open it again"  # after a failure

    def __init__(self, port: str) -> None:
        self.port = port
        self._inbox = bytearray()
        self._outbox = bytearray()
        self._changed = threading.Condition()
        self._closing = False
        self._failure: BaseException | None = None
        self._handle = ffi.new_handle(self)

    def begin(self, board: Any) -> None:
        """Run ``board``, NULL where there was no memory for it."""
        if board == ffi.NULL:
            raise MemoryError("no memory for a board")
        self._board = ffi.gc(board, lib.bt_sbc_free)
        self._start()

    def _start(self) -> None:
        self._thread = threading.Thread(target=self._run, name=self.port, daemon=True)
        self._thread.start()

    # ---- the host's thread -----------------------------------------------------------------------

    def read(self, timeout_s: float) -> bytes:
        with self._changed:
            self._changed.wait_for(lambda: self._outbox or self._failure or self._closing, timeout_s)
            data = bytes(self._outbox)
            self._outbox.clear()
            self._changed.notify_all()
        if not data:
            self._check()
        return data

    def write(self, data: bytes) -> None:
        self._check()
        with self._changed:
            self._inbox += data
            self._changed.notify_all()

    def close(self) -> None:
        self._closing = True
        with self._changed:
            self._changed.notify_all()
        self._thread.join()

    def _check(self) -> None:
        if self._failure is not None:
            raise DeviceLostError(
                f"{self.port} failed while it was open ({self._failure}); {self.cure}"
            ) from self._failure

    # ---- the board's thread ----------------------------------------------------------------------

    @abstractmethod
    def _run(self) -> None:
        """Call the board, until ``_closing`` or ``_failure``."""

    def _delay(self, us: int) -> None:
        """Without a bus there is nothing to wait for."""

    def _fail(self, error: BaseException) -> None:
        with self._changed:
            self._failure = self._failure or error
            self._changed.notify_all()

    def _send(self, data: bytes) -> bool:
        with self._changed:
            if len(self._outbox) + len(data) > OUTBOX_BYTES:
                return False
            self._outbox += data
            self._changed.notify_all()
        return True

    def _receive(self, most: int) -> bytes:
        if not self._inbox:
            return b""
        with self._changed:
            data = bytes(self._inbox[:most])
            del self._inbox[:most]
        return data


def _link(handle: Any) -> Any:
    return ffi.from_handle(handle)


def _failed(kind: Any, error: Any, trace: Any) -> None:
    """Save an error of a callback below from being lost in C: it ends the board, and the host gets the error."""
    _link(trace.tb_frame.f_locals["handle"])._fail(error)


@ffi.def_extern(onerror=_failed)  # type: ignore[untyped-decorator]
def bt_sbc_now_us(handle: Any) -> int:
    return int(_link(handle)._us() % 2**32)


@ffi.def_extern(onerror=_failed)  # type: ignore[untyped-decorator]
def bt_sbc_delay_us(handle: Any, us: int) -> None:
    _link(handle)._delay(us)


@ffi.def_extern(onerror=_failed)  # type: ignore[untyped-decorator]
def bt_sbc_exchange(handle: Any, finger: int, data: Any, n: int) -> None:
    _link(handle)._exchange(finger, ffi.buffer(data, n))


@ffi.def_extern(onerror=_failed)  # type: ignore[untyped-decorator]
def bt_sbc_link_write(handle: Any, data: Any, n: int) -> bool:
    return bool(_link(handle)._send(bytes(ffi.buffer(data, n))))


@ffi.def_extern(onerror=_failed)  # type: ignore[untyped-decorator]
def bt_sbc_link_read(handle: Any, data: Any, most: int) -> int:
    received = _link(handle)._receive(most)
    ffi.buffer(data, most)[: len(received)] = received
    return len(received)
