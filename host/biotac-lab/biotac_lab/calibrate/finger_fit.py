"""The simulated finger's numbers from counts and forces of two real fingers that a plate pressed and sheared.

Where the plate touched was not recorded: each frame's place along the finger and its roll are fitted with the rest,
about the pad's middle. Each half of a recording counts as a finger of its own: two halves of one finger differ by what
the method does not know, two fingers by that and by what they are.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.optimize import least_squares
from scipy.sparse import csr_matrix

from biotac.calibrate.wrench import Run
from biotac.core import geometry as surface
from biotac.sim import PLATE_MM, SKIN, Skin, States, counts_at, deform, resistance_at, resistance_share

from .training import MIRROR

Floats = npt.NDArray[np.float64]

#: Where the fit of each number begins, and within which limits it stays.
NUMBERS = {
    "along_mm": (6.5, 1.0, 20.0), "across_mm": (4.2, 1.0, 12.0), "squeeze": (0.5, 0.05, 3.0),
    "exponent": (0.9, 0.2, 2.0), "growth": (-0.1, -1.0, 1.0), "taper": (0.1, -1.5, 1.5),
    "fixed_share": (0.45, 0.0, 0.9), "bulge_share": (2.0, 0.1, 20.0), "hole": (0.6, 0.05, 20.0),
    "drag_along_n_mm": (1.2, 0.2, 40.0), "drag_across_n_mm": (1.0, 0.2, 40.0), "drag_max_mm": (1.0, 0.3, 20.0),
    "drag_reach_mm": (6.0, 2.0, 60.0), "pile_per_mm2": (0.05, -0.5, 0.5),
}  # fmt: skip
FRAMES = 300  # of each half: neighbours in time say the same again
PLACE, PLACE_SIGMA = np.array([-3.0, 0.0]), np.array([2.0, 0.12])  # mm along the finger, rad of roll
PLACE_LIMITS = (-15.5, -1.4), (7.5, 1.4)
GAIN_SIGMA, FINGER_SIGMA, DRIFT_SIGMA_COUNTS = 0.4, 0.03, 100.0  # priors, the first two of logs
SIGMA_COUNTS, SWING_COUNTS = 30.0, 160.0  # one sigma of an electrode that swings so far; it grows with the root
OUTLIER_SIGMA = 3.0
LEAST_N = 0.05
STEPS, LEAST_GAIN = 60, 1e-4

_FREE, _SHARED = np.unique(np.minimum(np.arange(19), MIRROR), return_inverse=True)  # mirror images share a gain
_KINDS = 4  # squeeze, bulge, drag, pile-up
_N, _G, _OWN = len(NUMBERS), _KINDS * len(_FREE), 19 + 2  # own: sensitivities, a stale tare and its drift


@dataclass(frozen=True)
class Half:
    """Part of a recording: ``counts`` (n, 19), force (n, 3) in N, when in the recording, -.5 to .5, tare and drift."""

    counts: Floats
    force_n: Floats
    time: Floats
    tare: Floats
    drift: Floats

    def states(self, place: Floats) -> States:
        """The plate's contact at ``place`` (n, 2), which carries the recorded force."""
        angle = np.maximum(place[:, 0], 0.0) / surface.RADIUS_MM
        x = np.where(place[:, 0] > 0.0, surface.RADIUS_MM * np.sin(angle), place[:, 0])
        ring = surface.RADIUS_MM * np.cos(angle)
        contact = np.column_stack([x, ring * np.sin(place[:, 1]), -ring * np.cos(place[:, 1])])
        normal = surface.normals_at(contact)
        pressed = -(self.force_n * normal).sum(axis=1)
        still = np.zeros(len(x))
        shear = self.force_n + pressed[:, None] * normal
        return States(contact, np.maximum(pressed, LEAST_N), shear, still, np.full(len(x), PLATE_MM), still)

    def first_place(self) -> Floats:
        """Where the pressed electrodes are, (n, 2): the fit's beginning."""
        pressed = np.maximum(self.tare - self.counts, 0.0) + 1e-6
        centre = pressed @ surface.ELECTRODE_MM / pressed.sum(axis=1, keepdims=True)
        return np.column_stack([centre[:, 0], 0.2 * np.arctan2(centre[:, 1], -centre[:, 2])])


