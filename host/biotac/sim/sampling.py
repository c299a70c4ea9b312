"""From instants to the 44 words of each frame: slot times, noise, drift, creep and the other channels.

host/docs/reference/sensor_model.md has the formulas and where the numbers are from.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from ..kernels.geometry import Floats
from ..wire import sensor_gen as _sensor
from ..wire.slots import ELECTRODE_SLOT, FRAME_S, PAC_SLOT, PDC_SLOT, SLOTS_PER_FRAME, TAC_SLOT, TDC_SLOT
from .physics import REST_CELSIUS, Finger, States
from .stick_slip import Ringing

Words = npt.NDArray[np.uint16]

CREEP_S = 10.0
PDC_PER_N, PDC_NOISE = 100.0, 1.0  # Navarro 2015 has 62 to 111 on one finger's pad; Finger draws more or less
# What real skin does to the static pressure besides (17 presses of robotic_finger/trial_15330 and 10 of another trial):
# it is 3 to 9 counts low after a press, whatever the press was, and comes back in 0.3 to 2.9 s; and each press leaves
# up to 5.6 counts (5 s at 500), which add up, 24 to 30 after 17 presses in 75 s. How it creeps beyond is not measured.
PDC_UNDERSHOOT, PDC_UNDERSHOOT_AT, PDC_UNDERSHOOT_S = 9.0, 200.0, 0.8
PDC_CREEP_SHARE, PDC_CREEP_S = 0.15, 60.0
TAC_REST, TAC_NOISE = 2045.0, 0.8
TDC_NOISE = 0.5
PAC_REST, PAC_NOISE = 2038.0, 4.0
PAC_HIGH_PASS_HZ = 10.0  # SPM: PAC is PDC's pressure through a 10 to 1040 Hz band
PAC_PER_PDC = 1000.0 * _sensor.PDC_KPA_PER_COUNT / _sensor.PAC_PA_PER_COUNT
_BLOCK = 1000  # frames at a time: they stay in the cache, and an hour of five fingers within 500 MB


def tdc_counts(celsius: Floats) -> Floats:
    """Temperature to TDC counts, not rounded: the inverse of the conversion in sensor.toml."""
    kelvin = celsius + 273.15
    share = _sensor.TDC_A / (np.exp(_sensor.TDC_BETA_K / kelvin) + _sensor.TDC_B)
    return _sensor.FULL_SCALE_COUNT * share


def sample(finger: Finger, states: States, rows: npt.NDArray[np.int64] | None = None) -> Words:
    """Read ``finger`` through n frames, given its states at their n + 1 boundaries.

    ``rows`` (n + 1,) are their indices in ``states``, which may repeat; by default all of them in order.
    Returns uint16 (n, 44) in SLOTS order, 0..4095. Each word is taken at its own slot's time, by
    linear interpolation between the boundaries. Deterministic: the same finger and states give the
    same words, and a longer run begins with the words of a shorter one.
    """
    rows = np.arange(len(states)) if rows is None else rows
    effects = effects_of(finger, states)
    sampler = Sampler(finger, slips=bool(effects["slip_mm_s"].any()))
    words: Words = np.empty((len(rows) - 1, SLOTS_PER_FRAME), dtype=np.uint16)
    for first in range(0, len(words), _BLOCK):
        words[first : first + _BLOCK] = sampler.read(effects[rows[first : first + _BLOCK + 1]])
    return words


#: What states do to one finger at an instant, before time and noise: ``exact`` are counts, ``pressed`` those above
#: rest, ``force_n`` is the normal force, ``load`` and ``tdc`` are counts, ``slip_mm_s`` is a speed.
EFFECTS_DTYPE = np.dtype(
    [(name, np.float64, (len(ELECTRODE_SLOT),)) for name in ("exact", "pressed")]
    + [(name, np.float64, ()) for name in ("force_n", "load", "tdc", "slip_mm_s")]
)


def effects_of(finger: Finger, states: States, *more: States) -> npt.NDArray[np.void]:
    """EFFECTS_DTYPE (n,) of one contact, or of several at once, whose temperature is the first one's."""
    contacts = (states, *more)
    if more:
        parts = [finger.deformation(contact) for contact in contacts]
        compression, bulge = (sum(part) for part in zip(*parts, strict=True))
        exact = finger.counts_of(compression, bulge, states.warm_c)
    else:
        exact = finger.counts(states)  # which another model may override
    effects = np.empty(len(states), EFFECTS_DTYPE)
    effects["exact"] = exact
    effects["pressed"] = exact - finger.rest_counts(states.warm_c)
    effects["force_n"] = np.sum([contact.force_n for contact in contacts], axis=0)
    effects["load"] = np.sum([spring_load(finger, contact) for contact in contacts], axis=0)
    effects["tdc"] = tdc_counts(REST_CELSIUS + states.warm_c)
    speeds = [contact.slip_mm_s for contact in contacts if contact.slip_mm_s is not None]
    effects["slip_mm_s"] = np.max(speeds, axis=0) if speeds else 0.0
    return effects


