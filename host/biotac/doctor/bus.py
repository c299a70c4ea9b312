"""Checks the words received from the sensors."""

from __future__ import annotations

from collections.abc import Iterator

from ..wire import sensor_gen as sensor
from .catalogue import Finding
from .facts import Facts

KINDS = {"words_stuck": "are 0x0000 or 0xFFFF", "words_parity": "have bad parity", "words_error": "are error words"}


def check(facts: Facts) -> Iterator[Finding]:
    """Stuck words, parity errors and error words, of sensors that are present: an open chip select reads as stuck."""
    board = facts.board
    for finger in board.present if board else []:
        assert board is not None
        words = {kind: board.more(finger, kind) for kind in ("words_good", *KINDS)}
        total = sum(words.values())
        for kind, what in KINDS.items():
            if words[kind]:
                seen = f"finger {finger}: {words[kind]} of {total} words {what}"
                last = board.sensors_after[finger].last_error_word
                if kind == "words_error" and last:
                    seen += f", the last 0x{last:04X} ({sensor.ERROR_WORD.get(last, 'not in the manual')})"
                yield Finding(kind, seen)
