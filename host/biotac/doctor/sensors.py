"""Checks which sensors are there, whether they belong together, and the words received from them."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..wire import messages_gen as wire
from ..wire import sensor_gen
from ..wire.identity import ascii_text, is_foreign
from .catalogue import Finding
from .facts import ExaminedBoard

WORDS = {"words_stuck": "are 0x0000 or 0xFFFF", "words_parity": "have bad parity", "words_error": "are error words"}


def check(board: ExaminedBoard, expected: int | None) -> Iterator[Finding]:
    """Wrong type, none, fewer than ``expected``, lost or changed while listening, equal serials, damaged words."""
    for sensor in board.sensors:
        if not sensor.present and (serial := ascii_text(sensor.serial)):
            if is_foreign(sensor.serial):
                reason = "which is not a BioTac with 19 electrodes"
                yield Finding("wrong_sensor", f"finger {sensor.finger} is {serial}, {reason}")
            else:
                yield Finding("sensor_lost", f"finger {sensor.finger}, {serial}, was unplugged")
    if not board.present:
        yield Finding("no_sensor", f"no sensor answers on any of {board.hello.fingers} chip selects")
        return
    if expected is not None and len(board.present) < expected:
        fingers = ", ".join(map(str, board.present))
        yield Finding("sensor_missing", f"{len(board.present)} of {expected} sensors answer: finger {fingers}")
    yield from _lost(board)
    yield from _changed(board)
    yield from _serials(board)
    yield from _words(board)


def _lost(board: ExaminedBoard) -> Iterator[Finding]:
    for finger in board.present:
        if not (board.frames["finger"] == finger).any() and not (board.idle["finger"] == finger).any():
            yield Finding("sensor_lost", f"finger {finger} sent no frame")
        elif not board.after.fingers_present >> finger & 1:
            yield Finding("sensor_lost", f"finger {finger} stopped answering")


def _changed(board: ExaminedBoard) -> Iterator[Finding]:
    for finger in board.present:
        rows = [some[some["finger"] == finger] for some in (board.frames, board.idle)]
        t_us = np.concatenate([some["t_us"] for some in rows])
        flags = np.concatenate([some["flags"] for some in rows])[np.argsort(t_us, kind="stable")]
        unsure = flags & wire.FrameFlags.SENSOR_UNSURE != 0
        other = flags & wire.FrameFlags.SENSOR_OTHER != 0
        if other.any():
            yield Finding("sensor_other", f"finger {finger}: a different sensor answers than when the stream began")
        elif unsure[-1:].any():  # one that has identified itself since is reported by its lost words instead
            seen = f"finger {finger} was away and has not identified itself since"
            yield Finding("sensor_unsure", f"{seen}: {unsure.sum()} of {len(flags)} messages are unsure")


def _serials(board: ExaminedBoard) -> Iterator[Finding]:
    by_serial: dict[str, list[int]] = {}
    kinds: dict[tuple[str, str], list[int]] = {}
    for sensor in (info for info in board.sensors if info.present):
        by_serial.setdefault(ascii_text(sensor.serial), []).append(sensor.finger)
        kind = ascii_text(sensor.flex_version), ascii_text(sensor.software_version)
        kinds.setdefault(kind, []).append(sensor.finger)
    for serial, fingers in by_serial.items():
        if len(fingers) > 1:
            yield Finding("same_serial", f"fingers {', '.join(map(str, fingers))} all report serial number {serial}")
    if len(kinds) > 1:
        versions = [f"finger {', '.join(map(str, f))}: flex {flex}, software {sw}" for (flex, sw), f in kinds.items()]
        yield Finding("mixed_sensors", "; ".join(versions))


def _words(board: ExaminedBoard) -> Iterator[Finding]:
    """Stuck words, parity errors and error words, of sensors that are present: an open chip select reads as stuck."""
    for finger in board.present:
        words = {kind: board.more(finger, kind) for kind in ("words_good", *WORDS)}
        for kind, text in WORDS.items():
            if words[kind]:
                seen = f"finger {finger}: {words[kind]} of {sum(words.values())} words {text}"
                last = board.sensors_after[finger].last_error_word
                if kind == "words_error" and last:
                    seen += f", the last 0x{last:04X} ({sensor_gen.ERROR_WORD.get(last, 'not in the manual')})"
                yield Finding(kind, seen)