class Sampler:
    """Reads one finger round by round: its noise, drift and creep go on from call to call.

    The same finger and loads give the same words as sample(), however they are cut into calls.

    >>> sampler = Sampler(Finger(1))
    >>> sampler.step(touch.states(Touch(normal_n=2.0))).shape
    (44,)
    """

    def __init__(self, finger: Finger, *, slips: bool = True) -> None:
        """``slips``: something may slide over the skin; where nothing ever does, this may be False, which is faster."""
        self._finger = finger
        # one random stream per kind, drawn frame by frame, so that a shorter run is a prefix of a longer one
        rngs = [np.random.default_rng([finger.seed, kind]) for kind in (1, 2, 3, 4, 5)]
        self._electrode_rng, self._glitch_rng, self._pac_rng, self._slow_rng, slip_rng = rngs
        self._ringing = Ringing(slip_rng) if slips else None
        self._creep, self._pressure, self._high_pass = Lag(CREEP_S), Pressure(), _HighPass()
        self._hit = np.zeros((1, len(ELECTRODE_SLOT)), np.bool_)
        self._frame = 0
        self._last: npt.NDArray[np.void] | None = None

    def step(self, states: States, *more: States) -> Words:
        """Read the next round, (44,), at whose end are ``states`` of one contact, or ``more`` at once, each (1,).

        Within the round the load goes straight there from where the round before ended; the first one is at its
        end throughout. With m states each, it goes through them in m equal parts.
        """
        words: Words = self.steps(1, states, *more)[0]
        return words

    def steps(self, rounds: int, states: States, *more: States) -> Words:
        """As many steps with the same states, (rounds, 44)."""
        now = effects_of(self._finger, states, *more)
        before = now[:1] if self._last is None else self._last
        self._last = now[-1:]
        return self.read(np.concatenate([before, np.tile(now, rounds)]), len(states))

    def read(self, effects: npt.NDArray[np.void], pieces: int = 1) -> Words:
        """The next n rounds, (n, 44), between n * ``pieces`` + 1 instants; the first is the last of the call before.

        ``effects`` are EFFECTS_DTYPE.
        """
        finger, frames = self._finger, (len(effects) - 1) // pieces
        words = np.empty((frames, SLOTS_PER_FRAME))

        crept = _within(self._creep(effects["pressed"][::pieces]), pieces)
        clean = effects["exact"] + finger.creep_share * crept
        elapsed_s = (self._frame + np.arange(frames * pieces + 1) / pieces) * FRAME_S
        clean += finger.drift_per_min / 60.0 * elapsed_s[:, None]
        self._frame += frames
        electrodes = _between(clean, ELECTRODE_SLOT / SLOTS_PER_FRAME, pieces)
        electrodes += self._electrode_rng.normal(0.0, finger.noise_counts, electrodes.shape)
        if finger.glitch_share:
            electrodes -= self._glitches(frames)
        words[:, ELECTRODE_SLOT] = electrodes

        pdc = self._pressure(effects["load"], pieces)
        slow_noise = self._slow_rng.normal(0.0, (PDC_NOISE, TAC_NOISE, TDC_NOISE), (frames, 3))
        at_slot = np.array([PDC_SLOT, TAC_SLOT, TDC_SLOT]) / SLOTS_PER_FRAME
        slow = np.column_stack([finger.pdc_rest + pdc, np.full(len(pdc), TAC_REST), effects["tdc"]])
        words[:, [PDC_SLOT, TAC_SLOT, TDC_SLOT]] = _between(slow, at_slot, pieces) + slow_noise

        rattle = finger.rattle_per_n_s * np.abs(np.diff(effects["force_n"])) * pieces / FRAME_S
        pac = PAC_REST + self._high_pass(PAC_PER_PDC * pdc, pieces)
        noise = PAC_NOISE + rattle.reshape(frames, pieces)[:, _piece_of(PAC_SLOT, pieces)]
        pac += self._pac_rng.normal(0.0, 1.0, pac.shape) * noise
        if self._ringing is not None:
            pac += self._ringing(effects["slip_mm_s"][:-1:pieces])
        words[:, PAC_SLOT] = pac

        return np.clip(np.rint(words), 0, _sensor.FULL_SCALE_COUNT).astype(np.uint16)

    def _glitches(self, frames: int) -> Floats:
        """Single-sample dips (frames, 19) of 30 to 66 counts; the record never has two in a row."""
        draw = self._glitch_rng.random((frames, len(ELECTRODE_SLOT), 2))
        hit = np.concatenate([self._hit, draw[:, :, 0] < self._finger.glitch_share])
        self._hit = hit[-1:]
        dips: Floats = (hit[1:] & ~hit[:-1]) * (30.0 + 36.0 * draw[:, :, 1])
        return dips


def _piece_of(slots: npt.NDArray[Any], pieces: int) -> npt.NDArray[np.int64]:
    """In which of a round's equal parts each slot is."""
    return np.asarray(slots, np.int64) * pieces // SLOTS_PER_FRAME


