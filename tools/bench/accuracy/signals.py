"""Random frames for the kernels: six classes, each aimed at something a kernel may get wrong.

Signals (n, 19) int32 in 1/16 count, compression negative, within the range of the ADC.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from biotac.core import geometry as surface
from biotac.wire import sensor_gen as sensor
from biotac.wire.messages_gen import PocWeights

Signals = NDArray[np.int32]

E_MAX_Q4 = sensor.FULL_SCALE_COUNT * 16
ELECTRODES = len(sensor.ELECTRODE_NAMES)
_X_UM = np.array(sensor.ELECTRODE_UM, dtype=np.float64)[:, 0]


def bumps(random: np.random.Generator, n: int, weights: PocWeights) -> Signals:
    """One contact each: a Gaussian dent of 1 to 3000 counts somewhere on the finger, with a bulge around it."""
    along = random.uniform(surface.PROXIMAL_END_MM, surface.RADIUS_MM, n)
    reach = np.sqrt(np.maximum(surface.RADIUS_MM**2 - np.maximum(along, 0.0) ** 2, 0.0))
    contact = surface.on_surface(np.column_stack([along, random.uniform(-1.0, 1.0, n) * reach]))
    squared = ((surface.ELECTRODE_MM[None] - contact[:, None]) ** 2).sum(axis=2)
    width = random.uniform(1.0, 4.0, (n, 1))
    depth = 16.0 * np.exp(random.uniform(0.0, np.log(3000.0), (n, 1)))
    bulge = depth * random.uniform(0.0, 0.15, (n, 1)) * (1.0 - np.exp(-squared / (2.0 * (1.5 * width) ** 2)))
    return _signals(bulge - depth * np.exp(-squared / (2.0 * width**2)))


def sparse(random: np.random.Generator, n: int, weights: PocWeights) -> Signals:
    """One to three electrodes of any size and sign."""
    chosen = random.random((n, ELECTRODES)).argsort(axis=1) < random.integers(1, 4, (n, 1))
    return _signals(np.where(chosen, _any_size(random, n), 0.0))


def dense(random: np.random.Generator, n: int, weights: PocWeights) -> Signals:
    """Every electrode anywhere in its range."""
    return _signals(random.uniform(-E_MAX_Q4, E_MAX_Q4, (n, ELECTRODES)))


def tiny(random: np.random.Generator, n: int, weights: PocWeights) -> Signals:
    """Only the last bit: -1, 0 or 1 in each electrode."""
    return random.integers(-1, 2, (n, ELECTRODES), dtype=np.int32)


def corners(random: np.random.Generator, n: int, weights: PocWeights) -> Signals:
    """Every electrode at one end of its range: if any accumulator overflows, it does here."""
    return _signals(random.choice([-E_MAX_Q4, E_MAX_Q4], (n, ELECTRODES)))


def seams(random: np.random.Generator, n: int, weights: PocWeights) -> Signals:
    """Contacts at x = 0, where tip and cylinder meet: the tip's electrodes are scaled to balance the rest."""
    e = -np.abs(_any_size(random, n)) / 4.0
    power = 1 if weights == PocWeights.COMPRESS_N1 else 2
    moments = np.abs(e) ** power * _X_UM
    tip = np.where(moments > 0, moments, 0.0).sum(axis=1, keepdims=True)
    rest = -np.where(moments < 0, moments, 0.0).sum(axis=1, keepdims=True)
    balance = np.divide(rest, tip, out=np.ones_like(rest), where=tip > 0) ** (1.0 / power)
    return _signals(np.where(_X_UM > 0, e * balance, e))


CLASSES: dict[str, Callable[[np.random.Generator, int, PocWeights], Signals]] = {
    "bumps": bumps,
    "sparse": sparse,
    "dense": dense,
    "tiny": tiny,
    "corners": corners,
    "seams": seams,
}


def _any_size(random: np.random.Generator, n: int) -> NDArray[np.float64]:
    size = np.exp(random.uniform(0.0, np.log(E_MAX_Q4), (n, ELECTRODES)))
    signed: NDArray[np.float64] = np.where(random.random((n, ELECTRODES)) < 0.25, size, -size)
    return signed


def _signals(e_q4: NDArray[np.float64]) -> Signals:
    return np.ascontiguousarray(np.clip(np.rint(e_q4), -E_MAX_Q4, E_MAX_Q4).astype(np.int32))
