"""How often messages were omitted, why, and when first."""

from __future__ import annotations

import re

MOST = 100  # reasons, of a source that finds ever new ones


class Tally:
    """Counts by reason; numbers in a reason do not make it another one."""

    def __init__(self) -> None:
        self.time_s = 0.0  # of the latest good message
        self._found: dict[tuple[str, str], list[int | float | str]] = {}

    def add(self, what: str, why: str = "", count: int = 1) -> None:
        """``what`` happened to ``count`` messages: "refused", "missing"."""
        key = what, re.sub(r"\d+", "0", why)
        if key in self._found or len(self._found) < MOST:
            own = self._found.setdefault(key, [0, self.time_s, f": {why}" if why else ""])
            own[0] = int(own[0]) + count

    def lines(self) -> list[str]:
        out = []
        for (what, _), (count, first_s, why) in self._found.items():
            head = f"{count} messages were {what}, the first" if count != 1 else f"a message was {what},"
            out.append(f"{head} after {first_s:.2f} s{why}")
        return out
