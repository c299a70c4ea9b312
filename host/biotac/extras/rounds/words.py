"""Messages as rounds of words: thinned to about 100 a second, PAC resampled, stale and foreign words omitted."""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...errors import PortError
from ...wire import messages_gen as wire
from ...wire import sensor_gen as sensor
from ...wire import slots
from .counts_check import CountsCheck
from .message import ALTERNATE_NS, Counts, Message
from .positions import Positions
from .rate import ROUND_US, Rate

TURNS = 4  # of two serial numbers: one that is damaged takes none
LATE_FIRST = 400  # messages with which a finger that is late in a file is checked
BURST = 5.0  # rounds that a source may be behind, and then send at once
PAC_HZ = sensor.SLOT_HZ / 2
CHANNELS = {*slots.SLOW_SLOTS, "pac"}
_NO_US = np.zeros(slots.SLOTS_PER_FRAME, np.uint32)


class WordRound(NamedTuple):
    """``words`` uint16 (44, 5); ``sp`` uint16 (5, 24), of the fingers in ``sp_fingers``, a bit mask."""

    words: NDArray[np.uint16]
    slot_us: NDArray[np.uint32]
    sp_fingers: int
    sp: NDArray[np.uint16]


EMPTY = WordRound(
    np.full((slots.SLOTS_PER_FRAME, sensor.MAX_SENSORS), wire.INVALID_COUNT, np.uint16),
    _NO_US,
    0,
    np.full((sensor.MAX_SENSORS, sensor.FOREIGN_ELECTRODES), wire.INVALID_COUNT, np.uint16),
)


