"""What EVENT messages say, beyond their fields."""

from __future__ import annotations

from .messages_gen import Event, EventKind

INVALID_U32 = 0xFFFFFFFF  # of energy_count2


def kind_name(event: Event) -> str:
    """Name of its kind, as in EventKind; its number where this release knows none."""
    return EventKind(event.kind).name if event.kind in list(EventKind) else str(event.kind)


def event_age_s(event: Event) -> float:
    """From its onset until it was told, s."""
    return ((event.t_us - event.onset_us) % 2**32) / 1e6
