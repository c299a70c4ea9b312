"""A time in which the board was away."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Literal, cast, get_args

GAP = "gap"  # what a recording marks it by

Reason = Literal["unplugged", "rebooted", "silence"]


@dataclass(frozen=True, slots=True)
class Gap:
    """Stands in ``Batch.messages`` of the first batch with rows after the board came back.

    ``reason``: ``unplugged``, the port went away; ``silence``, it stayed but said nothing; ``rebooted``, whatever
    was seen first, the board restarted: its clock, sequence numbers and tares began anew. ``last_t_us`` and
    ``next_t_us`` are the device times in us of the rows around the gap, of different clocks after a reboot; None
    when nothing had come before. ``lost_at_ns`` and ``back_at_ns`` are this computer's Unix time. ``boot_id`` is
    the board's after the gap.
    """

    reason: Reason
    last_t_us: int | None
    next_t_us: int | None
    lost_at_ns: int
    back_at_ns: int
    boot_id: int

    def as_text(self) -> dict[str, str]:
        """For a recording's metadata, which holds text only."""
        return {name: "" if value is None else str(value) for name, value in asdict(self).items()}

    @classmethod
    def from_text(cls, text: Mapping[str, str]) -> Gap:
        """Inverse of as_text. Raises KeyError or ValueError for what as_text never made."""
        if text["reason"] not in get_args(Reason):
            raise ValueError(f"reason {text['reason']!r}")
        last, following = (int(text[name]) if text[name] else None for name in ("last_t_us", "next_t_us"))
        lost_at_ns, back_at_ns, boot_id = (int(text[name]) for name in ("lost_at_ns", "back_at_ns", "boot_id"))
        return cls(cast(Reason, text["reason"]), last, following, lost_at_ns, back_at_ns, boot_id)

    def words(self) -> str:
        """For people."""
        return f"the board was away for {(self.back_at_ns - self.lost_at_ns) / 1e9:.1f} s ({self.reason})"
