"""The batches that a hand's reader reads, for tests of the wire beside the hand."""

import threading
from typing import Any

from biotac.wire.batches import Batch


class Capture:
    """A tap (Hand.tap) that keeps the bytes and the messages; it stands still on demand, and the reader with it."""

    def __init__(self, *, still: bool = False) -> None:
        self.sent = bytearray()
        self.messages: list[Any] = []
        self.resume = threading.Event()
        if not still:
            self.resume.set()

    def put_raw(self, chunk: bytes, batch: Any) -> None:
        self.resume.wait()
        self.sent += chunk

    def put(self, batch: Batch) -> None:
        self.messages += batch.messages

    def wake(self) -> None:
        pass

    def is_full(self) -> bool:
        return False
