"""Loads for a live board from a program in any language: a line of JSON a round, over a TCP port.

host/docs/guides/controller_tests.md describes the lines, of which the first is a token. One program at a time; the next
may connect when it has gone, and until then the time of the board stands still.
"""

from __future__ import annotations

import json
import socket
from contextlib import suppress
from dataclasses import fields
from typing import Any, BinaryIO

from ..documents import parse_json
from ..errors import BiotacError, DeviceLostError, InputError, error_text
from .board import SimBoard
from .live import LiveFingers
from .serve import LOCAL, listen, new_token, says_token
from .touch import Course, Load, SimTouch

LINE_BYTES = 65536
_KEYS = [field.name for field in fields(SimTouch)]
_FAULT_KEYS = ("finger", "kind", "channel")


class LoadServer:
    """Listens at ``port`` of ``address`` for loads of a board, from a program that says ``token`` in the first line."""

    def __init__(self, fingers: LiveFingers, board: SimBoard, *, address: str | None = None) -> None:
        self._fingers = fingers
        self._board = board
        board.release()
        board.put(board.source.samples[:0])
        self._rounds = 0
        self.token = new_token()
        self._listening = listen(address or LOCAL)
        self.port: int = self._listening.getsockname()[1]

    def serve(self) -> None:
        """Serve one program after the other until interrupted. Raises DeviceLostError when the board has ended."""
        with self._listening:
            while True:
                program, _ = self._listening.accept()
                with suppress(BrokenPipeError, ConnectionResetError), program:
                    if says_token(program, self.token):
                        program.settimeout(None)
                        with program.makefile("rb") as lines:  # of "rwb", readline gives more than the limit
                            lines.readline(LINE_BYTES)  # the end of the token's
                            self._serve(lines, program)

    def _serve(self, lines: BinaryIO, program: socket.socket) -> None:
        while line := lines.readline(LINE_BYTES):
            rest = line if len(line) == LINE_BYTES else b"\n"
            while rest and not rest.endswith(b"\n"):
                rest = lines.readline(LINE_BYTES)
            program.sendall(json.dumps(self._answer(line)).encode() + b"\n")

    def _answer(self, line: bytes) -> dict[str, Any]:
        try:
            if len(line) == LINE_BYTES and not line.endswith(b"\n"):
                raise InputError(f"the line is longer than {LINE_BYTES} bytes; send a course of fewer parts")
            request = parse_json(line)
            if not isinstance(request, dict):
                raise InputError("expected an object with a load for each finger")
            if "fault" in request:
                self._fingers.fault(*_fault(request))
                return {"round": self._rounds}
            words = self._fingers.read({name: _load(value) for name, value in request.items()})
        except DeviceLostError:
            raise
        except (BiotacError, LookupError, TypeError, ValueError, OverflowError) as error:
            return {"error": error_text(error)}
        self._board.put(words)
        self._rounds += 1
        return {"round": self._rounds}


def _fault(request: dict[str, Any]) -> tuple[str, str | None, str | None]:
    """Finger, kind and channel of a line that lays a fault, or ends them: only null does, no missing kind."""
    given = request["fault"]
    if len(request) > 1 or not isinstance(given, dict) or not {"finger", "kind"} <= {*given} <= {*_FAULT_KEYS}:
        raise InputError(f"a fault is {json.dumps(request)}, expected it alone, with finger, kind and maybe channel")
    if not all(value is None or isinstance(value, str) for value in given.values()):
        raise InputError(f"a fault is {json.dumps(given)}, expected texts, and null for the kind to end faults")
    return given["finger"], given["kind"], given.get("channel")


def _load(value: Any) -> Load:
    """A load from JSON: null, an object, a list of contacts, or {"course": [...]}."""
    if value is None:
        return None
    if isinstance(value, list):
        return [_touch(touch) for touch in value]
    if isinstance(value, dict) and value.keys() == {"course"} and isinstance(value["course"], list):
        return Course(_load(part) or () for part in value["course"])  # type: ignore[misc]
    return _touch(value)


def _touch(value: Any) -> SimTouch:
    if not isinstance(value, dict) or not value.keys() <= set(_KEYS):
        raise InputError(f"a touch is {json.dumps(value)}, expected an object with some of: {', '.join(_KEYS)}")
    given: dict[str, Any] = {name: tuple(item) if isinstance(item, list) else item for name, item in value.items()}
    return SimTouch(**given)
