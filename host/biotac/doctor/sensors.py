"""Checks which sensors are there, and whether they belong together."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..wire import messages_gen as wire
from ..wire.identity import ascii_text
from .catalogue import Finding
from .facts import BoardFacts, Facts


def check(facts: Facts) -> Iterator[Finding]:
    """Wrong type, none, too few, lost or changed while listening, equal serial numbers, different versions."""
    board = facts.board
    if board is None:
        return
    for sensor in board.sensors:
        if not sensor.present and (serial := ascii_text(sensor.serial)):
            yield Finding(
                "wrong_sensor", f"finger {sensor.finger} is {serial}, which is not a BioTac with 19 electrodes"
            )
    if not board.present:
        yield Finding("no_sensor", "no sensor answers on any of the five chip selects")
        return
    expected = facts.expected_fingers
    if expected is not None and len(board.present) < expected:
        there = ", ".join(map(str, board.present))
        yield Finding("sensor_missing", f"{len(board.present)} of {expected} sensors answer: finger {there}")
    yield from _lost(board)
    yield from _changed(board)
    yield from _serials(board)


def _lost(board: BoardFacts) -> Iterator[Finding]:
    for finger in board.present:
        came = (board.frames["finger"] == finger).any() or (board.idle["finger"] == finger).any()
        if not came:
            yield Finding("sensor_lost", f"finger {finger} sent no frame")
        elif not board.after.fingers_present >> finger & 1:
            yield Finding("sensor_lost", f"finger {finger} stopped answering")


def _changed(board: BoardFacts) -> Iterator[Finding]:
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


def _serials(board: BoardFacts) -> Iterator[Finding]:
    by_serial: dict[str, list[int]] = {}
    kinds: dict[tuple[str, str], list[int]] = {}
    for sensor in (its for its in board.sensors if its.present):
        by_serial.setdefault(ascii_text(sensor.serial), []).append(sensor.finger)
        kind = ascii_text(sensor.flex_version), ascii_text(sensor.software_version)
        kinds.setdefault(kind, []).append(sensor.finger)
    for serial, fingers in by_serial.items():
        if len(fingers) > 1:
            yield Finding("same_serial", f"fingers {', '.join(map(str, fingers))} all report serial number {serial}")
    if len(kinds) > 1:
        words = [f"finger {', '.join(map(str, f))}: flex {flex}, software {sw}" for (flex, sw), f in kinds.items()]
        yield Finding("mixed_sensors", "; ".join(words))
