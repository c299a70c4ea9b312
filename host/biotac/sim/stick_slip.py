"""The effect of sliding skin on dynamic pressure: stick and slip.

A surface that slides over skin at v sticks and lets go v / d times a second, at random, d being how far the skin is
drawn along; as it begins to slide it lets go at once. Each time the skin rings as a damped oscillator:
p(t) = a exp(-t / T) sin(2 pi f t), with a of either sign.

d = 0.1 mm, f = 160 Hz and T = 5 ms are a free choice; a makes changes within 3.6 ms at 20 mm/s such as real slides
have (ten materials, 2 cm/s: mean squares 1300 to 6000 count^2, of rectified values; 2300 here).
"""

from __future__ import annotations

import math

import numpy as np

from ..kernels.geometry import Floats
from ..wire import sensor_gen as _sensor

DRAWN_MM = 0.1
SKIN_HZ = 160.0
RING_S = 0.005
AMPLITUDE_COUNTS = 80.0
PAC_HZ = _sensor.SLOT_HZ / 2.0
_PAC = _sensor.SLOTS.count("PAC")


class Ringing:
    """PAC counts (n, 22) above rest of skin that slides at ``speed_mm_s`` (n,), a speed a frame.

    Each call goes on where the one before has ended. Draws the same numbers for a frame whatever comes after it, and 0
    where nothing has slid for 50 ms.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        t_s = np.arange(round(10 * RING_S * PAC_HZ)) / PAC_HZ
        self._ring = np.exp(-t_s / RING_S) * np.sin(2.0 * math.pi * SKIN_HZ * t_s)
        self._rng = rng
        self._slid = False
        self._blows: Floats = np.zeros(len(t_s) - 1)  # what still rings

    def __call__(self, speed_mm_s: Floats) -> Floats:
        draw = self._rng.random((len(speed_mm_s), _PAC, 2))
        slips = draw[:, :, 0] < (speed_mm_s / DRAWN_MM / PAC_HZ)[:, None]
        sway = 2.0 * draw[:, :, 1] - 1.0
        blow = np.zeros(sway.shape)
        blow[slips] = AMPLITUDE_COUNTS * np.sign(sway[slips]) * np.sqrt(np.abs(sway[slips]))
        slides = speed_mm_s > 0.0
        begins = slides & ~np.concatenate([[self._slid], slides[:-1]])
        self._slid = bool(slides[-1])
        blow[begins, 0] = AMPLITUDE_COUNTS * np.sign(sway[begins, 0])
        blows = np.concatenate([self._blows, blow.ravel()])
        self._blows = blows[-len(self._blows) :]
        return np.convolve(blows, self._ring, "valid").reshape(blow.shape)
