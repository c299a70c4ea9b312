"""What arrives during a given time of the board's clock."""

from __future__ import annotations

from collections.abc import Iterator

from ..wire import messages_gen as wire
from ..wire.batches import Batch, join, split


def take(batches: Iterator[Batch], seconds: float, *, silence_s: float) -> tuple[Batch, Batch | None]:
    """The next ``seconds`` of device time, and the later rows that came with the last of them, None without any.

    Less when ``batches`` end, or when no row comes while the board's statuses advance by ``seconds + silence_s``.
    Raises ValueError unless ``seconds`` is a finite number above 0.
    """
    if not 0 < seconds < float("inf"):
        raise ValueError(f"seconds is {seconds}, expected a number above 0")
    taken: list[Batch] = []
    end_us: int | None = None
    first_status_us: int | None = None
    for batch in batches:
        for status in (m for m in batch.messages if isinstance(m, wire.Status)):
            first_status_us = status.t_us if first_status_us is None else first_status_us
            if end_us is None and (status.t_us - first_status_us) % 2**32 > (seconds + silence_s) * 1e6:
                return join(taken), None  # the board is there, its sensors are not
        first_us, last_us = batch.first_t_us(), batch.last_t_us()
        if end_us is None and first_us is not None:
            end_us = first_us + round(seconds * 1e6)
        if end_us is None or last_us is None or last_us < end_us:
            taken.append(batch)
            continue
        now, later = split(batch, end_us)
        return join([*taken, now]), later
    return join(taken), None
