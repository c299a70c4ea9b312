"""How far each kernel (tools/bench/kernels) is from the exact result, and the effect of one step of the sensor's ADC.

The reference is no kernel: sums of whole numbers, exact in int64, finished in extended precision. Errors are in
um for the point (distance), mN for the force and mN*mm for torque y, z and torque x (the axis furthest off).
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

import boards
from biotac.core import geometry as surface
from biotac.kernels.compiled import FORCE_GAINS, TORQUE_GAINS, default_settings
from biotac.sim import physics
from biotac.wire import sensor_gen as sensor
from biotac.wire.messages_gen import PocWeights

Signals = NDArray[np.int32]  # (n, 19), 1/16 count, compression negative
Floats = NDArray[np.float64]

NAMES = ("shipped", "double", "float", "exact int64", "quick")  # as kernels.c has them
QUANTITIES = {"PoC": "um", "force": "mN", "torque y, z": "N*um", "torque x": "N*um"}  # N*um is the wire's mN*mm
E_MAX_Q4 = 16 * sensor.FULL_SCALE_COUNT
UM = np.array(sensor.ELECTRODE_UM, dtype=np.int64)
MILLI = np.array(sensor.ELECTRODE_NORMAL_MILLI, dtype=np.int64)
ARM_NM = np.cross(UM, MILLI)
CLIMBERS, STEPS = 100, 1000
SEED = 2013


@cache
def library() -> ctypes.CDLL:
    """The kernels, compiled for this computer."""
    boards.BUILD.mkdir(parents=True, exist_ok=True)
    out = boards.BUILD / "kernels.so"
    flags = ["-std=c11", "-O2", "-shared", "-fPIC", "-ffp-contract=off", *boards.INCLUDE]
    boards.command("cc", *flags, *boards.CORE, *boards.APART, *boards.JUDGED, "-lm", "-o", out)
    return ctypes.CDLL(str(out))


def computed(name: str, weights: PocWeights, e_q4: Signals) -> Floats:
    """(n, 9): point, force and torque by one kernel; a NaN point where it gives none."""
    e_q4 = np.ascontiguousarray(e_q4, dtype=np.int32)
    out = np.empty((len(e_q4), 9))
    pointers = ctypes.c_void_p(e_q4.ctypes.data), ctypes.c_void_p(out.ctypes.data)
    library().kernel_frames(NAMES.index(name), int(weights), ctypes.c_int64(len(e_q4)), *pointers)
    return out


def exact(weights: PocWeights, e_q4: NDArray[np.generic]) -> NDArray[np.longdouble]:
    """The same columns by the judge, with the default gains; whole signals are int64, others extended precision."""
    e: Any = e_q4.astype(np.int64 if np.issubdtype(e_q4.dtype, np.integer) else np.longdouble)
    compressed = e if weights == PocWeights.ABS_N2 else np.where(e < 0, -e, e * 0)
    w = compressed if weights == PocWeights.COMPRESS_N1 else compressed * compressed
    total, moment = w.sum(axis=1).astype(np.longdouble), (w @ UM).astype(np.longdouble)
    tip = moment[:, 0] > 0
    with np.errstate(divide="ignore", invalid="ignore"):
        square = (moment**2).sum(axis=1) - np.where(tip, 0, moment[:, 0] ** 2)
        point = moment * sensor.CORE_RADIUS_UM / np.sqrt(square)[:, None]
        point[:, 0] = np.where(tip, point[:, 0], moment[:, 0] / total)
    point[total <= 0] = np.nan
    defaults = default_settings()
    force = (e @ MILLI).astype(np.longdouble) * [defaults[gain] for gain in FORCE_GAINS] / np.longdouble(16e9)
    arm = (e @ ARM_NM[:, 1:]).astype(np.longdouble) * [defaults[gain] for gain in TORQUE_GAINS] / np.longdouble(16e12)
    lever = (point[:, 1] * force[:, 2] - point[:, 2] * force[:, 1]) / 1000
    return np.column_stack([point, force, lever, arm])


def distances(off: NDArray[np.longdouble]) -> Floats:
    """(n, 4) in the order of QUANTITIES, of differences (n, 9)."""
    size = np.abs(off)
    point = np.sqrt((off[:, :3] ** 2).sum(axis=1))
    columns = (point, size[:, 3:6].max(axis=1), size[:, 7:].max(axis=1), size[:, 6])
    return np.column_stack(columns).astype(np.float64)


def errors(name: str, weights: PocWeights, e_q4: Signals) -> Floats:
    """(n, 4); NaN where the judge has no point, infinite where only one of the two has."""
    got, want = computed(name, weights, e_q4), exact(weights, e_q4)
    out = distances(got - want)
    nan_differs = np.isnan(got[:, 0]) != np.isnan(want[:, 0])
    out[np.ix_(nan_differs, [0, 3])] = np.inf
    return out


@cache
def pressed(whole: bool) -> list[Floats]:
    """Signals in count (n, 19) of simulated fingers under 1 N by a flat of 2 mm at places all over them."""
    along, across = np.meshgrid(np.linspace(-14.0, 4.0, 13), np.linspace(-0.85, 0.85, 13))
    reach = np.sqrt(surface.RADIUS_MM**2 - np.maximum(along, 0.0) ** 2)
    contact = surface.on_surface(np.column_stack([along.ravel(), (across * reach).ravel()]))
    n = len(contact)
    zeros = np.zeros(n)
    states = physics.States(contact, np.ones(n), np.zeros((n, 3)), zeros, np.full(n, 2.0), zeros)
    out = []
    for finger in map(physics.SimFinger, range(8)):  # each with other resistances
        counts = finger.counts(states)
        out.append((np.rint(counts) if whole else counts) - finger.rest_counts(zeros))
    return out


def one_adc_step(weights: PocWeights) -> list[float]:
    """RMS change of each quantity by the converter's rounding: the limit that no kernel can beat."""
    results = (exact(weights, 16 * np.concatenate(pressed(whole)).astype(np.longdouble)) for whole in (True, False))
    change = distances(np.subtract(*results))
    return [float(rms) for rms in np.sqrt((change**2).mean(axis=0))]


