"""A program's lasting requests to a board: commands to send again after a restart, and held fingers."""

from __future__ import annotations

import threading
from collections.abc import Callable

from ..wire.batches import Batch
from ..wire.messages_gen import FrameFlags
from ..wire.sensor_gen import MAX_SENSORS

# Rows that come with HOLD's answer may have been made before it: on a shared board answers can overtake rows. A row
# this much later was made after it.
SETTLE_US = 50_000
_ANY_ROW_US = -SETTLE_US - 1


#: The subject of a command: the kind, and the number of the setting or finger.
Subject = tuple[str, int]


class Lasting:
    """The commands that a restart undoes, the held fingers, and those with an unanswered RELEASE.

    The board decides: a finger that has a row without HELD is not held any more. Any thread may use it.
    """

    def __init__(self, lock: threading.Condition) -> None:
        self._lock = lock
        self._again: dict[Subject, Callable[[], object]] = {}
        self._since_us: dict[int, int | None] = {}  # of held fingers; None: since before the first row
        self._now_us: int | None = None  # of the latest row
        self._unreleased = 0

    def remember(self, subject: Subject, again: Callable[[], object]) -> None:
        """Remember to send a restarted board ``subject`` anew, by ``again``; the latest goes last."""
        with self._lock:
            self._again.pop(subject, None)
            self._again[subject] = again

    def commands(self) -> list[tuple[Subject, Callable[[], object]]]:
        """The commands for a restarted board, in order."""
        with self._lock:
            return list(self._again.items())

    # ---- held fingers --------------------------------------------------------------------------

    @property
    def unreleased(self) -> int:
        """Bit mask of the fingers with an unanswered RELEASE."""
        return self._unreleased

    def begin(self, mask: int, present: int) -> None:
        """The board has answered HOLD for ``mask``; only of ``present`` fingers rows will say so."""
        with self._lock:
            self._unreleased &= ~mask
            self._since_us |= {f: self._now_us for f in range(MAX_SENSORS) if mask & present & 1 << f}

    def end(self, mask: int) -> None:
        """The program releases them; the board has not answered RELEASE yet."""
        with self._lock:
            self._unreleased |= mask
            self._since_us = {f: since for f, since in self._since_us.items() if not mask & 1 << f}

    def released(self, mask: int) -> None:
        """The board has answered RELEASE for ``mask``."""
        with self._lock:
            self._unreleased &= ~mask

    def restart(self) -> None:
        """The board's clock begins anew: each row from now on is later than the holds that were given before."""
        with self._lock:
            self._now_us, self._since_us = None, dict.fromkeys(self._since_us, _ANY_ROW_US)

    def lapsed(self, batch: Batch, last_us: int) -> dict[int, int]:
        """Of the held fingers that a row of ``batch`` shows without HELD, the time of that row; they are forgotten."""
        with self._lock:
            self._now_us = last_us
            found: dict[int, int] = {}
            if not self._since_us:
                return found
            first_us = batch.first_t_us()
            self._since_us = {f: first_us if since is None else since for f, since in self._since_us.items()}
            for rows, t_us in ((batch.wire, batch.t_us), (batch.idle, batch.idle["t_us"])):
                bare = rows["flags"] & int(FrameFlags.HELD) == 0
                for finger, at_us in zip(rows["finger"][bare].tolist(), t_us[bare].tolist(), strict=True):
                    since_us = self._since_us.get(finger)
                    if since_us is not None and at_us > since_us + SETTLE_US:
                        found[finger] = at_us
                        del self._since_us[finger]
            return found
