"""Readings of a force/torque sensor, from a file or read live, and checks of them."""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
import numpy.typing as npt

from ...clock.check_times import increasing, looks_like
from ...errors import RecordingError, RecordingWarning, printable
from ...kernels.geometry import Floats
from .mounting import Mounting

RATE_HZ = (20.0, 20_000.0)  # below 20 Hz a press has only a few points; ATI's fastest boxes give 7 to 8 kHz
FORCE_N = (0.3, 200.0)  # of the 99th percentile: from the least useful for calibrating to more than a finger bears
FROZEN_S = 0.2  # of readings that repeat exactly, and then leap: the sensor's program repeated the last
LEAP = 3.0  # times the step that 99 % of the others stay below
NOISY = 0.01  # of the steps of a sensor that never repeats itself, at most, are 0
MAX_FROZEN = 0.1


@dataclass(frozen=True)
class Samples:
    """n readings in the sensor's own axes and by its own clock.

    ``t_s`` (n,) is increasing. ``wrench`` (n, 6) is force in N and torque in N mm about the sensor's origin, or (n, 3)
    for a sensor with three axes, or (n, 1), the force's size. A reading that the sensor itself marks as
    bad is NaN.
    """

    t_s: Floats
    wrench: Floats

    def __len__(self) -> int:
        return len(self.t_s)


@dataclass(frozen=True)
class Reference:
    """Samples and how the sensor was mounted on the finger; ``name`` says where they come from.

    ``sensor`` is the sensor's make and number, "" where the file does not say.
    """

    name: str
    samples: Samples
    mounting: Mounting
    sensor: str = ""


def checked(where: str, samples: Samples) -> Samples:
    """The samples, NaN where they are frozen, with a warning.

    Raises RecordingError, with the number that shows why, for samples that cannot be a finger's reference.
    """
    kept = increasing(where, samples.t_s)
    samples = Samples(samples.t_s[kept], samples.wrench[kept])
    rate_hz = 1.0 / float(np.median(np.diff(samples.t_s)))
    if not RATE_HZ[0] <= rate_hz <= RATE_HZ[1]:
        raise RecordingError(
            f"{where}: {rate_hz:.4g} samples per second: expected {RATE_HZ[0]:g} to {RATE_HZ[1]:g}; "
            f"{looks_like(rate_hz, *RATE_HZ)}"
        )
    bad: npt.NDArray[np.bool_] = ~np.isfinite(samples.wrench.sum(axis=1))
    # a few readings that the sensor marks as bad are omitted later; a tenth of all is too many
    if bad.mean() > 0.1:
        raise RecordingError(
            f"{where}: {bad.sum()} of {len(bad)} samples are not finite, first sample {int(np.argmax(bad))}: expected "
            "numbers; did the sensor report an error?"
        )
    force = samples.wrench[~bad, :3]
    size_n = float(np.percentile(np.linalg.norm(force - np.median(force, axis=0), axis=1), 99))
    if not FORCE_N[0] <= size_n <= FORCE_N[1]:
        guess = "is it in kN or kgf, or was nothing pressed?" if size_n < FORCE_N[0] else "is it in mN, gf or counts?"
        raise RecordingError(
            f"{where}: force changes by {size_n:.4g} N (99th percentile): expected {FORCE_N[0]:g} to {FORCE_N[1]:g} N "
            f"on a finger; {guess}"
        )
    frozen = _frozen(samples)
    if frozen.any():
        seen = f"{where}: {frozen.mean():.1%} of the readings repeat the last one for over {FROZEN_S:g} s and then leap"
        if frozen.mean() > MAX_FROZEN:
            raise RecordingError(f"{seen}: expected at most {MAX_FROZEN:.0%}; does the sensor's program drop data?")
        warnings.warn(printable(f"{seen}: they are left out"), RecordingWarning, stacklevel=2)
    return replace(samples, wrench=np.where(frozen[:, None], np.nan, samples.wrench))


def _frozen(samples: Samples) -> npt.NDArray[np.bool_]:
    """Mask (n,) of samples that only repeat the one before; the repeats of a held force end in no leap."""
    change = np.linalg.norm(np.diff(samples.wrench[:, :3], axis=0), axis=1)
    same = (np.diff(samples.wrench, axis=0) == 0.0).all(axis=1)
    begin, end = np.flatnonzero(np.diff(np.r_[False, same, False])).reshape(-1, 2).T
    long = samples.t_s[end] - samples.t_s[begin] > FROZEN_S
    after = np.append(change, 0.0)[end]
    leaps = long & (after > LEAP * np.nanpercentile(change[~same], 99))
    if leaps.any() and same.mean() < 0.5 and same.sum() - (end - begin)[long].sum() < NOISY * len(same):
        leaps = long  # also a leap back to the force before
    frozen = np.zeros(len(samples), dtype=np.bool_)
    for first, last in zip(begin[leaps], end[leaps], strict=True):
        frozen[first + 1 : last + 1] = True
    return frozen


class SensorReader(Protocol):
    """A force/torque sensor that is read live."""

    @property
    def sensor(self) -> str: ...  # name and number as far as known, for people and for provenance

    def read(self, board_s: float) -> Samples:
        """Samples since the last call, six axes, in order. Raises DeviceLostError when the sensor is gone.

        ``board_s`` is how long the board has streamed by its own clock; it is the clock of an emulated sensor.
        """
