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
from ..wire.native import ffi, lib
from .physics import doubles

DRAWN_MM = 0.1
SKIN_HZ = 160.0
RING_S = 0.005
AMPLITUDE_COUNTS = 80.0
PAC_HZ = _sensor.SLOT_HZ / 2.0
_PAC = _sensor.SLOTS.count("PAC")


class Ringing:
    """PAC counts (n, 22) above rest of skin that slides at ``speed_mm_s`` (n,), a speed a frame.

    Each call goes on where the one before has ended. Draws the same numbers for a frame whatever follows, and 0 where
    nothing has slid for 50 ms.
    """

    def __init__(self, rng: np.random.Generator) -> None:
        t_s = np.arange(lib.BT_RING_SAMPLES) / PAC_HZ
        ring = np.exp(-t_s / RING_S) * np.sin(2.0 * math.pi * SKIN_HZ * t_s)
        self.in_c = ffi.new("bt_ringing *", [ring.tolist(), AMPLITUDE_COUNTS, DRAWN_MM, PAC_HZ])
        self._rng = rng

    def draw(self, frames: int) -> Floats:
        """The next random numbers of so many frames."""
        return self._rng.random((frames, _PAC, 2))

    def __call__(self, speed_mm_s: Floats) -> Floats:
        counts = np.empty((len(speed_mm_s), _PAC))
        draws = doubles(self.draw(len(counts)))
        lib.bt_ring(self.in_c, len(counts), doubles(speed_mm_s), draws, doubles(counts))
        return counts
