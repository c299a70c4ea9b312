"""A progress line on stderr for work of more than a second, on a terminal only."""

from __future__ import annotations

import contextlib
import sys
import time


class Progress:
    """Call ``show`` as often as you like: it prints a few times a second. As a context manager it clears the line."""

    def __init__(self) -> None:
        self._enabled = sys.stderr.isatty()
        self._next = time.monotonic() + 1.0
        self._width = 0

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *error: object) -> None:
        self.done()

    def show(self, text: str) -> None:
        """Replace the line by ``text``, at most five times a second and not within the first second."""
        now = time.monotonic()
        if not self._enabled or now < self._next:
            return
        self._next = now + 0.2
        self._print(f"\r{text:<{self._width}}")
        self._width = max(self._width, len(text))

    def done(self) -> None:
        if self._width:
            self._print("\r" + " " * self._width + "\r")

    def _print(self, text: str) -> None:
        with contextlib.suppress(OSError):  # a terminal that has closed changes nothing
            print(text, end="", file=sys.stderr, flush=True)
