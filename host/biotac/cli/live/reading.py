"""Reading a board for as long as a verb runs."""

from __future__ import annotations

from collections.abc import Iterator

import biotac

from ..outputs import note


def batches(hand: biotac.Hand, seconds: float | None) -> Iterator[tuple[biotac.Batch, float]]:
    """Batches, each with the device time since the first, until ``seconds`` of it have passed."""
    first_us: int | None = None
    passed_s = 0.0
    for batch in hand.batches():
        last_us = batch.last_t_us()
        if last_us is not None:
            first_us = batch.first_t_us() if first_us is None else first_us
            passed_s = (last_us - (first_us or 0)) / 1e6
        yield batch, passed_s
        if seconds is not None and passed_s >= seconds:
            break


def tell_lost(hand: biotac.Hand) -> None:
    """Say on stderr how many frames were lost, if any."""
    if hand.stats.frames_lost:
        cure = "close other programs, or use a faster computer"
        note(f"{hand.stats.frames_lost} frame(s) lost; {cure}")
