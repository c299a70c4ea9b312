"""What became of the words that the sensors sent."""

from __future__ import annotations

from collections.abc import Iterator

from ..wire import sensor_gen as sensor
from .catalogue import Finding
from .facts import Facts

KINDS = {"words_stuck": "of 0x0000 or 0xFFFF", "words_parity": "with bad parity", "words_error": "that are error words"}


def check(facts: Facts) -> Iterator[Finding]:
    """Stuck, damaged and refused; of sensors that are there, since an open chip select reads as stuck for ever."""
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