def _within(boundary: Floats, pieces: int) -> Floats:
    """Values (n * pieces + 1, k) that run straight between rows of ``boundary`` (n + 1, k)."""
    if pieces == 1:
        return boundary
    share = (np.arange(pieces) / pieces)[None, :, None]
    between = boundary[:-1, None] * (1.0 - share) + boundary[1:, None] * share
    return np.concatenate([between.reshape(-1, boundary.shape[1]), boundary[-1:]])


def _between(boundary: Floats, share: Floats, pieces: int = 1) -> Floats:
    """Values (n, k) at ``share`` (k,) of the way through n rounds between rows of ``boundary`` (n * pieces + 1, k)."""
    if pieces == 1:
        return boundary[:-1] * (1.0 - share) + boundary[1:] * share
    piece = np.floor(share * pieces).astype(np.int64)
    at = piece + np.arange(0, len(boundary) - 1, pieces)[:, None]
    column, rest = np.arange(len(share)), share * pieces - piece
    between: Floats = boundary[at, column] * (1.0 - rest) + boundary[at + 1, column] * rest
    return between


def spring_load(finger: Finger, states: States) -> Floats:
    """Static pressure above rest (n,), in counts, as if skin were a spring: host/docs/reference/sensor_model.md."""
    per_n = PDC_PER_N * finger.pressure_gain * (1.0 + 0.15 * np.tanh(states.contact_mm[:, 0] / 8.0))
    load: Floats = per_n * finger.loudness(states.contact_mm) * states.force_n
    return load


class Pressure:
    """Static pressure above rest (n,), in counts, without noise: load, undershoot and creep, from rest on.

    p = f - U tanh(lag_0.8s(f) / 200) + 0.15 lag_60s(f), where f = spring_load(), U = 9 counts and lag_T a first-order
    lag. The measured figures stand beside the constants.
    """

    def __init__(self) -> None:
        self._undershoot, self._creep = Lag(PDC_UNDERSHOOT_S), Lag(PDC_CREEP_S)

    def __call__(self, load: Floats, pieces: int = 1) -> Floats:
        rounds = load[::pieces, None]
        low = PDC_UNDERSHOOT * np.tanh(_within(self._undershoot(rounds), pieces)[:, 0] / PDC_UNDERSHOOT_AT)
        creep = PDC_CREEP_SHARE * _within(self._creep(rounds), pieces)[:, 0]
        return load - low + creep


class Lag:
    """First-order lag of (n + 1, k), starting at zero; a call's first row is the last of the previous call."""

    def __init__(self, seconds: float) -> None:
        # y_i = a y_{i-1} + (1 - a) x_i, summed up: y_i = a^i (a y_{-1} + (1 - a) sum of x_j a^-j up to i)
        self.keep = math.exp(-FRAME_S / seconds)
        most = min(_BLOCK + 1, round(50.0 * seconds / FRAME_S))  # rows at once: a^-i stays a moderate number
        self._decay = self.keep ** np.arange(float(most))[:, None]
        self.last: Floats | float = 0.0

    def __call__(self, signal: Floats) -> Floats:
        lagged, last = np.empty_like(signal), self.last
        for first in range(0, len(signal), len(self._decay)):
            part = signal[first : first + len(self._decay)]
            decay = self._decay[: len(part)]
            follow = (1.0 - self.keep) * np.cumsum(part / decay, axis=0)
            lagged[first : first + len(part)] = decay * (self.keep * last + follow)
            last = lagged[first + len(part) - 1]
        self.last = lagged[-2]
        return lagged


class _HighPass:
    """First-order high-pass of boundary values (n + 1,) that run straight between: (n, 22) at PAC slots."""

    def __init__(self) -> None:
        self._seconds = 1.0 / (2.0 * math.pi * PAC_HIGH_PASS_HZ)
        self._lag = Lag(self._seconds)
        self._settled = np.zeros(1)

    def __call__(self, signal: Floats, pieces: int = 1) -> Floats:
        piece_s = FRAME_S / pieces
        settled = np.diff(signal) / piece_s * self._seconds  # response to an endless ramp
        if pieces == 1:
            start = self._lag(np.append(self._settled, settled)[:, None])[:-1]
        else:
            start = self._starts(settled, math.exp(-piece_s / self._seconds))
        self._settled = settled[-1:]
        piece = _piece_of(PAC_SLOT, pieces)
        decay = np.exp(-(PAC_SLOT / _sensor.SLOT_HZ - piece * piece_s) / self._seconds)
        now, begun = (values.reshape(-1, pieces)[:, piece] for values in (settled, start))
        return now + (begun - now) * decay

    def _starts(self, settled: Floats, keep: float) -> Floats:
        """What is left at the start of each part of a round, of which ``keep`` is left at that part's end."""
        lag = self._lag
        left = lag.keep * float(np.sum(lag.last)) + (1.0 - lag.keep) * float(self._settled[0])
        starts = []
        for response in settled:
            starts.append(left)
            left = keep * left + (1.0 - keep) * response
        lag.last = (left - (1.0 - lag.keep) * settled[-1]) / lag.keep  # as if it had been a whole round
        return np.array(starts)
