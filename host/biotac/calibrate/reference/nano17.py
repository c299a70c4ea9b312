"""An emulated ATI Nano17 force sensor: it measures a scenario's load on a finger.

It has the real sensor's resolution and range (SI-12-0.12: 1/320 N, 1/64 N mm; 12 and 17 N, 120 N mm), noise, a zero
offset, axes and an origin of its own, and a clock that is offset from the board's and drifts against it.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ...errors import InputError
from ...kernels.geometry import Floats
from ...sim.source import Source
from ...wire.slots import FRAME_S
from .mounting import Mounting
from .samples import Samples

RESOLUTION: Floats = np.array([1 / 320] * 3 + [1 / 64] * 3)  # N, N mm
RANGE: Floats = np.array([12.0, 12.0, 17.0, 120.0, 120.0, 120.0])
NOISE_STEPS = 0.7  # standard deviation, in steps of the resolution

#: The sensor carries the finger from above, rotated so that none of its axes is one of Lin's. If it were behind the
#: finger, a firm press on the tip would exceed its 120 N mm.
MOUNTING = Mounting(np.array([[0.0, 0.0, 1.0], [0.6, 0.8, 0.0], [-0.8, 0.6, 0.0]]), np.array([-5.0, 1.5, 10.0]))


@dataclass(frozen=True)
class Nano17:
    """The sensor. ``offset_s``: sensor time when the board's is 0; it gains ``drift_ppm``. ``zero`` (6,): N, N mm."""

    mounting: Mounting = MOUNTING
    rate_hz: float = 500.0
    offset_s: float = 417.3
    drift_ppm: float = 60.0
    zero: Floats = field(default_factory=lambda: np.array([0.4, -1.1, 0.7, 12.0, -7.0, 3.0]))
    seed: int = 17

    def measured(self, source: Source, finger: int) -> tuple[Floats, Samples]:
        """Board times (m,) in s, and the samples while ``source`` plays; NaN beyond the range.

        Raises InputError if it has no truth.
        """
        if source.truth is None:
            raise InputError(f"{source.name} has no true forces: expected a scenario (.toml)")
        lin = np.column_stack([source.truth.force_n[:, finger], source.truth.torque_nmm[:, finger]])
        at_s = (np.arange(len(lin)) + 0.5) * FRAME_S
        first = int(np.ceil(self.offset_s * self.rate_hz))
        last = int((self.offset_s + len(lin) * FRAME_S * (1.0 + 1e-6 * self.drift_ppm)) * self.rate_hz)
        own_s = np.arange(first, last) / self.rate_hz
        board_s = (own_s - self.offset_s) / (1.0 + 1e-6 * self.drift_ppm)
        own = self.mounting.to_sensor(lin)
        wrench = np.column_stack([np.interp(board_s, at_s, column) for column in own.T]) + self.zero
        wrench += np.random.default_rng(self.seed).normal(0.0, NOISE_STEPS, wrench.shape) * RESOLUTION
        beyond = (np.abs(wrench) > RANGE).any(axis=1)
        wrench = np.rint(wrench / RESOLUTION) * RESOLUTION
        wrench[beyond] = np.nan
        return board_s, Samples(own_s, wrench)


class Nano17Reader:
    """A SensorReader of the sensor's readings of ``source``, on the simulated board's time: no wall clock."""

    sensor = "emulated Nano17"

    def __init__(self, source: Source, finger: int, nano17: Nano17 | None = None) -> None:
        self.nano17 = nano17 or Nano17()
        self._at_s, self._samples = self.nano17.measured(source, finger)
        self._next = 0

    def read(self, board_s: float) -> Samples:
        """Samples measured since the last call, up to board time ``board_s``."""
        new = slice(self._next, max(self._next, int(self._at_s.searchsorted(board_s))))
        self._next = new.stop
        return Samples(self._samples.t_s[new], self._samples.wrench[new])
