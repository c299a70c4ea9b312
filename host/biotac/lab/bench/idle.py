"""What an untouched finger costs on the link: frames against heartbeats in one simulated scenario.

Bytes are those of the FRAME, TARE and IDLE messages on the wire. Only device time and the simulated board's own
counters are used, so that the figures are the same on every machine.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

import biotac

from ...hand.subscription import RESULTS
from ...wire import messages_gen as wire
from ...wire.batches import Batch
from ...wire.dtypes_gen import DTYPES
from ...wire.framing import OVERHEAD_BYTES
from ...wire.slots import FRAME_S


@dataclass(frozen=True)
class Share:
    """The part of the stream in which the finger is touched, or is not."""

    seconds: float  # finger time
    frames: int
    heartbeats: int
    bytes_per_s: float  # per finger


@dataclass(frozen=True)
class Outcome:
    """``saved_percent`` compares bytes per second at rest with heartbeats with those in contact."""

    source: str
    rest_with_frames: Share
    rest_with_heartbeats: Share
    contact: Share
    saved_percent: float
    skipped: dict[str, int]  # STATUS counters of the run with heartbeats


def measure(source: str) -> Outcome:
    """Play ``source`` (as for biotac.open, without ``sim:``) with frames at rest, then with heartbeats at rest."""
    eager, _ = _play(source, RESULTS | wire.QuantityFlags.REST_FRAMES)
    lazy, status = _play(source, RESULTS)
    rest, contact = _share(lazy, touched=False), _share(lazy, touched=True)
    saved = 100 * (1 - rest.bytes_per_s / contact.bytes_per_s) if contact.bytes_per_s else float("nan")
    skipped = {
        name: getattr(status, name)
        for name in ("frames_idle", "poc_skipped", "force_skipped", "torque_skipped", "sigma_skipped")
    }
    return Outcome(source, _share(eager, touched=False), rest, contact, saved, skipped)


def _play(source: str, quantities: wire.QuantityFlags) -> tuple[Batch, wire.Status]:
    with biotac.open(f"sim:{source}") as hand:
        hand.subscribe(quantities)
        hand.start(pac=False)
        batch = hand.read_batch(1e6)
        return batch, hand.status()


def _share(batch: Batch, *, touched: bool) -> Share:
    """Split by the tare state in each message."""

    def mine(states: Any) -> Any:
        return (states == wire.TareState.CONTACT) == touched

    frames = int(np.count_nonzero(mine(batch.wire["tare_state"])))
    tares = sum(isinstance(m, wire.Tare) and mine(m.tare_state) for m in batch.messages)
    beats = 0 if touched else len(batch.idle)
    rounds = frames + (0 if touched else int(batch.idle["frames"].sum()))
    sizes = ((frames, wire.Frame.ID), (tares, wire.Tare.ID), (beats, wire.Idle.ID))
    total = sum(n * (DTYPES[message_id].itemsize + OVERHEAD_BYTES) for n, message_id in sizes)
    seconds = rounds * FRAME_S
    return Share(seconds, frames, beats, total / seconds if seconds else 0.0)
