"""What an untouched finger costs on the link: frames against heartbeats in one simulated scenario.

Bytes are those of the FRAME, TARE and IDLE messages on the wire. Only device time and the simulated board's own
counters are used, so that the figures are the same on every machine.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import biotac
from biotac import Batch, Tare, TareState
from biotac.wire import DTYPES, OVERHEAD_BYTES, messages, slots

from ..report import Show, Table


def measure(source: str, show: Show = lambda text: None) -> list[Table]:
    """Play ``source`` (as for biotac.open, without ``sim:``) with frames at rest, then with heartbeats at rest."""
    eager, _ = _play(source, rest=True)
    lazy, status = _play(source, rest=False)
    rows = [
        ["in contact", *share(lazy, touched=True)],
        ["at rest, REST_FRAMES", *share(eager, touched=False)],
        ["at rest", *share(lazy, touched=False)],
    ]
    head = ["", "finger time [s]", "frames", "heartbeats", "bytes/s"]
    names = ("frames_idle", "poc_skipped", "force_skipped", "torque_skipped", "sigma_skipped")
    skipped = [[name, getattr(status, name)] for name in names]
    return [Table(f"Link, {source}", head, rows, digits=1), Table("Skipped at rest", ["counter", "rounds"], skipped)]


def _play(source: str, *, rest: bool) -> tuple[Batch, Any]:
    with biotac.open(f"sim:{source}") as hand:
        hand.stream("force", "poc", "torque", "pressure", rest=rest)
        batch = hand.read_batch(1e6)
        return batch, hand.status()


def share(batch: Batch, *, touched: bool) -> tuple[float, int, int, float]:
    """Finger time in s, frames, heartbeats and bytes/s of the part in which the finger is touched, or is not."""

    def counted(states: Any) -> Any:
        return (states == TareState.CONTACT) == touched

    frames = int(np.count_nonzero(counted(batch.wire["tare_state"])))
    tares = sum(isinstance(m, Tare) and counted(m.tare_state) for m in batch.messages)
    beats = 0 if touched else len(batch.idle)
    rounds = frames + (0 if touched else int(batch.idle["frames"].sum()))
    sizes = ((frames, messages.Frame.ID), (tares, messages.Tare.ID), (beats, messages.Idle.ID))
    total = sum(n * (DTYPES[message_id].itemsize + OVERHEAD_BYTES) for n, message_id in sizes)
    seconds = rounds * slots.FRAME_S
    return seconds, frames, beats, total / seconds if seconds else 0.0