def frames(weights: PocWeights, n: int) -> Signals:
    """Presses, and n random frames of each of four kinds that a kernel may get wrong."""
    random = np.random.default_rng([SEED, int(weights)])
    size = np.exp(random.uniform(0.0, np.log(E_MAX_Q4), (n, 19)))
    any_size = np.where(random.random((n, 19)) < 0.25, size, -size)
    few = random.random((n, 19)).argsort(axis=1) < random.integers(1, 4, (n, 1))
    # Contacts where tip and cylinder meet: the tip's electrodes are scaled to balance the rest.
    power = 1 if weights == PocWeights.COMPRESS_N1 else 2
    moments = (size / 4) ** power * UM[:, 0]
    tip, rest = (np.where(side, moments, 0.0).sum(axis=1, keepdims=True) for side in (UM[:, 0] > 0, UM[:, 0] < 0))
    seam = -size / 4 * np.where(UM[:, 0] > 0, (-rest / tip) ** (1 / power), 1.0)
    kinds = [
        16 * np.concatenate(pressed(whole=True)),
        np.where(few, any_size, 0.0),
        random.uniform(-E_MAX_Q4, E_MAX_Q4, (n, 19)),
        random.choice([-E_MAX_Q4, E_MAX_Q4], (n, 19)),  # if any accumulator overflows, it does here
        random.integers(-1, 2, (n, 19)),
        seam,
    ]
    out: Signals = np.clip(np.rint(np.concatenate(kinds)), -E_MAX_Q4, E_MAX_Q4).astype(np.int32)
    return out


def climbed_um(name: str, weights: PocWeights, steps: int = STEPS) -> float:
    """The largest error of the point that hill climbing finds, from many random frames at once."""
    random = np.random.default_rng(SEED)
    here = frames(weights, CLIMBERS)[-CLIMBERS:]
    height = np.full(CLIMBERS, -1.0)
    for _ in range(steps):
        tried = here.copy()
        rows, columns = np.arange(CLIMBERS), random.integers(0, 19, CLIMBERS)
        old = tried[rows, columns]
        size = np.exp(random.uniform(0.0, np.log(E_MAX_Q4), CLIMBERS))
        changes = [-size, old + random.integers(-1, 2, CLIMBERS), old + random.integers(-256, 257, CLIMBERS), -old]
        tried[rows, columns] = np.choose(random.integers(0, len(changes), CLIMBERS), changes).astype(np.int32)
        scaled = random.random(CLIMBERS) < 0.2  # all of them, a little larger or smaller
        tried[scaled] = (tried[scaled] * random.uniform(0.9, 1.1, (int(scaled.sum()), 1))).astype(np.int32)
        tried = np.clip(tried, -E_MAX_Q4, E_MAX_Q4).astype(np.int32)
        error = errors(name, weights, tried)[:, 0]
        better = np.isfinite(error) & (error >= height)
        here[better], height[better] = tried[better], error[better]
    return float(height.max())
