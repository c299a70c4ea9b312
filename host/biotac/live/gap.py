"""A time in which the board was away."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Literal

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