class RoundMaker:
    """Makes rounds of a source's messages, with ``first`` as the first ones.

    ``notes``: news for the user, in words; ``checks`` and ``serials`` by finger. Raises PortError for a source
    without fingers, or with fewer than LEAST_HZ messages a second.
    """

    def __init__(self, port: str, first: list[Message], known: Iterable[int] = ()) -> None:
        self._port = port
        self._notes: list[str] = []
        self._unused: dict[tuple[int, str], str] = {}  # notes of channels of which nothing came yet
        self.serials: dict[int, bytes] = {}
        self._serial_before: dict[int, tuple[bytes, int, int]] = {}  # time of the last change, and turns so far
        self.checks: dict[int, CountsCheck] = {}
        self._stale_reported: dict[int, int] = {}
        self._channels: dict[int, set[str]] = {}  # in use, by finger
        self._whole: dict[int, bool] = {}  # each message of the finger has a round's PAC
        self._kept_ns: int | None = None
        self._due = 1.0  # rounds that the source is behind
        self._skipped: list[tuple[Counts | None, ...]] = []
        self.rate = rate = Rate(port, [message.stamp_ns for message in first])
        self.period_us = rate.step_us * rate.each
        if rate.each > 1:
            self.note(f"{1e6 / rate.step_us:.0f} messages a second: one in {rate.each} makes a round, with all PAC")
        # A driver that publishes at 100 Hz does not drift, and jitter must not shift PAC by a sample.
        is_100 = abs(self.period_us / ROUND_US - 1) < 0.05
        self._pac_slots = len(slots.PAC_SLOT) if is_100 else round(PAC_HZ * self.period_us / 1e6)
        if not is_100:
            slow = self.period_us / ROUND_US
            self.note(f"{100 / slow:.0f} rounds a second: what counts rounds takes {slow:.2f} times as long")
        self.timed = rate.each == 1 and all(message.slot_us is not None for message in first)
        self.positions = Positions([*known, *(p for message in first for p in message.positions)])
        placed = [self.positions.fingers(message) for message in first]
        for f in range(sensor.MAX_SENSORS):
            if counts := [own for fingers in placed if (own := fingers[f]) is not None]:
                self._begin(f, counts)
        if not self.checks:
            raise PortError(f"{port}: {len(first)} messages, and all counts are zero: no sensor")

    @property
    def notes(self) -> list[str]:
        return [*self.positions.notes(), *self._notes, *self._unused.values()]

    def note(self, text: str) -> None:
        """Add ``text`` unless it is there."""
        if text not in self._notes and len(self._notes) < 100:
            self._notes.append(text)

    def _begin(self, f: int, counts: list[Counts]) -> None:
        size = len(counts[-1].electrodes)
        counts = [own for own in counts if len(own.electrodes) == size]
        self.checks[f] = check = CountsCheck(counts)
        self.serials[f] = counts[-1].serial
        self._channels[f] = set()
        if check.foreign:
            self.note(f"finger {f}: {check.foreign}")
        has_pac = any(own.pac.any() for own in counts)
        self._whole[f] = self.rate.each == 1 and all(len(own.pac) == len(slots.PAC_SLOT) for own in counts)
        due = len(slots.PAC_SLOT) if self._whole[f] else self._pac_slots
        samples = sum(len(own.pac) for own in counts) / len(counts) * self.rate.each if has_pac else 0.0
        if samples < 0.5 * due:
            text = f"finger {f}: {samples:.0f} of {due} samples of PAC a round: no vibration, no JOLT and no SLIP"
            self.note(text) if has_pac else self._unused.setdefault((f, "pac"), text)
        elif round(samples) != due:
            self.note(f"finger {f}: PAC at {samples / self.period_us * 1e6:.0f} Hz is resampled to {PAC_HZ:.0f} Hz")
        if not any(own.pdc for own in counts):
            self._unused[f, "pdc"] = f"finger {f}: no static pressure"

    def look_at(self, messages: Iterable[Message]) -> None:
        """Check all of a file's messages, so that a foreign sensor has no force from the first round on."""
        late: dict[int, list[Counts]] = {}
        self._restart()
        for message in messages:
            for f, own in enumerate(self.positions.fingers(message)):
                if own is not None and f in self.checks:
                    self._checked(f, own, message.stamp_ns)
                elif own is not None:
                    late.setdefault(f, []).append(own)
                    if len(late[f]) == LATE_FIRST:
                        self._begin(f, late.pop(f))
        for f, counts in late.items():
            self._begin(f, counts)
        self._restart()

    def _restart(self) -> None:
        """From a file's first message once more."""
        self._serial_before.clear()
        for f, check in self.checks.items():
            check.begin()
            self._channels[f] = set()

    def _checked(self, f: int, own: Counts, ns: int) -> NDArray[np.uint16]:
        """A finger's electrodes as words; also notes stale and foreign ones."""
        if f not in self.checks:
            self._begin(f, [own])
        check, used = self.checks[f], self._channels[f]
        if own.serial and own.serial != self.serials[f]:
            before, before_ns, turns = self._serial_before.get(f, (b"", 0, 0))
            turns = turns + 1 if own.serial == before and ns - before_ns < ALTERNATE_NS else 0
            if turns == TURNS:
                both = f"{before.decode()} and {self.serials[f].decode()}"
                raise PortError(f"{self._port}: finger {f} is {both} in turns; expected one hand a topic")
            self._serial_before[f] = self.serials[f], ns, turns
            self.serials[f] = own.serial
        words = check.words(own)
        # A channel that is zero throughout was never sent.
        for name in CHANNELS - used:
            if own.pac.any() if name == "pac" else getattr(own, name):
                used.add(name)
                self._unused.pop((f, name), None)
        if check.foreign:
            self.note(f"finger {f}: {check.foreign}")
        if new := check.stale & ~self._stale_reported.get(f, 0):
            self._stale_reported[f] = self._stale_reported.get(f, 0) | new
            names = [name for k, name in enumerate(sensor.ELECTRODE_NAMES) if new >> k & 1]
            self.note(f"finger {f}: {', '.join(names)} repeat one count while others do not, and count as missing")
        return words

    def add(self, message: Message) -> WordRound | None:
        """The round that this message completes, if it does."""
        fingers = self.positions.fingers(message)
        if self._is_early(message.stamp_ns):
            self._skipped.append(fingers)
            return None
        words, sp = EMPTY.words.copy(), EMPTY.sp.copy()
        sp_fingers = 0
        for f, own in enumerate(fingers):
            if own is None:
                continue
            words[slots.ELECTRODE_SLOT, f] = self._checked(f, own, message.stamp_ns)
            for name, slot in slots.SLOW_SLOTS.items():
                word = getattr(own, name) if name in self._channels[f] else None
                words[slot, f] = wire.INVALID_COUNT if word is None else word
            if "pac" in self._channels[f]:
                parts = [skipped[f] for skipped in self._skipped]
                pac = np.concatenate([*(part.pac for part in parts if part is not None), own.pac])
                whole = self._whole[f] and len(own.pac) == len(slots.PAC_SLOT)
                words[slots.PAC_SLOT, f] = (
                    resampled(own.pac, len(own.pac)) if whole else resampled(pac, self._pac_slots)
                )
            if len(own.electrodes) == sensor.FOREIGN_ELECTRODES:
                good = (own.electrodes >= 0) & (own.electrodes <= sensor.FULL_SCALE_COUNT)
                sp[f] = np.where(good, own.electrodes, wire.INVALID_COUNT)
                sp_fingers |= 1 << f
        self._skipped = []
        slot_us = message.slot_us if self.timed and message.slot_us is not None else _NO_US
        return WordRound(words, slot_us, sp_fingers, sp)

    def _is_early(self, ns: int) -> bool:
        """Whether a message waits for the next: of a fast source, or one of more than the source owes after a pause."""
        since_us = np.inf if self._kept_ns is None else (ns - self._kept_ns) / 1e3
        early = 0 <= since_us < self.period_us - self.rate.step_us / 2
        if early and (self.rate.each > 1 or self._due + since_us / self.period_us < 1):
            return True
        self._due = min(BURST, max(0.0, self._due + since_us / self.period_us - 1)) if self._kept_ns else 1.0
        self._kept_ns = ns
        return False


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
