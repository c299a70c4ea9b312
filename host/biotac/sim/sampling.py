"""From instants to the 44 words of each frame: slot times, noise, drift, creep and the other channels.

numerics.md 3.1 for the electrodes and PDC; biotac.md 2.1 for what PAC, TAC and TDC read at rest.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from ..core.geometry import Floats
from ..wire import sensor_gen as _sensor
from ..wire.slots import ELECTRODE_SLOT, FRAME_S, PAC_SLOT, PDC_SLOT, SLOTS_PER_FRAME, TAC_SLOT, TDC_SLOT
from .physics import REST_CELSIUS, Finger, States
from .stick_slip import Ringing

Words = npt.NDArray[np.uint16]

CREEP_S = 10.0
PDC_PER_N, PDC_NOISE = 100.0, 1.0
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
# Skin vibration while it is pressed harder or less: in a real press (btd_biotacsp) the noise of 4 grew to 7.6 at 1 to 2
# counts of pressure a round and to 12 at 4 to 8. Skin that is drawn sideways until it slides is as quiet as at rest
# (slides).
PAC_RATTLE_PER_N_S = 2.5

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
    reading = _Reading(finger, states)
    words: Words = np.empty((len(rows) - 1, SLOTS_PER_FRAME), dtype=np.uint16)
    for first in range(0, len(words), _BLOCK):
        words[first : first + _BLOCK] = reading.on(rows[first : first + _BLOCK + 1])
    return words


class _Reading:
    """A finger read block by block: precomputed effects of its states, and what carries over between blocks."""

    def __init__(self, finger: Finger, states: States) -> None:
        self._finger = finger
        self._exact = finger.counts(states)
        self._pressed = self._exact - finger.rest_counts(states.warm_c)
        self._force_n = states.force_n
        self._load = spring_load(states)
        self._tdc = tdc_counts(REST_CELSIUS + states.warm_c)
        slips = states.slip_mm_s is not None and states.slip_mm_s.any()
        self._slip_mm_s = states.slip_mm_s if slips else None
        # one random stream per kind, drawn frame by frame, so that a shorter run is a prefix of a longer one
        rngs = [np.random.default_rng([finger.seed, kind]) for kind in (1, 2, 3, 4, 5)]
        self._electrode_rng, self._glitch_rng, self._pac_rng, self._slow_rng, slip_rng = rngs
        self._ringing = Ringing(slip_rng)
        self._creep, self._pressure, self._high_pass = Lag(CREEP_S), Pressure(), _HighPass()
        self._hit = np.zeros((1, len(ELECTRODE_SLOT)), np.bool_)
        self._frame = 0

    def on(self, rows: npt.NDArray[np.int64]) -> Words:
        """The next n frames, (n, 44), between these n + 1 states; the first is the last of the previous call."""
        finger, frames = self._finger, len(rows) - 1
        words = np.empty((frames, SLOTS_PER_FRAME))

        clean = self._exact[rows] + finger.creep_share * self._creep(self._pressed[rows])
        elapsed_s = (self._frame + np.arange(frames + 1)) * FRAME_S
        clean += finger.drift_per_min / 60.0 * elapsed_s[:, None]
        self._frame += frames
        electrodes = _between(clean, ELECTRODE_SLOT / SLOTS_PER_FRAME)
        electrodes += self._electrode_rng.normal(0.0, finger.noise_counts, electrodes.shape)
        if finger.glitch_share:
            electrodes -= self._glitches(frames)
        words[:, ELECTRODE_SLOT] = electrodes

        pdc = self._pressure(self._load[rows])
        slow_noise = self._slow_rng.normal(0.0, (PDC_NOISE, TAC_NOISE, TDC_NOISE), (frames, 3))
        at_slot = np.array([PDC_SLOT, TAC_SLOT, TDC_SLOT]) / SLOTS_PER_FRAME
        slow = np.column_stack([finger.pdc_rest + pdc, np.full(frames + 1, TAC_REST), self._tdc[rows]])
        words[:, [PDC_SLOT, TAC_SLOT, TDC_SLOT]] = _between(slow, at_slot) + slow_noise

        rattle = PAC_RATTLE_PER_N_S * np.abs(np.diff(self._force_n[rows])) / FRAME_S
        pac = PAC_REST + self._high_pass(PAC_PER_PDC * pdc)
        pac += self._pac_rng.normal(0.0, 1.0, pac.shape) * (PAC_NOISE + rattle)[:, None]
        if self._slip_mm_s is not None:
            pac += self._ringing(self._slip_mm_s[rows[:-1]])
        words[:, PAC_SLOT] = pac

        return np.clip(np.rint(words), 0, _sensor.FULL_SCALE_COUNT).astype(np.uint16)

    def _glitches(self, frames: int) -> Floats:
        """Single-sample dips (frames, 19) of 30 to 66 counts; the record never has two in a row."""
        draw = self._glitch_rng.random((frames, len(ELECTRODE_SLOT), 2))
        hit = np.concatenate([self._hit, draw[:, :, 0] < self._finger.glitch_share])
        self._hit = hit[-1:]
        dips: Floats = (hit[1:] & ~hit[:-1]) * (30.0 + 36.0 * draw[:, :, 1])
        return dips


def _between(boundary: Floats, share: Floats) -> Floats:
    """Values (n, k) at ``share`` (k,) of the way between rows of ``boundary`` (n + 1, k)."""
    return boundary[:-1] * (1.0 - share) + boundary[1:] * share


def spring_load(states: States) -> Floats:
    """Static pressure above rest (n,), in counts, as if skin were a spring: numerics.md 3.1."""
    return PDC_PER_N * states.force_n * (1.0 + 0.15 * np.tanh(states.contact_mm[:, 0] / 8.0))


class Pressure:
    """Static pressure above rest (n,), in counts, without noise: load, undershoot and creep, from rest on.

    p = f - U tanh(lag_0.8s(f) / 200) + 0.15 lag_60s(f), where f = 100 N^-1 F (1 + 0.15 tanh(x / 8 mm)) is
    the load, U = 9 counts and lag_T a first-order lag. The measured figures stand beside the constants.
    """

    def __init__(self) -> None:
        self._undershoot, self._creep = Lag(PDC_UNDERSHOOT_S), Lag(PDC_CREEP_S)

    def __call__(self, load: Floats) -> Floats:
        low = PDC_UNDERSHOOT * np.tanh(self._undershoot(load[:, None])[:, 0] / PDC_UNDERSHOOT_AT)
        creep = PDC_CREEP_SHARE * self._creep(load[:, None])[:, 0]
        return load - low + creep


class Lag:
    """First-order lag of (n + 1, k), starting at zero; a call's first row is the last of the previous call."""

    def __init__(self, seconds: float) -> None:
        # y_i = a y_{i-1} + (1 - a) x_i, summed up: y_i = a^i (a y_{-1} + (1 - a) sum of x_j a^-j up to i)
        self._keep = math.exp(-FRAME_S / seconds)
        most = min(_BLOCK + 1, round(50.0 * seconds / FRAME_S))  # rows at once: a^-i stays a moderate number
        self._decay = self._keep ** np.arange(float(most))[:, None]
        self._last: Floats | float = 0.0

    def __call__(self, signal: Floats) -> Floats:
        lagged, last = np.empty_like(signal), self._last
        for first in range(0, len(signal), len(self._decay)):
            part = signal[first : first + len(self._decay)]
            decay = self._decay[: len(part)]
            follow = (1.0 - self._keep) * np.cumsum(part / decay, axis=0)
            lagged[first : first + len(part)] = decay * (self._keep * last + follow)
            last = lagged[first + len(part) - 1]
        self._last = lagged[-2]
        return lagged


class _HighPass:
    """First-order high-pass of boundary values (n + 1,) that run straight between: (n, 22) at PAC slots."""

    def __init__(self) -> None:
        self._seconds = 1.0 / (2.0 * math.pi * PAC_HIGH_PASS_HZ)
        self._lag = Lag(self._seconds)
        self._settled = np.zeros(1)

    def __call__(self, signal: Floats) -> Floats:
        settled = np.diff(signal) / FRAME_S * self._seconds  # response to an endless ramp
        start = self._lag(np.append(self._settled, settled)[:, None])[:-1]
        self._settled = settled[-1:]
        decay = np.exp(-PAC_SLOT / _sensor.SLOT_HZ / self._seconds)
        return settled[:, None] + (start - settled[:, None]) * decay
