"""Messages as rounds of words: thinned to about 100 a second, PAC resampled, stale and foreign words left out."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import PortError
from ..wire import messages_gen as wire
from ..wire import sensor_gen as sensor
from ..wire import slots
from .judge import Judge
from .message import Message

ROUND_US = 10_000
# More between two messages, and the fingers fell silent meanwhile: the tare machine's measure of that (SPEC.md).
SILENCE_US = 90_000
LEAST_HZ, MOST_HZ = 50.0, 125.0
PAC_HZ = sensor.SLOT_HZ / 2
SLOW = {"pdc": slots.PDC_SLOT, "tac": slots.TAC_SLOT, "tdc": slots.TDC_SLOT}
_NO_US = np.zeros(slots.SLOTS_PER_FRAME, np.uint32)


class Round(NamedTuple):
    """``words`` uint16 (44, 5); ``sp`` uint16 (5, 24), of the fingers in ``sp_fingers``, a bit mask."""

    words: NDArray[np.uint16]
    slot_us: NDArray[np.uint32]
    sp_fingers: int
    sp: NDArray[np.uint16]


EMPTY = Round(
    np.full((slots.SLOTS_PER_FRAME, sensor.MAX_SENSORS), wire.INVALID_COUNT, np.uint16),
    _NO_US,
    0,
    np.full((sensor.MAX_SENSORS, sensor.FOREIGN_ELECTRODES), wire.INVALID_COUNT, np.uint16),
)


class Rounds:
    """Makes rounds of a source's messages, of which ``first`` are the first.

    ``notes``: what a user should know, in words; ``judges`` and ``serials`` by finger. Raises PortError for a source
    without fingers, or with fewer than LEAST_HZ messages a second.
    """

    def __init__(self, port: str, first: list[Message]) -> None:
        self.notes: list[str] = []
        self.serials: dict[int, bytes] = {}
        self.judges: dict[int, Judge] = {}
        self._channels: dict[int, set[str]] = {}  # in use, by finger
        self._kept_ns: int | None = None
        self._skipped: list[Message] = []
        steps_us = np.diff([message.stamp_ns for message in first]) / 1e3
        steps_us = steps_us[steps_us > 0]
        quick_us = steps_us[steps_us < SILENCE_US]
        used_us = quick_us if 2 * len(quick_us) > len(steps_us) else steps_us
        period_us = float(used_us.mean()) if len(used_us) else np.inf
        if period_us > 1e6 / LEAST_HZ:
            raise PortError(
                f"{port}: {len(first)} messages at {1e6 / period_us:.0f} a second, expected {LEAST_HZ:.0f} to "
                f"{MOST_HZ:.0f}, as tare and contact count rounds; let the driver publish at 100 Hz"
            )
        self._each = max(1, round(ROUND_US / period_us)) if period_us < 1e6 / MOST_HZ else 1
        self._step_us = period_us
        self.period_us = period_us * self._each
        if self._each > 1:
            self.note(f"{1e6 / period_us:.0f} messages a second: one in {self._each} makes a round, with all PAC")
        # A driver that publishes at 100 Hz does not drift, and jitter must not shift PAC by a sample.
        is_100 = abs(self.period_us / ROUND_US - 1) < 0.05
        self._pac_slots = len(slots.PAC_SLOT) if is_100 else round(PAC_HZ * self.period_us / 1e6)
        if not is_100:
            slow = self.period_us / ROUND_US
            self.note(f"{100 / slow:.0f} rounds a second: what counts rounds takes {slow:.2f} times as long")
        self.timed = self._each == 1 and all(message.slot_us is not None for message in first)
        for f in range(sensor.MAX_SENSORS):
            if messages := [message for message in first if message.fingers[f] is not None]:
                self._begin(f, messages)
        if not self.judges:
            raise PortError(f"{port}: {len(first)} messages, and all counts are zero: no sensor")

    def note(self, text: str) -> None:
        """Add ``text`` unless it is there."""
        if text not in self.notes and len(self.notes) < 100:
            self.notes.append(text)

    def _begin(self, f: int, messages: list[Message]) -> None:
        counts = [own for message in messages if (own := message.fingers[f]) is not None]
        size = len(counts[-1].electrodes)
        counts = [own for own in counts if len(own.electrodes) == size]
        self.judges[f] = judge = Judge(counts)
        self.serials[f] = counts[-1].serial
        if judge.foreign:
            self.note(f"finger {f}: {judge.foreign}")
        # What is zero throughout was never sent.
        slow = {name for name in SLOW if any(getattr(own, name) for own in counts)}
        self._channels[f] = slow | ({"pac"} if any(own.pac.any() for own in counts) else set())
        samples = sum(len(own.pac) for own in counts) / len(counts) * self._each if "pac" in self._channels[f] else 0.0
        if samples < 0.5 * self._pac_slots:
            seen = f"{samples:.0f} of {self._pac_slots} samples of PAC a round"
            self.note(f"finger {f}: {seen}: no vibration, no JOLT and no SLIP")
        elif round(samples) != self._pac_slots:
            self.note(f"finger {f}: PAC at {samples / self.period_us * 1e6:.0f} Hz is resampled to {PAC_HZ:.0f} Hz")
        if "pdc" not in slow:
            self.note(f"finger {f}: no static pressure")

    def look_at(self, messages: Iterable[Any]) -> None:
        """Judge all of a file's messages, so that what is foreign has no force from the first round on."""
        for message in messages:
            for f, own in enumerate(message.fingers if isinstance(message, Message) else ()):
                if own is not None:
                    self._judge(f, message).words(own)

    def _judge(self, f: int, message: Message) -> Judge:
        if f not in self.judges:
            self._begin(f, [message])
        return self.judges[f]

    def add(self, message: Message) -> Round | None:
        """The round that this message completes, if it does."""
        due_us = self.period_us - self._step_us / 2
        if self._kept_ns is not None and self._each > 1 and (message.stamp_ns - self._kept_ns) / 1e3 < due_us:
            self._skipped.append(message)
            return None
        self._kept_ns = message.stamp_ns
        words, sp = EMPTY.words.copy(), EMPTY.sp.copy()
        sp_fingers = 0
        for f, own in enumerate(message.fingers):
            if own is None:
                continue
            judge = self._judge(f, message)
            words[slots.ELECTRODE_SLOT, f] = judge.words(own)
            for name, slot in SLOW.items():
                word = getattr(own, name) if name in self._channels[f] else None
                words[slot, f] = wire.INVALID_COUNT if word is None else word
            if "pac" in self._channels[f]:
                parts = [skipped.fingers[f] for skipped in self._skipped]
                pac = np.concatenate([*(part.pac for part in parts if part is not None), own.pac])
                words[slots.PAC_SLOT, f] = resampled(pac, self._pac_slots)
            if len(own.electrodes) == sensor.FOREIGN_ELECTRODES:
                good = (own.electrodes >= 0) & (own.electrodes <= sensor.FULL_SCALE_COUNT)
                sp[f] = np.where(good, own.electrodes, wire.INVALID_COUNT)
                sp_fingers |= 1 << f
            if own.serial:
                self.serials[f] = own.serial
            if judge.foreign:
                self.note(f"finger {f}: {judge.foreign}")
            if judge.stale:
                names = [name for k, name in enumerate(sensor.ELECTRODE_NAMES) if judge.stale >> k & 1]
                self.note(f"finger {f}: {', '.join(names)} repeat one count while others do not, and count as missing")
        self._skipped = []
        slot_us = message.slot_us if self.timed and message.slot_us is not None else _NO_US
        return Round(words, slot_us, sp_fingers, sp)


def resampled(pac: NDArray[np.int64], slots_due: int) -> NDArray[np.uint16]:
    """PAC (22,) at 2200 Hz from samples (n,) spread evenly over a round of ``slots_due`` of those: the latest ones.

    INVALID_COUNT where there are none, throughout where there are less than half.
    """
    out = np.full(len(slots.PAC_SLOT), wire.INVALID_COUNT, np.uint16)
    if len(pac) < 0.5 * slots_due:
        return out
    good = (pac >= 0) & (pac <= sensor.FULL_SCALE_COUNT)
    if len(pac) != slots_due:
        if not good.all():
            return out
        due = np.arange(1, slots_due + 1) / slots_due
        pac = np.rint(np.interp(due, np.arange(1, len(pac) + 1) / len(pac), pac)).astype(np.int64)
        good = np.ones(len(pac), bool)
    n = min(len(out), len(pac))
    out[len(out) - n :] = np.where(good, pac, wire.INVALID_COUNT)[-n:]
    return out
