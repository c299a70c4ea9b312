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
from .stick_slip import ringing

Words = npt.NDArray[np.uint16]

CREEP_S = 10.0
PDC_REST, PDC_PER_N, PDC_NOISE = 1326.0, 100.0, 1.0
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


def tdc_counts(celsius: Floats) -> Floats:
    """Temperature to TDC counts, not rounded: the inverse of the conversion in sensor.toml."""
    kelvin = celsius + 273.15
    share = _sensor.TDC_A / (np.exp(_sensor.TDC_BETA_K / kelvin) + _sensor.TDC_B)
    counts: Floats = _sensor.FULL_SCALE_COUNT * share
    return counts


def sample(finger: Finger, states: States) -> Words:
    """Read ``finger`` through n frames, given its states at their n + 1 boundaries.

    Returns uint16 (n, 44) in SLOTS order, 0..4095. Each word is taken at its own slot's time, by
    linear interpolation between the boundaries. Deterministic: the same finger and states give the
    same words, and a longer run begins with the words of a shorter one.
    """
    frames = len(states) - 1
    # one stream a kind, filled frame by frame: that is what makes a shorter run a prefix
    electrode_rng, glitch_rng, pac_rng, slow_rng = (np.random.default_rng([finger.seed, kind]) for kind in (1, 2, 3, 4))
    words = np.empty((frames, SLOTS_PER_FRAME))

    clean = finger.counts(states)
    clean += finger.creep_share * _lag(clean - finger.rest_counts(states.warm_c), CREEP_S)
    clean += finger.drift_per_min / 60.0 * (np.arange(frames + 1) * FRAME_S)[:, None]
    words[:, ELECTRODE_SLOT] = _between(clean, ELECTRODE_SLOT / SLOTS_PER_FRAME)
    words[:, ELECTRODE_SLOT] += electrode_rng.normal(0.0, finger.noise_counts, (frames, len(ELECTRODE_SLOT)))
    words[:, ELECTRODE_SLOT] -= _glitches(glitch_rng, frames, finger.glitch_share)

    pdc = pressure(states)
    slow_noise = slow_rng.normal(0.0, (PDC_NOISE, TAC_NOISE, TDC_NOISE), (frames, 3))
    at_slot = np.array([PDC_SLOT, TAC_SLOT, TDC_SLOT]) / SLOTS_PER_FRAME
    tdc = tdc_counts(REST_CELSIUS + states.warm_c)
    slow = np.column_stack([PDC_REST + pdc, np.full(frames + 1, TAC_REST), tdc])
    words[:, [PDC_SLOT, TAC_SLOT, TDC_SLOT]] = _between(slow, at_slot) + slow_noise

    rattle = PAC_RATTLE_PER_N_S * np.abs(np.diff(states.force_n)) / FRAME_S
    words[:, PAC_SLOT] = PAC_REST + _high_pass(PAC_PER_PDC * pdc)
    words[:, PAC_SLOT] += pac_rng.normal(0.0, 1.0, (frames, len(PAC_SLOT))) * (PAC_NOISE + rattle)[:, None]

    if states.slip_mm_s is not None and states.slip_mm_s.any():
        words[:, PAC_SLOT] += ringing(np.random.default_rng([finger.seed, 5]), states.slip_mm_s[:-1])

    return np.clip(np.rint(words), 0, _sensor.FULL_SCALE_COUNT).astype(np.uint16)


def _between(boundary: Floats, share: Floats) -> Floats:
    """Values (n, k) at ``share`` (k,) of the way between rows of ``boundary`` (n + 1, k)."""
    values: Floats = boundary[:-1] * (1.0 - share) + boundary[1:] * share
    return values


def pressure(states: States) -> Floats:
    """Static pressure above rest (n,), in counts, without noise: load, undershoot and creep.

    p = f - U tanh(lag_0.8s(f) / 200) + 0.15 lag_60s(f), where f = 100 N^-1 F (1 + 0.15 tanh(x / 8 mm)) is
    numerics.md 3.1's, U = 9 counts and lag_T a first-order lag. The measured figures stand beside the constants.
    """
    load: Floats = PDC_PER_N * states.force_n * (1.0 + 0.15 * np.tanh(states.contact_mm[:, 0] / 8.0))
    low = PDC_UNDERSHOOT * np.tanh(_lag(load[:, None], PDC_UNDERSHOOT_S)[:, 0] / PDC_UNDERSHOOT_AT)
    creep = PDC_CREEP_SHARE * _lag(load[:, None], PDC_CREEP_S)[:, 0]
    above: Floats = load - low + creep
    return above


def _lag(signal: Floats, seconds: float) -> Floats:
    """First-order lag of (n, k) with this time constant, starting at zero."""
    keep = math.exp(-FRAME_S / seconds)
    follow = (1.0 - keep) * signal
    lagged = np.empty_like(signal)
    state = np.zeros(signal.shape[1])
    for k in range(len(signal)):
        state = keep * state + follow[k]
        lagged[k] = state
    return lagged


def _glitches(rng: np.random.Generator, frames: int, share: float) -> Floats:
    """Single-sample dips (frames, 19) of 30 to 66 counts; the record never has two in a row."""
    draw = rng.random((frames, len(ELECTRODE_SLOT), 2))
    hit = draw[:, :, 0] < share
    hit[1:] &= ~hit[:-1]
    dips: Floats = hit * (30.0 + 36.0 * draw[:, :, 1])
    return dips


def _high_pass(signal: Floats) -> Floats:
    """First-order high-pass of boundary values (n + 1,) that run straight between: (n, 22) at PAC slots."""
    time_constant_s = 1.0 / (2.0 * math.pi * PAC_HIGH_PASS_HZ)
    settled = np.diff(signal) / FRAME_S * time_constant_s  # its answer to a ramp that never ends
    keep = math.exp(-FRAME_S / time_constant_s)
    start = np.empty(len(settled))
    state = 0.0
    for k, target in enumerate(settled.tolist()):
        start[k] = state
        state = target + (state - target) * keep
    decay = np.exp(-PAC_SLOT / _sensor.SLOT_HZ / time_constant_s)
    passed: Floats = settled[:, None] + (start - settled)[:, None] * decay
    return passed
