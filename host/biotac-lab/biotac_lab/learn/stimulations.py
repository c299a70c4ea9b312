"""The data set of Wettels and Loeb 2011 on an emulated finger: probes pressed straight and tilted four ways, labelled.

Section II.A: a probe is placed, pressed along the normal until a peak and relaxed, then tilted by about 30 degrees in
each plane and pressed again: five stimulations, which were one file and are one contact here. Nothing is played in
time and no board takes part: 10 000 rows take seconds.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from biotac.core import geometry as surface
from biotac.sim import SimFinger, States, deform
from biotac.wire import sensor

from .probes import BAR, PROBES, Floats, counts_of, footprints

Integers = npt.NDArray[np.int64]

X_MM = (-13.0, 3.5)  # the pad, with the tip's electrodes and without the seal
ROLL_DEG = 55.0
TILTS_DEG = ((0.0, 0.0), (30.0, 0.0), (-30.0, 0.0), (0.0, 30.0), (0.0, -30.0))  # to the tip, to E11's side
TILT_SD_DEG, PLACE_SD_MM = 4.0, 0.3  # "manually held"
PEAK_N = (30.0, 40.0)
LEAST_SHARE = 0.01  # of the peak, where a stimulation begins and ends


@dataclass(frozen=True)
class Stimulations:
    """Rows (n,) of readings, and the truth of each.

    ``counts`` (n, 19) whole counts; ``tare`` (n, 19) the finger's rest; ``contact_mm`` (n, 3) on the core; ``force_n``
    (n, 3) on the finger in Lin's frame; ``normal_n`` (n,); ``probe`` (n,) into the probes; ``contact`` (n,) numbers the
    paper's files, ``stimulation`` (n,) a press of one; rows of a stimulation follow each other.
    """

    counts: Floats
    tare: Floats
    contact_mm: Floats
    force_n: Floats
    normal_n: Floats
    probe: Integers
    contact: Integers
    stimulation: Integers

    def __len__(self) -> int:
        return len(self.probe)

    def where(self, rows: npt.NDArray[np.bool_]) -> Stimulations:
        """The rows selected by ``rows`` (n,)."""
        return Stimulations(*(getattr(self, field.name)[rows] for field in fields(self)))


def stimulate(
    finger: SimFinger, places: Sequence[int], *, seed: int, frames: int = 16, peak_n: tuple[float, float] = PEAK_N
) -> Stimulations:
    """``places`` says how many contacts each of PROBES makes, of five stimulations of ``frames`` rows."""
    rng = np.random.default_rng([seed, 33])
    probe = np.repeat(np.arange(len(PROBES)), places)
    n, tilts = len(probe), len(TILTS_DEG)
    x, roll = _places(places, rng)
    presses = n * tilts
    jitter = rng.normal(0.0, PLACE_SD_MM, (2, presses))
    x = np.clip(np.repeat(x, tilts) + jitter[0], *X_MM)
    roll = np.repeat(roll, tilts) + jitter[1] / surface.RADIUS_MM
    ring = np.sqrt(surface.RADIUS_MM**2 - np.maximum(x, 0.0) ** 2)
    contact_mm = np.column_stack([x, ring * np.sin(roll), -ring * np.cos(roll)])
    tilt = np.tan(np.radians(np.tile(TILTS_DEG, (n, 1)) + rng.normal(0.0, TILT_SD_DEG, (presses, 2))))
    to_tip, to_side = surface.tangents_at(surface.normals_at(contact_mm))
    shear = to_tip * tilt[:, :1] + to_side * tilt[:, 1:]
    # up and down again, but not to zero: without contact there is no point of contact
    rise = np.sin(np.pi * (np.arange(frames) + 0.5) / frames) ** 2
    peak = rng.uniform(*peak_n, presses)
    normal_n = (peak[:, None] * np.maximum(rise, LEAST_SHARE)).ravel()

    def each(values: npt.NDArray[np.generic]) -> Floats:
        result: Floats = np.repeat(values, frames, axis=0)
        return result

    zeros = np.zeros(len(normal_n))
    states = States(each(contact_mm), normal_n, each(shear) * normal_n[:, None], zeros, zeros, zeros)
    of_row = each(np.repeat(probe, tilts)).astype(np.int64)
    compression, bulge = np.empty((len(states), 19)), np.empty((len(states), 19))
    for k, shape in enumerate(PROBES):
        rows = of_row == k
        some = states.of(rows)
        compression[rows], bulge[rows] = deform(some, footprints(shape, some.contact_mm, some.force_n))
    exact = finger.counts_of(compression, bulge, zeros)
    noisy = np.rint(exact + rng.normal(0.0, finger.noise_counts, exact.shape))
    return Stimulations(
        counts=np.clip(noisy, 0.0, sensor.FULL_SCALE_COUNT),
        tare=np.repeat(finger.rest_counts(np.zeros(1)), len(states), axis=0),
        contact_mm=states.contact_mm,
        force_n=states.wrench()[0],
        normal_n=normal_n,
        probe=of_row,
        contact=np.repeat(np.arange(n), tilts * frames),
        stimulation=np.repeat(np.arange(presses), frames),
    )


BAR_X_MM, BAR_ROLL_DEG = (-9.5, -6.5), 12.0  # the middle of the pad: an edge as long as the finger is wide
BAR_PEAK_N = (10.0, 30.0)
BAR_LEVELS = (0.25, 0.5, 1.0)  # of the peak
BAR_FRICTION = 0.2


def press_bars(finger: SimFinger, presses: int, *, seed: int) -> tuple[Floats, Floats, Floats]:
    """A bar across the pad in any direction, each press read at BAR_LEVELS of the peak.

    Counts (presses, 3, 19), the tare (19,) and the bar's direction (presses,) in rad, 0 to pi from the tip's to E11's
    side.
    """
    rng = np.random.default_rng([seed, 34])
    roll = np.radians(rng.uniform(-BAR_ROLL_DEG, BAR_ROLL_DEG, presses))
    x = rng.uniform(*BAR_X_MM, presses)
    contact_mm = np.column_stack([x, surface.RADIUS_MM * np.sin(roll), -surface.RADIUS_MM * np.cos(roll)])
    peak = rng.uniform(*BAR_PEAK_N, presses)
    turned = rng.uniform(0.0, np.pi, presses)
    to_tip, to_side = surface.tangents_at(surface.normals_at(contact_mm))
    size, way = BAR_FRICTION * rng.random(presses), rng.uniform(0.0, 2.0 * np.pi, presses)
    shear = to_tip * (size * np.cos(way))[:, None] + to_side * (size * np.sin(way))[:, None]
    none = np.zeros(presses)
    counts = np.empty((presses, len(BAR_LEVELS), 19))
    for k, level in enumerate(BAR_LEVELS):
        force = level * peak
        states = States(contact_mm, force, shear * force[:, None], none, none, none)
        counts[:, k] = counts_of(finger, [(states, footprints(BAR, contact_mm, force, turned))])
    noisy = np.rint(counts + rng.normal(0.0, finger.noise_counts, counts.shape))
    return np.clip(noisy, 0.0, sensor.FULL_SCALE_COUNT), finger.rest_counts(np.zeros(1))[0], turned


def _places(places: Sequence[int], rng: np.random.Generator) -> tuple[Floats, Floats]:
    """x in mm and roll in rad of each contact, spread evenly over the pad, by a shuffled lattice for each probe."""
    golden = (np.sqrt(5.0) - 1.0) / 2.0
    drawn = []
    for count in places:
        k = np.arange(count)
        drawn.append(
            np.column_stack([(k + rng.random()) / count, (k * golden + rng.random()) % 1.0])[rng.permutation(count)]
        )
    share = np.concatenate(drawn) % 1.0
    return X_MM[0] + (X_MM[1] - X_MM[0]) * share[:, 0], np.radians(ROLL_DEG * (2.0 * share[:, 1] - 1.0))
