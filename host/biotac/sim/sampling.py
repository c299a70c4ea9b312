"""From instants to the 44 words of each frame: slot times, noise, drift, creep and the other channels.

In C (host/binding/skin); the numbers stand here. host/docs/reference/sensor_model.md has the formulas and where the
numbers are from.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from ..kernels.geometry import Floats
from ..wire import sensor_gen as _sensor
from ..wire.native import ffi, lib
from ..wire.slots import ELECTRODE_SLOT, PAC_SLOT, SLOTS_PER_FRAME
from .physics import SKIN, SimFinger, States, c_struct, doubles
from .stick_slip import Ringing

Words = npt.NDArray[np.uint16]

CREEP_S = 10.0
PDC_PER_N, PDC_NOISE = 100.0, 1.0  # Navarro 2015 has 62 to 111 on one finger's pad; SimFinger draws more or less
# Other effects of real skin on static pressure (17 presses of robotic_finger/trial_15330 and 10 of another trial): it
# is 3 to 9 counts low after any press, and comes back in 0.3 to 2.9 s; and each press adds up to 5.6 counts (5 s at
# 500), 24 to 30 after 17 presses in 75 s. How it creeps beyond is not measured.
PDC_UNDERSHOOT, PDC_UNDERSHOOT_AT, PDC_UNDERSHOOT_S = 9.0, 200.0, 0.8
PDC_CREEP_SHARE, PDC_CREEP_S = 0.15, 60.0
TAC_REST, TAC_NOISE = 2045.0, 0.8
TDC_NOISE = 0.5
PAC_REST, PAC_NOISE = 2038.0, 4.0
PAC_HIGH_PASS_HZ = 10.0  # SPM: PAC is PDC's pressure through a 10 to 1040 Hz band
PAC_PER_PDC = 1000.0 * _sensor.PDC_KPA_PER_COUNT / _sensor.PAC_PA_PER_COUNT
_BLOCK = 1000  # frames at a time: they stay in the cache, and an hour of five fingers within 500 MB
_DRAWN = 64  # frames with noise drawn at once
_SAMPLING = c_struct("bt_sampling", globals(), {})


def tdc_counts(celsius: Floats) -> Floats:
    """Temperature to TDC counts, not rounded: the inverse of the conversion in sensor.toml."""
    counts = np.empty(np.shape(celsius))
    lib.bt_tdc_counts(SKIN.in_c, counts.size, doubles(celsius), doubles(counts))
    return counts


def sample(finger: SimFinger, states: States, rows: npt.NDArray[np.int64] | None = None) -> Words:
    """Read ``finger`` through n frames, given its states at their n + 1 boundaries.

    ``rows`` (n + 1,) are their indices in ``states``, which may repeat; by default all of them in order.
    Returns uint16 (n, 44) in SLOTS order, 0..4095. Each word has the value at the time of its slot, by
    linear interpolation between the boundaries. Deterministic: the same finger and states give the
    same words, and a longer run begins with the words of a shorter one.
    """
    rows = np.arange(len(states)) if rows is None else rows
    effects = effects_of(finger, states)
    sampler = Sampler(finger, effects[rows[:1]])
    words: Words = np.empty((len(rows) - 1, SLOTS_PER_FRAME), dtype=np.uint16)
    for first in range(0, len(words), _BLOCK):
        words[first : first + _BLOCK] = sampler.read(effects[rows[first + 1 : first + _BLOCK + 1]])
    return words


#: The effects of states on one finger at an instant, before time and noise: ``exact`` are counts, ``pressed`` those
#: above rest, ``force_n`` is the normal force, ``pressure`` and ``tdc`` are counts, ``slip_mm_s`` is a speed.
EFFECTS_DTYPE = np.dtype(
    [(name, np.float64, (len(ELECTRODE_SLOT),)) for name in ("exact", "pressed")]
    + [(name, np.float64, ()) for name in ("force_n", "pressure", "tdc", "slip_mm_s")]
)


def effects_of(finger: SimFinger, states: States, *more: States) -> npt.NDArray[np.void]:
    """EFFECTS_DTYPE (n,) of one contact, or of several at once, with the temperature of the first."""
    return _effects_of(finger, _in_c(finger)[0], (states, *more))


_EFFECTS, _WORDS = ffi.typeof("bt_effects[]"), ffi.typeof("uint16_t[]")


def _effects_of(finger: SimFinger, in_c: Any, contacts: tuple[States, ...]) -> npt.NDArray[np.void]:
    states, other = contacts[0], type(finger).counts is not SimFinger.counts  # another model deforms its own skin
    load = [(contact.in_c[0],) if other else contact.touched[0][0] for contact in contacts]
    effects, touched = np.empty(len(states), EFFECTS_DTYPE), ffi.new("bt_touched[]", load)
    lib.bt_effects_of(SKIN.in_c, in_c, len(effects), len(contacts), touched, ffi.from_buffer(_EFFECTS, effects))
    if other:
        effects["exact"] = finger.counts(states)
        effects["pressed"] = effects["exact"] - finger.rest_counts(states.warm_c)
    return effects


def _in_c(finger: SimFinger) -> tuple[Any, ...]:
    """A finger as it is now, as C has it, and the objects that it needs alive."""
    kept = [doubles(finger.r0_ohm), doubles(finger.gap_gain), doubles(finger.drift_per_min)]
    numbers = (
        finger.creep_share, finger.pdc_rest, PDC_PER_N * finger.pressure_gain, finger.tip_gain, finger.side_gain,
        finger.rattle_per_n_s, finger.noise_counts, finger.glitch_share,
    )  # fmt: skip
    return ffi.new("bt_skin_finger *", [*kept, *numbers]), kept


class Sampler:
    """Reads one finger round by round: noise, drift and creep go on from call to call.

    The same finger and loads give the same words as sample(), however they are cut into calls.

    >>> sampler = Sampler(SimFinger(1))
    >>> sampler.step(touch.states(SimTouch(normal_n=2.0))).shape
    (44,)
    """

    def __init__(self, finger: SimFinger, begin: npt.NDArray[np.void] | None = None) -> None:
        """``begin``: the EFFECTS_DTYPE row (1,) at which the first round begins."""
        self._finger = finger
        # one random stream per kind, drawn frame by frame, so that a shorter run is a prefix of a longer one
        *self._rngs, slip_rng = [np.random.default_rng([finger.seed, kind]) for kind in (1, 2, 3, 4, 5)]
        self._ringing = Ringing(slip_rng)
        self._reader = ffi.new("bt_reader *", {"ringing": self._ringing.in_c})
        self._noise = ffi.new("bt_drawn *")
        self._drawn: tuple[Any, ...] = ()
        if begin is not None:
            lib.bt_begin(self._reader, _SAMPLING, ffi.from_buffer(_EFFECTS, begin))

    def step(self, states: States, *more: States) -> Words:
        """Read the next round, (44,), with ``states`` of one contact, or ``more`` at once, each (1,), at the end.

        Within the round the load goes straight there from where the round before ended; the first one has the load of
        the end throughout. With m states each, it goes through them in m equal parts.
        """
        words: Words = self.steps(1, states, *more)[0]
        return words

    def steps(self, rounds: int, states: States, *more: States) -> Words:
        """As many steps with the same states, (rounds, 44)."""
        in_c = _in_c(self._finger)
        effects = _effects_of(self._finger, in_c[0], (states, *more))
        return self._read(effects, in_c[0], rounds, len(effects), 0)

    def read(self, effects: npt.NDArray[np.void]) -> Words:
        """The next n rounds, (n, 44), with ``effects``, EFFECTS_DTYPE (n,), at their ends."""
        return self._read(effects, _in_c(self._finger)[0], len(effects), 1, 1)

    def _read(self, effects: npt.NDArray[np.void], in_c: Any, rounds: int, pieces: int, stride: int) -> Words:
        words: Words = np.empty((rounds, SLOTS_PER_FRAME), np.uint16)
        of, into, done = ffi.from_buffer(_EFFECTS, effects), ffi.from_buffer(_WORDS, words), 0
        while done < rounds:
            if self._noise.next == self._noise.rounds:
                self._draw()
            done += lib.bt_read(
                self._reader, _SAMPLING, in_c, rounds - done, pieces, of + done * stride, stride, self._noise,
                into + done * SLOTS_PER_FRAME,
            )  # fmt: skip
        return words

    def _draw(self) -> None:
        electrodes, glitches, pac, slow = self._rngs
        drawn = (
            electrodes.standard_normal((_DRAWN, len(ELECTRODE_SLOT))), slow.standard_normal((_DRAWN, 3)),
            pac.standard_normal((_DRAWN, len(PAC_SLOT))), glitches.random((_DRAWN, len(ELECTRODE_SLOT), 2)),
            self._ringing.draw(_DRAWN),
        )  # fmt: skip
        self._drawn = tuple(map(doubles, drawn))
        self._noise[0] = (*self._drawn, _DRAWN, 0)
