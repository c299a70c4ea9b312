"""The simulated finger's numbers from real fingers under plates: of two the force is known, of others the normal.

Unrecorded values of a row are fitted with the others (plates.py). Each half of a recording with forces counts as a
finger of its own: two halves of one finger differ by the method's error, two fingers also by their own properties.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
import scipy

from biotac.calibrate.wrench import Run
from biotac.core import geometry as surface
from biotac.sim import SKIN, Skin, counts_of, deform, resistance_at

from .plates import (
    LOOK_COUNTS,
    LOOK_FORCES_N,
    LOOK_ROWS,
    TENTHS,
    Floats,
    KnownForce,
    KnownNormal,
    Part,
    place_under,
    pressing,
)  # fmt: skip
from .training import MIRROR

#: Where the fit of each number begins, and the limits. F1 and F2 are fitted alike with a squeeze of 0.25 to 8; from 2
#: on light touches displace all fluid, which trial_15330's bulges under light presses contradict. The skin's drag is as
#: open: at 0.5 mm, or twice as stiff, the default map would have the wrong sign of a pull along the finger in every
#: third row of a simulated finger, where F1 and F2 have it in none.
NUMBERS = {
    "along_mm": (6.5, 1.0, 20.0), "across_mm": (4.2, 1.0, 12.0), "squeeze": (0.5, 0.05, 1.0),
    "exponent": (0.9, 0.2, 2.0), "growth": (-0.1, -1.0, 1.0), "taper": (0.1, -1.5, 1.5),
    "fixed_share": (0.45, 0.0, 0.9), "bulge_share": (2.0, 0.1, 20.0), "hole": (0.6, 0.05, 20.0),
    "drag_along_n_mm": (1.2, 0.2, 4.1), "drag_across_n_mm": (1.0, 0.2, 5.5), "drag_max_mm": (1.2, 1.1, 20.0),
    "drag_reach_mm": (6.0, 2.0, 60.0), "pile_per_mm2": (0.05, -0.5, 0.5), "lead_mm": (1.0, -3.0, 6.0),
    "lead_roll": (0.2, 0.0, 0.6),
}  # fmt: skip
GAIN_SIGMA, FINGER_SIGMA = 0.25, 0.1  # priors of logs
SELDOM, SELDOM_SIGMA = (17, 18), 0.1  # E18 and E19: few rows press there
# The free-air recordings of F1 and F2 are not their rest: at 1 N nearly every electrode reads higher, by as much as at
# 3 N. As bulges, that would mean a fluid that light touches displace; trial_15330, with a known rest before each press,
# shows none. Where the stale part of the tare begins, and one sigma each of that part and of the tare's drift.
STALE_COUNTS, STALE_SIGMA_COUNTS, DRIFT_SIGMA_COUNTS = 100.0, 300.0, 100.0
LOOK_SIGMA = 0.003  # of medians of the point of contact over the radius: a dozen against thousands of rows
SIGMA_COUNTS, SWING_COUNTS = 30.0, 160.0  # one sigma of an electrode that swings so far; it grows with the root
OUTLIER_SIGMA = 3.0
STEPS, LEAST_GAIN = 60, 1e-4
FIRST_ROLL_SIGMA = 0.05  # first the rolls are the point of contact's: from any, gains take their place

_FREE, _SHARED = np.unique(np.minimum(np.arange(19), MIRROR), return_inverse=True)  # mirror images share a gain
_KINDS = 4  # squeeze, bulge, drag, pile-up
_N, _G, _OWN = len(NUMBERS), _KINDS * len(_FREE), 19 + 2  # own: sensitivities, a stale tare and the drift of it


@dataclass(frozen=True)
class Look:
    """Where points of contact lie over the radius, (n, 2) across and along, under plates at ``place`` (n, 2)."""

    place: Floats
    seen: Floats

    def off(self, skin: Skin, rest: Floats) -> Floats:
        """By how many sigmas a finger with ``rest`` (19,) counts at rest and this skin sees them elsewhere, (n, 2)."""
        rows = []
        for force_n in LOOK_FORCES_N:
            states = pressing(self.place, np.full(len(self.place), force_n))
            signal = _counts(rest, deform(states, skin=skin), skin) - rest
            point = surface.point_of_contact(np.where(signal < -0.5, signal, -1e-3), 1.0, compressed=True)
            rows.append(point[:, [1, 0]] / surface.RADIUS_MM - self.seen)
        return np.concatenate(rows) / LOOK_SIGMA


def _counts(rest: Floats, deformation: tuple[Floats, Floats], skin: Skin) -> Floats:
    """Counts (n, 19) of a finger that has ``rest`` (19,) counts at rest, as sensitive as ``skin``."""
    return counts_of(resistance_at(rest), np.ones(19), deformation, np.zeros(len(deformation[0])), skin)


def look_of(plate: KnownNormal) -> Look:
    """The medians of the recorded points of contact in bins of a tenth of the normal, to either side and to the tip."""
    point = surface.point_of_contact(plate.signal, 1.0, compressed=True) / surface.RADIUS_MM
    x, y = plate.normal[:, 0], np.abs(plate.normal[:, 1])
    place, seen = [], []
    for sideways, normal, other in ((True, y, np.abs(x)), (False, x, y)):
        for low in TENTHS:
            rows = (normal >= low) & (normal < low + 0.1) & (other < 0.35) & (plate.pressure > LOOK_COUNTS)
            if rows.sum() < LOOK_ROWS:
                continue
            place.append(place_under(low + 0.05, sideways=sideways))
            across, along = np.nanmedian(np.abs(point[rows, 1])), np.nanmedian(point[rows, 0])
            seen.append([across, np.nan] if sideways else [np.nan, along])
    return Look(np.array(place), np.array(seen))


class Fit:
    """A fit of Skin to parts of recordings: halves with forces, two of each finger, and rows of plates of known normal.

    ``skin`` has no finger's resistances; ``rows`` are the fitted values of each part's rows; ``own`` (parts, 19) are
    logs of the electrodes' own sensitivities.
    """

    def __init__(self, forces: Sequence[KnownForce], normals: Sequence[KnownNormal]) -> None:
        parts: list[Part] = [*forces, *normals]
        self.parts = parts
        self._rest: Floats = np.mean([(part.tare + part.tare[MIRROR]) / 2.0 for part in forces], axis=0)
        self._looks = [look_of(part) for part in normals]
        swing = np.mean([part.counts.std(axis=0) for part in forces], axis=0)
        self._sigma: Floats = SIGMA_COUNTS * np.sqrt(swing / SWING_COUNTS)
        sizes = [part.unknown.first.size for part in parts]
        self._ends = _N + _G + _OWN * len(parts) + np.cumsum([0, *sizes])
        first, low, high = np.array(list(NUMBERS.values())).T
        still = np.zeros(self._ends[0] - _N)
        gains = np.full((_KINDS, len(_FREE)), GAIN_SIGMA)
        gains[:2, _SHARED[list(SELDOM)]] = SELDOM_SIGMA
        sigma: list[float] = gains.ravel().tolist()
        for _ in parts:
            sigma += [FINGER_SIGMA] * 19 + [STALE_SIGMA_COUNTS / DRIFT_SIGMA_COUNTS, 1.0]
        rows = [part.unknown for part in parts]
        self._sigmas = np.concatenate([sigma, *(row.sigma.ravel() for row in rows)])
        self._mean = np.concatenate([still, *(row.mean.ravel() for row in rows)])
        bounds = (
            np.concatenate([low, np.full(len(still), -np.inf), *(row.low.ravel() for row in rows)]),
            np.concatenate([high, np.full(len(still), np.inf), *(row.high.ravel() for row in rows)]),
        )
        x: Floats = np.concatenate([first, still, *(row.first.ravel() for row in rows)])
        for k in range(len(forces)):
            x[self._own(k)][19] = STALE_COUNTS / DRIFT_SIGMA_COUNTS
        final = self._sigmas
        for sigmas in (self._narrow(final), final):
            self._sigmas = sigmas
            x = scipy.optimize.least_squares(
                self._residuals, x, bounds=bounds, loss="soft_l1", f_scale=OUTLIER_SIGMA,
                x_scale=np.concatenate([np.maximum(np.abs(first), 0.1), sigmas]), jac_sparsity=self._sparsity(),
                tr_solver="lsmr", max_nfev=STEPS, ftol=LEAST_GAIN,
            ).x  # fmt: skip
        self.skin = self._skin(x)
        self.rows = [self._row(x, k) for k in range(len(parts))]
        self.own = self._owns(x)
        self.stale_counts = DRIFT_SIGMA_COUNTS * np.array([x[self._own(k)][19] for k in range(len(parts))])
        left = [part.counts - self._counts(x, k, self.skin) for k, part in enumerate(parts)]
        self.rms_counts = np.array([np.sqrt((off**2).mean()) for off in left])
        total = [((part.counts - part.counts.mean(axis=0)) ** 2).sum() for part in parts]
        self.explained = np.array([1.0 - (off**2).sum() / whole for off, whole in zip(left, total, strict=True)])

    def _narrow(self, sigmas: Floats) -> Floats:
        """The priors of the first pass: rolls are the point of contact's where no normal is known."""
        narrow: Floats = sigmas.copy()
        for k, part in enumerate(self.parts):
            if isinstance(part, KnownForce):
                narrow[self._ends[k] - _N + 1 : self._ends[k + 1] - _N : 2] = FIRST_ROLL_SIGMA
        return narrow

    def _row(self, x: Floats, k: int) -> Floats:
        row: Floats = x[self._ends[k] : self._ends[k + 1]].reshape(self.parts[k].unknown.first.shape)
        return row

    def _own(self, k: int) -> slice:
        return slice(_N + _G + k * _OWN, _N + _G + (k + 1) * _OWN)

    def _owns(self, x: Floats) -> Floats:
        """Logs of the parts' own sensitivities; the share common to fingers with forces belongs to the gains."""
        own = np.array([x[self._own(k)][:19] for k in range(len(self.parts))])
        common = own[[isinstance(part, KnownForce) for part in self.parts]].mean(axis=0)
        shared: Floats = own - (common + common[MIRROR]) / 2.0
        return shared

    def _skin(self, x: Floats) -> Skin:
        gain = np.exp(x[_N : _N + _G].reshape(_KINDS, -1))[:, _SHARED]
        return replace(SKIN, **dict(zip(NUMBERS, x[:_N].tolist(), strict=True)), gain=gain)

    def _counts(self, x: Floats, k: int, skin: Skin) -> Floats:
        part, own, louder = self.parts[k], x[self._own(k)], np.exp(self._owns(x)[k])
        compression, bulge = (louder * share for share in deform(part.states(self._row(x, k)), skin=skin))
        counts = _counts(part.tare, (compression, bulge), skin)
        stale = (own[19] + own[20] * part.time) * DRIFT_SIGMA_COUNTS
        counts += stale[:, None] * part.drift
        return counts

    def _residuals(self, x: Floats) -> Floats:
        skin = self._skin(x)
        off = [(part.counts - self._counts(x, k, skin)) / self._sigma for k, part in enumerate(self.parts)]
        seen = [np.nan_to_num(look.off(skin, self._rest)).ravel() for look in self._looks]
        return np.concatenate([
            *(rows.ravel() for rows in off), (x[_N:] - self._mean) / self._sigmas, *seen,
        ])  # fmt: skip

    def _sparsity(self) -> scipy.sparse.csr_matrix:
        """Which residual depends on which parameter: without it, every place would be tried alone."""
        rows: list[Any] = []
        columns: list[Any] = []
        at = 0
        for k, part in enumerate(self.parts):
            frame, electrode = np.divmod(np.arange(part.counts.size), 19)
            width, own = part.unknown.first.shape[1], self._own(k).start
            each = [np.full(len(frame), column) for column in (*range(_N), own + 19, own + 20)]
            each += [_N + kind * len(_FREE) + _SHARED[electrode] for kind in range(_KINDS)]
            owners = {own, *(self._own(j).start for j, other in enumerate(self.parts) if isinstance(other, KnownForce))}
            each += [start + mirror for start in sorted(owners) for mirror in (electrode, MIRROR[electrode])]
            each += [*(self._ends[k] + width * frame + column for column in range(width))]
            columns += each
            rows += [at + np.arange(len(frame))] * len(each)
            at += len(frame)
        priors = np.arange(self._ends[-1] - _N)
        columns.append(_N + priors)
        rows.append(at + priors)
        at += len(priors)
        seen = sum(len(LOOK_FORCES_N) * look.seen.size for look in self._looks)
        general = _N + 2 * len(_FREE)  # a plate that does not shear: numbers, squeeze and bulge
        rows.append(np.repeat(at + np.arange(seen), general))
        columns.append(np.tile(np.arange(general), seen))
        where = np.concatenate(rows), np.concatenate(columns)
        return scipy.sparse.csr_matrix((np.ones(len(where[0]), np.int8), where), shape=(at + seen, self._ends[-1]))


def completed(fit: Fit, runs: Sequence[Run]) -> Skin:
    """The skin with the mean resistances of two runs, which have the fit's parts as halves, and with their difference.

    Sensitivities differ by chance, too: the difference between two halves of one run is subtracted.
    """
    own = fit.own[: 2 * len(runs)].reshape(len(runs), 2, 19)
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
