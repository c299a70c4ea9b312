"""The channel on which a program feeds a simulated board's sensors: a loopback socket with the EMU messages.

The board's time stands still until the next round has come (firmware/emu/feed.h, protocol/MESSAGES.md).
"""

from __future__ import annotations

import socket
from itertools import cycle
from typing import Any

import numpy as np

from ..errors import DeviceLostError
from ..wire import messages_gen as wire
from ..wire.framing import encode, open_frame
from ..wire.slots import SLOTS_PER_FRAME
from .sampling import Words

SAMPLES_A_MESSAGE = 110
PATIENCE_S = 60.0


class Control:
    """A program's end of the channel at ``port``, where rounds are counted from 0."""

    def __init__(self, port: int) -> None:
        self._socket = socket.create_connection(("127.0.0.1", port), timeout=PATIENCE_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._received = b""
        self._req_ids = cycle(range(1, 256))
        self._slots = 0

    def feed(self, words: Words) -> None:
        """Send the next round of every finger, uint16 (fingers, 44): counts or tape codes."""
        fingers = len(words)
        samples = np.ascontiguousarray(words.T, "<u2")
        most = SAMPLES_A_MESSAGE // fingers
        messages = b""
        for first in range(0, SLOTS_PER_FRAME, most):
            part = samples[first : first + most]
            head = (next(self._req_ids), fingers, len(part), self._slots)
            data = part.tobytes().ljust(2 * SAMPLES_A_MESSAGE, b"\0")
            messages += encode(wire.EmuTape.ID, wire.EmuTape(*head, tuple(data)).pack())
            self._slots += len(part)
        self._send(messages)

    def fault(self, finger: int, code: int) -> None:
        """Put an EmuFault in place of a finger's words from now on; 0 ends it."""
        self._ask(wire.EmuSetFault(next(self._req_ids), finger, code))

    def status(self) -> wire.EmuStatus:
        """What the sensors have been fed, and what the board has sent by now."""
        return self._ask(wire.EmuGetStatus(next(self._req_ids)))

    def wait_still(self) -> wire.EmuStatus:
        """Wait until the board has computed all that was fed, and its time stands still.

        Raises DeviceLostError when it ends, or takes longer than PATIENCE_S.
        """
        while True:
            status = self._next()
            if isinstance(status, wire.EmuStatus) and status.req_id == 0 and status.slots_taken == self._slots:
                return status

    def _ask(self, request: Any) -> wire.EmuStatus:
        self._send(encode(request.ID, request.pack()))
        while True:
            message = self._next()
            if message.req_id == request.req_id:
                if isinstance(message, wire.EmuStatus):
                    return message
                raise DeviceLostError(
                    f"the simulated sensors refused {type(request).__name__}: {wire.Error(message.error).name}; "
                    "check its values"
                )

    def _send(self, data: bytes) -> None:
        try:
            self._socket.sendall(data)
        except OSError as error:
            raise _lost(error) from error

    def _next(self) -> Any:
        while True:
            packet, delimiter, rest = self._received.partition(b"\0")
            if delimiter:
                self._received = rest
                message = open_frame(packet)
                if message is not None and message[0] in (wire.EmuStatus.ID, wire.Reply.ID):
                    kind = wire.EmuStatus if message[0] == wire.EmuStatus.ID else wire.Reply
                    return kind.unpack(message[1])
                continue
            try:
                chunk = self._socket.recv(65536)
            except OSError as error:
                raise _lost(error) from error
            if not chunk:
                raise _lost("its channel was closed")
            self._received += chunk

    def close(self) -> None:
        """Give the channel up. Safe to call twice."""
        self._socket.close()


def _lost(why: object) -> DeviceLostError:
    return DeviceLostError(f"the simulated board is gone ({why}); start another world")
