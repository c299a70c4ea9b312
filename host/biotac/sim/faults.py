"""Faults of a sensor or of the wires, laid over a healthy finger's words round by round.

The caller names the finger (``Faulty``) and passes words of n rounds at a time, (n, 44). A fault's memory (the count at
which an electrode sticks, how far a floating one has walked) goes on from call to call, so that the result does not
depend on how the rounds are cut. INVALID_COUNT stands where no good word came.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..errors import InputError
from ..kernels.geometry import Floats
from ..wire import sensor_gen as _sensor
from ..wire.messages_gen import INVALID_COUNT
from ..wire.slots import ELECTRODE_SLOT, FRAME_S, PDC_SLOT, SLOTS_PER_FRAME, TDC_SLOT
from .fault_gen import EmuFault
from .sampling import Words


@dataclass
class Faulty:
    """The finger that a fault is laid on.

    ``electrode`` is the index, 0 to 18, of the one that breaks; ``rest`` (19,) are the finger's counts at rest and
    ``other_rest`` (19,) those of the finger beside it, with the words ``other``.
    """

    electrode: int
    rest: Floats
    other_rest: Floats
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(0))
    rounds: int = 0  #: since the fault began
    kept: Any = None  #: the fault's memory of the rounds before

    def time_s(self, n: int) -> Floats:
        """The times (n,) of the next rounds since it began; they are counted."""
        self.rounds += n
        return np.asarray((self.rounds - n + np.arange(n)) * FRAME_S, np.float64)

    def first(self, now: Any) -> Any:
        """``now`` of the first call, for ever."""
        if self.kept is None:
            self.kept = now
        return self.kept


#: Lays itself over words (n, 44) of a finger, given those of the finger beside it, and returns new ones.
Fault = Callable[[Faulty, Words, Words], Words]


def _slot_fault(slots: Any, change: Callable[[Faulty, Floats, Floats], Any]) -> Fault:
    """A fault of these slots alone, an index, by their counts and the other finger's, float64.

    ``change`` returns counts of any size: they are rounded, and held within the converter's range.
    """

    def fault(on: Faulty, words: Words, other: Words) -> Words:
        bad: Words = words.copy()
        counts = change(on, words[:, slots].astype(float), other[:, slots].astype(float))
        bad[:, slots] = np.clip(np.rint(counts), 0, _sensor.FULL_SCALE_COUNT)
        return bad

    return fault


def electrode_fault(change: Callable[[Faulty, Floats, Floats], Floats]) -> Fault:
    """A fault of the electrodes' counts (n, 19), given and returned as float64; ``t_s`` (n,) is the time."""
    return _slot_fault(ELECTRODE_SLOT, lambda on, counts, _: change(on, counts, on.time_s(len(counts))))


def _of_electrode(change: Callable[[Faulty, Floats, Floats], Floats]) -> Fault:
    """The same of the electrode that breaks, counts (n,)."""

    def electrodes(on: Faulty, counts: Floats, t_s: Floats) -> Floats:
        counts[:, on.electrode] = change(on, counts[:, on.electrode].copy(), t_s)
        return counts

    return electrode_fault(electrodes)


def _walks(on: Faulty, x: Floats, _: Floats) -> Floats:
    start, walked = on.first((x[0], 0.0))
    path = walked + np.cumsum(on.rng.normal(0, 20, len(x)))
    on.kept = start, path[-1]
    result: Floats = start + path
    return result


def _exchange(on: Faulty, counts: Floats, _: Floats) -> Floats:
    pair = [on.electrode, (on.electrode + 7) % counts.shape[1]]
    counts[:, pair] = counts[:, pair[::-1]]
    return counts


def _freeze(slots: Iterable[int]) -> Fault:
    columns = np.array(list(slots))

    def fault(on: Faulty, words: Words, other: Words) -> Words:
        bad: Words = words.copy()
        bad[:, columns] = on.first(words[0, columns].copy())
        return bad

    return fault


def _shifted(on: Faulty, words: Words, other: Words) -> Words:
    line = words.reshape(-1)
    before = line[0] if on.kept is None else on.kept
    on.kept = line[-1]
    return np.concatenate([[before], line[:-1]]).astype(words.dtype).reshape(words.shape)


_PARITY = np.array([bin(byte).count("1") & 1 for byte in range(256)], bool)


def noisy_line(a_bit: float) -> Fault:
    """Every bit flips with this chance; errors that parity does not show are believed."""

    def fault(on: Faulty, words: Words, other: Words) -> Words:
        counts = words.astype(np.uint16)
        sent = np.stack([counts >> 5 << 1, (counts & 31) << 3], axis=-1).astype(np.uint8)
        sent |= ~_PARITY[sent]  # the last bit makes each byte's parity odd
        sent ^= np.packbits(on.rng.random((*sent.shape, 8)) < a_bit, axis=-1)[..., 0]
        good = _PARITY[sent].all(axis=-1)
        read = (sent[..., 0].astype(np.uint16) >> 1 << 5) + (sent[..., 1] >> 3)
        return np.where(good, read, INVALID_COUNT).astype(np.uint16)

    return fault


