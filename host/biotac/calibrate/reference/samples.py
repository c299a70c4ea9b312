"""What a force/torque sensor measured, checked at the door; from a file, or read while it measures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from ...errors import RecordingError
from .mounting import Mounting

Floats = npt.NDArray[np.float64]

RATE_HZ = (20.0, 20_000.0)  # slower than 20 Hz a press is a handful of points; ATI's fastest boxes give 7 to 8 kHz
FORCE_N = (0.3, 200.0)  # of the 99th percentile: what a finger is calibrated with, and what would break it


@dataclass(frozen=True)
class Samples:
    """n instants in the sensor's own axes and by its own clock.

    ``t_s`` (n,) increasing; ``force_n`` (n, 3) N; ``torque_nmm`` (n, 3) N mm about the sensor's origin, or None
    for a sensor of three axes. A reading that the sensor itself calls bad is NaN.
    """

    t_s: Floats
    force_n: Floats
    torque_nmm: Floats | None

    def __len__(self) -> int:
        return len(self.t_s)

    def wrench(self) -> Floats:
        """Force and, where there is one, torque: (n, 6) or (n, 3)."""
        return self.force_n if self.torque_nmm is None else np.column_stack([self.force_n, self.torque_nmm])


@dataclass(frozen=True)
class Reference:
    """Samples with how their sensor was fixed to the finger; ``name`` says where they are from.

    ``sensor`` is its maker's name and number, "" where the file does not say.
    """

    name: str
    samples: Samples
    mounting: Mounting
    sensor: str = ""


def from_wrench(t_s: Floats, wrench: Floats) -> Samples:
    """Samples of a wrench (n, 3) or (n, 6)."""
    return Samples(t_s, wrench[:, :3], wrench[:, 3:] if wrench.shape[1] == 6 else None)


def join(parts: Sequence[Samples]) -> Samples:
    """One after the other; at least one part."""
    torques = [part.torque_nmm for part in parts if part.torque_nmm is not None]
    return Samples(
        np.concatenate([part.t_s for part in parts]),
        np.concatenate([part.force_n for part in parts]),
        np.concatenate(torques) if len(torques) == len(parts) else None,
    )


def check(where: str, samples: Samples) -> None:
    """Refuse what cannot be a finger's reference. Raises RecordingError with the number that shows it."""
    if len(samples) < 2:
        raise RecordingError(f"{where}: {len(samples)} samples: expected a recording of some minutes; record it again")
    timeless = ~np.isfinite(samples.t_s)
    if timeless.any():
        raise RecordingError(f"{where}: sample {int(np.argmax(timeless))} has no time (NaN): expected seconds")
    step = np.diff(samples.t_s)
    if (step <= 0.0).any():
        k = int(np.argmax(step <= 0.0))
        raise RecordingError(
            f"{where}: time goes from {samples.t_s[k]:.6f} to {samples.t_s[k + 1]:.6f} s after sample {k}: expected "
            "increasing times; sort the samples, or take one run at a time"
        )
    rate_hz = 1.0 / float(np.median(step))
    if not RATE_HZ[0] <= rate_hz <= RATE_HZ[1]:
        guess = "is t in ms or us?" if rate_hz < RATE_HZ[0] else "is t in s?"
        raise RecordingError(
            f"{where}: {rate_hz:.4g} samples a second: expected {RATE_HZ[0]:g} to {RATE_HZ[1]:g}; {guess}"
        )
    wrench = samples.wrench()
    bad: npt.NDArray[np.bool_] = ~np.isfinite(wrench.sum(axis=1))
    # single readings that the sensor calls bad are left out later; a tenth of all is another matter
    if bad.mean() > 0.1:
        raise RecordingError(
            f"{where}: {bad.sum()} of {len(bad)} samples are not finite, first sample {int(np.argmax(bad))}: expected "
            "numbers; was the sensor in error?"
        )
    force = samples.force_n[~bad]
    size_n = float(np.percentile(np.linalg.norm(force - np.median(force, axis=0), axis=1), 99))
    if not FORCE_N[0] <= size_n <= FORCE_N[1]:
        guess = "is it in kN or kgf, or was nothing pressed?" if size_n < FORCE_N[0] else "is it in mN, gf or counts?"
        raise RecordingError(
            f"{where}: force changes by {size_n:.4g} N (99th percentile): expected {FORCE_N[0]:g} to {FORCE_N[1]:g} N "
            f"on a finger; {guess}"
        )


@dataclass(frozen=True)
class ReaderStats:
    """Samples that never came, came too late or twice, and that the sensor itself called bad."""

    lost: int
    late: int
    bad: int


class Reader(Protocol):
    """``sensor`` is its name and number as far as it says them."""

    @property
    def sensor(self) -> str:
        """For people and for provenance."""

    @property
    def stats(self) -> ReaderStats:
        """Counts so far."""

    def read(self, board_s: float) -> Samples:
        """Samples since the last call, six axes, in order. Raises DeviceLostError when the sensor has gone.

        ``board_s`` is how long the board has streamed by its own clock: what an emulated sensor goes by.
        """

    def close(self) -> None:
        """Safe to call twice."""
