"""Facts of EVENT messages beyond the fields."""

from __future__ import annotations

from .messages_gen import Event, EventKind


def kind_name(event: Event) -> str:
    """Name of the event's kind, as in EventKind; the number if this release does not know it."""
    return EventKind(event.kind).name if event.kind in list(EventKind) else str(event.kind)


def event_age_s(event: Event) -> float:
    """Time from the event's onset until the board sent it, in s."""
    return ((event.t_us - event.onset_us) % 2**32) / 1e6