EXCHANGED = "two fingers exchanged"
FAULTS: dict[str, Fault] = {
    "electrode open": _of_electrode(lambda on, x, t: np.full_like(x, 4095)),
    "electrode shorted": _of_electrode(lambda on, x, t: np.zeros_like(x)),
    "electrode floating: walks 20 counts a round": _of_electrode(_walks),
    "electrode floating: uniform noise": _of_electrode(lambda on, x, t: on.rng.uniform(1, 4089, len(x))),
    "electrode with noise of 200 counts": _of_electrode(lambda on, x, t: x + on.rng.normal(0, 200, len(x))),
    "electrode stuck": _of_electrode(lambda on, x, t: np.full_like(x, on.first(x[0]))),
    "electrode at half gain": _of_electrode(lambda on, x, t: on.rest[on.electrode] + (x - on.rest[on.electrode]) / 2),
    "electrode drifts 10 counts/s": _of_electrode(lambda on, x, t: x - 10 * t),
    "electrode drifts 50 counts/s": _of_electrode(lambda on, x, t: x - 50 * t),
    "electrode drifts 200 counts/s": _of_electrode(lambda on, x, t: x - 200 * t),
    "all electrodes drift 1 count/s": electrode_fault(lambda on, x, t: x - 1 * t[:, None]),
    "all electrodes drift 5 counts/s": electrode_fault(lambda on, x, t: x - 5 * t[:, None]),
    "all electrodes drift 20 counts/s": electrode_fault(lambda on, x, t: x - 20 * t[:, None]),
    "all electrodes jump by 50": electrode_fault(lambda on, x, t: x - 50),
    "noise of 30 counts on all electrodes": electrode_fault(lambda on, x, t: x + on.rng.normal(0, 30, x.shape)),
    "two electrodes' wires exchanged": electrode_fault(_exchange),
    "the same words for ever": _freeze(range(SLOTS_PER_FRAME)),
    "electrodes frozen, pressure alive": _freeze(ELECTRODE_SLOT),
    "channels shifted by a slot": _shifted,
    EXCHANGED: lambda on, words, other: other.copy(),
    "cross-talk of 30 % between fingers": _slot_fault(ELECTRODE_SLOT, lambda on, x, y: x + 0.3 * (y - on.other_rest)),
    "cross-talk of 100 % between fingers": _slot_fault(ELECTRODE_SLOT, lambda on, x, y: x + (y - on.other_rest)),
    "noisy line, 1e-3 a bit": noisy_line(1e-3),
    "noisy line, 3e-3 a bit": noisy_line(3e-3),
    "TDC jumps by 300 counts": _slot_fault(TDC_SLOT, lambda on, x, y: x + 300),
    "PDC stuck": _slot_fault(PDC_SLOT, lambda on, x, y: on.first(x[0])),
    "PDC 0": _slot_fault(PDC_SLOT, lambda on, x, y: 0.0),
    "PDC 4095": _slot_fault(PDC_SLOT, lambda on, x, y: 4095.0),
}

#: These are between a finger and the one beside it.
BETWEEN_FINGERS = (EXCHANGED, "cross-talk of 30 % between fingers", "cross-talk of 100 % between fingers")

#: A sensor's or lead's behaviour on the bus, in place of counts.
BUS_FAULTS = {
    "bad_parity": EmuFault.BAD_PARITY,
    "stuck_low": EmuFault.STUCK_LOW,
    "stuck_high": EmuFault.STUCK_HIGH,
    "error_word": EmuFault.TOO_EARLY,
    "no_channel": EmuFault.NO_CHANNEL,
    "unplugged": EmuFault.UNPLUGGED,
    "swapped": EmuFault.SWAPPED,
}
EVERY_FAULT = (*FAULTS, *BUS_FAULTS)
IS_CHANNEL = {name: np.array(_sensor.SLOTS) == name for name in _sensor.SLOTS}


def fault_named(name: str, channel: str | None = None) -> Fault:
    """A fault of FAULTS, with or without the leading "electrode", or of BUS_FAULTS, on ``channel`` or all.

    A bus fault gives tape codes in place of counts. Raises InputError for an unknown name, or channel of the bus.
    """
    for known in (name, f"electrode {name}"):
        if known in FAULTS:
            return FAULTS[known]
    if name not in BUS_FAULTS:
        raise InputError(f"no fault {name!r}, expected one of: {', '.join(EVERY_FAULT)}")
    if channel is not None and channel not in IS_CHANNEL:
        raise InputError(f"channel is {channel!r}, expected one of: {', '.join(IS_CHANNEL)}")
    code, hit = BUS_FAULTS[name], np.ones(SLOTS_PER_FRAME, bool) if channel is None else IS_CHANNEL[channel]

    def fault(on: Faulty, words: Words, other: Words) -> Words:
        return np.where(hit, np.uint16(code), words)

    return fault


def broken_electrode(kind: str, channel: str | None) -> int:
    """The index of the electrode that ``channel`` names; without one, and for faults of the bus, E17's, on the pad."""
    name = "E17" if channel is None or kind in BUS_FAULTS else channel
    if name not in _sensor.ELECTRODE_NAMES:
        raise InputError(f"channel is {name!r}, expected an electrode, E1 to E19")
    return _sensor.ELECTRODE_NAMES.index(name)


def begin(
    kind: str, channel: str | None, rest: Floats, other_rest: Floats, seed: int | list[int]
) -> Callable[[Words, Words], Words]:
    """A fault that begins now on one finger: called with the next rounds of it and of the finger beside it, (n, 44).

    Returns words for a tape. Raises InputError for an unknown fault or channel.
    """
    lay = fault_named(kind, channel)
    faulty = Faulty(broken_electrode(kind, channel), rest, other_rest, np.random.default_rng(seed))
    return lambda words, other: on_the_bus(lay(faulty, words, other))


def on_the_bus(words: Words) -> Words:
    """Words for a tape: there, a word that did not come good has bad parity."""
    return np.where(words == INVALID_COUNT, np.uint16(EmuFault.BAD_PARITY), words)
