"""A time during which the board was away."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Literal, cast, get_args

GAP = "gap"  # its name in a recording's metadata

Reason = Literal["unplugged", "rebooted", "silence"]


@dataclass(frozen=True, slots=True)
class Gap:
    """A time during which the board was away, in ``Batch.messages`` of the first batch with rows after it came back.

    ``reason`` is ``unplugged`` when the port went away, and ``silence`` when it stayed but nothing came. It is
    ``rebooted``, whatever was seen first, when the board restarted: then its clock, sequence numbers and tares began
    anew. ``last_t_us`` and ``next_t_us`` are the device times in us of the rows around the gap; after a reboot they
    are of different clocks, and ``last_t_us`` is None when no row had come before. ``lost_at_ns`` and ``back_at_ns``
    are this computer's Unix time in ns. ``boot_id`` is the board's after the gap.
    """

    reason: Reason
    last_t_us: int | None
    next_t_us: int | None
    lost_at_ns: int
    back_at_ns: int
    boot_id: int

    def as_text(self) -> dict[str, str]:
        """Its values as text, for a recording's metadata, which holds nothing else."""
        return {name: "" if value is None else str(value) for name, value in asdict(self).items()}

    @classmethod
    def from_text(cls, text: Mapping[str, str]) -> Gap:
        """Inverse of as_text. Raises KeyError or ValueError for text that as_text cannot have made."""
        if text["reason"] not in get_args(Reason):
            raise ValueError(f"reason {text['reason']!r}")
        last, following = (int(text[name]) if text[name] else None for name in ("last_t_us", "next_t_us"))
        lost_at_ns, back_at_ns, boot_id = (int(text[name]) for name in ("lost_at_ns", "back_at_ns", "boot_id"))
        return cls(cast(Reason, text["reason"]), last, following, lost_at_ns, back_at_ns, boot_id)

    def words(self) -> str:
        """One sentence for people."""
        return f"the board was away for {(self.back_at_ns - self.lost_at_ns) / 1e9:.1f} s ({self.reason})"