def halves(run: Run, seed: int = 0) -> Iterator[Half]:
    """Both halves of an aligned run, FRAMES of each, drawn at random."""
    rng, n = np.random.default_rng(seed), len(run.counts)
    for first, last in ((0, n // 2), (n // 2, n)):
        rows = np.sort(rng.choice(np.arange(first, last), min(FRAMES, last - first), replace=False))
        yield Half(run.counts[rows], run.truth[rows], rows / n - 0.5, run.tare, run.drift)


class Fit:
    """A fit of Skin to halves of recordings.

    ``skin`` has its numbers, but not a finger's resistances; ``places`` are where the plate touched, (n, 2) for each
    half; ``own`` (halves, 19) are logs of the electrodes' own sensitivities.
    """

    def __init__(self, parts: Sequence[Half]) -> None:
        self.parts = parts
        swing = np.mean([part.counts.std(axis=0) for part in parts], axis=0)
        self._sigma: Floats = SIGMA_COUNTS * np.sqrt(swing / SWING_COUNTS)
        self._ends = _N + _G + _OWN * len(parts) + 2 * np.cumsum([0, *(len(part.counts) for part in parts)])
        places = np.concatenate([part.first_place() for part in parts])
        first, low, high = np.array(list(NUMBERS.values())).T
        still = np.zeros(self._ends[0] - _N)
        sigma = [
            *[GAIN_SIGMA] * _G,
            *([FINGER_SIGMA] * 19 + [1.0, 1.0]) * len(parts),
            *np.tile(PLACE_SIGMA, len(places)),
        ]
        self._sigmas, self._mean = np.array(sigma), np.concatenate([still, np.tile(PLACE, len(places))])
        bounds = [
            np.concatenate([number, np.full(len(still), end), np.tile(place, len(places))])
            for number, place, end in ((low, PLACE_LIMITS[0], -np.inf), (high, PLACE_LIMITS[1], np.inf))
        ]
        found = least_squares(
            self._residuals, np.concatenate([first, still, places.ravel()]), bounds=bounds, loss="soft_l1",
            f_scale=OUTLIER_SIGMA, x_scale=np.concatenate([np.maximum(np.abs(first), 0.1), self._sigmas]),
            jac_sparsity=self._sparsity(), tr_solver="lsmr", max_nfev=STEPS, ftol=LEAST_GAIN,
        )  # fmt: skip
        x: Floats = found.x
        self.skin = self._skin(x)
        self.places = [self._place(x, k) for k in range(len(parts))]
        self.own = np.array([x[self._own(k)][:19] for k in range(len(parts))])
        left = [part.counts - self._counts(x, k, self.skin) for k, part in enumerate(parts)]
        self.rms_counts = np.array([np.sqrt((off**2).mean()) for off in left])
        total = [((part.counts - part.counts.mean(axis=0)) ** 2).sum() for part in parts]
        self.explained = np.array([1.0 - (off**2).sum() / whole for off, whole in zip(left, total, strict=True)])

    def _place(self, x: Floats, k: int) -> Floats:
        place: Floats = x[self._ends[k] : self._ends[k + 1]].reshape(-1, 2)
        return place

    def _own(self, k: int) -> slice:
        return slice(_N + _G + k * _OWN, _N + _G + (k + 1) * _OWN)

    def _skin(self, x: Floats) -> Skin:
        gain = np.exp(x[_N : _N + _G].reshape(_KINDS, -1))[:, _SHARED]
        return replace(SKIN, **dict(zip(NUMBERS, x[:_N].tolist(), strict=True)), gain=gain)

    def _counts(self, x: Floats, k: int, skin: Skin) -> Floats:
        part, own = self.parts[k], x[self._own(k)]
        compression, bulge = (np.exp(own[:19]) * share for share in deform(part.states(self._place(x, k)), skin=skin))
        counts: Floats = counts_at(resistance_at(part.tare) * resistance_share(compression, bulge, skin.fixed_share))
        stale = (own[19] + own[20] * part.time) * DRIFT_SIGMA_COUNTS
        counts += stale[:, None] * part.drift
        return counts

    def _residuals(self, x: Floats) -> Floats:
        skin = self._skin(x)
        off = [(part.counts - self._counts(x, k, skin)) / self._sigma for k, part in enumerate(self.parts)]
        return np.concatenate([*(rows.ravel() for rows in off), (x[_N:] - self._mean) / self._sigmas])

    def _sparsity(self) -> csr_matrix:
        """Which residual depends on which parameter: without it, every place would be tried alone."""
        rows: list[Any] = []
        columns: list[Any] = []
        at = 0
        for k, part in enumerate(self.parts):
            frame, electrode = np.divmod(np.arange(part.counts.size), 19)
            place, own = self._ends[k] + 2 * frame, self._own(k).start
            each = [np.full(len(frame), column) for column in (*range(_N), own + 19, own + 20)]
            each += [_N + kind * len(_FREE) + _SHARED[electrode] for kind in range(_KINDS)]
            each += [own + electrode, place, place + 1]
            columns += each
            rows += [at + np.arange(len(frame))] * len(each)
            at += len(frame)
        priors = np.arange(self._ends[-1] - _N)
        where = np.concatenate([*rows, at + priors]), np.concatenate([*columns, _N + priors])
        return csr_matrix((np.ones(len(where[0]), np.int8), where), shape=(at + len(priors), self._ends[-1]))


def completed(fit: Fit, runs: Sequence[Run]) -> Skin:
    """The skin with the mean resistances of two runs, whose halves the fit's parts are, and what they differ by.

    Sensitivities differ by chance, too: the share that two halves of one run differ by is taken away.
    """
    own = fit.own.reshape(len(runs), 2, 19)
    chance, apart = ((own[:, 0] - own[:, 1]) ** 2).mean() / 4.0, own[0].mean(axis=0) - own[1].mean(axis=0)
    apart *= np.sqrt(max(1.0 - chance / (apart**2 / 2.0).mean(), 0.0) / 2.0)
    rest = np.log([resistance_at(run.tare) for run in runs])
    mean = rest.mean(axis=0)
    return replace(
        fit.skin, r0_ohm=np.exp((mean + mean[MIRROR]) / 2.0), gain_apart=apart,
        r0_apart=(rest[0] - rest[1]) / np.sqrt(2.0),
    )  # fmt: skip


def dumps(skin: Skin, source: str) -> str:
    """The file skin.json of a skin."""
    values = {name: value for name, value in asdict(skin).items() if name in NUMBERS}
    electrodes = {name: value for name, value in asdict(skin).items() if name not in NUMBERS}
    parts = [f'"{name}": {json.dumps(_short(value))}'.replace("], [", "],\n  [") for name, value in electrodes.items()]
    numbers = json.dumps({name: _short(value) for name, value in values.items()})
    return (
        f'{{"source": {json.dumps(source)},\n"numbers": {numbers},\n"electrodes": {{\n ' + ",\n ".join(parts) + "\n}}\n"
    )


def _short(value: Any) -> Any:
    return [_short(number) for number in value] if np.ndim(value) else float(f"{value:.4g}")
