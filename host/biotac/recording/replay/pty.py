"""A recording played back as a board on a pty, for any serial program."""

from __future__ import annotations

import os
import select
from contextlib import suppress

from ...clock.host_clock import HostClock
from ...errors import PortError
from .link import CHUNK_BYTES, Pacer
from .playback import Playback


class ReplayPty:
    """A pty on which any serial program finds the recorded board, at ``path``."""

    def __init__(self, playback: Playback, pace: float) -> None:
        self._pacer = Pacer(playback, pace, HostClock())
        self._out = b""
        try:
            import pty  # here, because Windows has neither
            import tty

            self._master, self._slave = pty.openpty()
        except (ImportError, OSError) as error:
            raise PortError(
                f"cannot open a pty for the recording ({error}); use replay:REC as the port instead"
            ) from error
        # Never closed, so that the pty outlives the programs that use it. Raw, or it would echo our own bytes.
        tty.setraw(self._slave)
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)

    @property
    def over(self) -> bool:
        """True when everything has been handed over."""
        return self._pacer.playback.over and not self._out

    def turn(self, timeout_s: float) -> None:
        """Answer commands and play all bytes that are due, once; waits at most ``timeout_s`` for something to do."""
        wait_s = self._pacer.wait_s()
        if not self._out and wait_s is not None:
            timeout_s = min(timeout_s, wait_s)
        readable, writable, _ = select.select([self._master], [self._master] if self._out else [], [], timeout_s)
        playback = self._pacer.playback
        for message_id, payload in playback.requests(os.read(self._master, CHUNK_BYTES)) if readable else ():
            answer = playback.answer(message_id, payload)
            self._out += playback.refusal(message_id, payload) if answer is None else answer
        if not self._out:
            self._out = self._pacer.due()
        if writable or self._out:
            with suppress(BlockingIOError):  # the reader is behind; nothing is dropped, playback waits
                self._out = self._out[os.write(self._master, self._out) :]

    def close(self) -> None:
        """Close the pty. Safe to call twice."""
        for fd in (self._master, self._slave):
            if fd >= 0:
                os.close(fd)
        self._master = self._slave = -1
