"""The evidence for constants of the tare, found again in recordings: ``python -m biotac_lab.constants FOLDER``.

The recordings have licences that bar them from this repository; host/docs/develop/constants.md names their owners.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

Array = NDArray[np.float64]
SWEEP, WINDOW, STILL_ROWS, STILL_COUNTS, PRESSED_COUNTS = 8, 4, 40, 12, 60


def read(folder: Path, name: str) -> dict[str, Array]:
    with np.load(folder / name) as archive:
        return {key: archive[key].astype(float) for key in archive.files if archive[key].dtype.kind != "U"}


def presses(e: Array, pdc: Array, t_s: Array) -> Array:
    """Of each press between two stretches of still rest: peak and rest left in pressure, the energy's peak and rest."""
    rest = np.array([np.percentile(pdc[np.abs(t_s - at) <= 10], 5) for at in t_s])
    means = sliding_window_view(e, SWEEP, axis=0).mean(-1)
    spans = np.ptp(sliding_window_view(means, STILL_ROWS, axis=0), axis=-1).max(axis=1)
    still = np.flatnonzero((spans <= STILL_COUNTS) & ((pdc - rest)[: len(spans)] < PRESSED_COUNTS))
    ends = np.flatnonzero(np.diff(still) > 1)
    out = []
    for before, after in zip(still[ends] + SWEEP, still[ends + 1], strict=True):
        was, now = slice(before, before + STILL_ROWS), slice(after, after + STILL_ROWS)
        pdc_was, e_was = np.median(pdc[was]), np.median(e[was], axis=0)
        energy = ((means[before:after] - e_was) ** 2).sum(axis=1).max()
        left = ((np.median(e[now], axis=0) - e_was) ** 2).sum()
        out.append((pdc[before:after].max() - pdc_was, np.median(pdc[now]) - pdc_was, energy, left))
    made = np.array(out)
    return made[made[:, 0] > PRESSED_COUNTS]


def span(title: str, values: Array) -> None:
    low, middle, high = np.percentile(values, [0, 50, 100])
    print(f"{title:40}{low:8.2f} to {high:.2f}, median {middle:.2f}, of {values.size}")


def main(folder: Path) -> None:
    trial = read(folder, "robotic_finger/trial_15330.npz")
    peak, left, energy, energy_left = presses(trial["E"], trial["PDC"], trial["t"]).T
    span("press: pressure left, counts", left)
    span("press: energy / what is left of it", energy / energy_left)
    span("press: energy / pressure squared", energy / peak**2)
    btd = read(folder, "btd_biotacsp/btd.npz")["E"]
    off = np.abs(btd[2:-2] - np.median(sliding_window_view(btd, 5, axis=0), axis=-1))
    span("SP: size of glitches, counts", off[off > 24])
    print(f"SP: rounds with one {(off > 24).any(axis=1).mean():.0%}")
    for name in ("F1", "F2"):
        data = read(folder, f"syntouchcontact/{name}.npz")
        idle, base, moved = data["E_idle"], data["E_base"], data["E"]
        span(f"{name}: noise at rest, counts", base.std(axis=0))
        parts = [idle[k : k + 2200] for k in range(0, 20_000, 2200)]
        drift = np.array([np.abs(np.polyfit(np.arange(2200) / 6000, part, 1)[0]) for part in parts])
        span(f"{name}: drift untouched, counts/min", drift)
        shape = np.linalg.svd(idle - idle.mean(axis=0), full_matrices=False)[2][0]
        span(f"{name}: loadings of that drift", shape / shape.mean())
        sums = moved[: len(moved) // WINDOW * WINDOW].reshape(-1, WINDOW, moved.shape[1]).mean(axis=1)
        moves = np.concatenate([np.abs(sums[lag:] - sums[:-lag]) for lag in (1, 4, 16, 64)])
        alone = moves / np.maximum(moves.sum(axis=1, keepdims=True) - moves, 1)
        span(f"{name}: an electrode's move / all others'", alone[moves > 20])
        steps = np.diff(moved, axis=0)
        total, along = np.abs(steps).sum(axis=1), np.abs(steps.sum(axis=1))
        leaps = (total >= 608) & (along >= 7 / 8 * total)
        span(f"{name}: leap one way, largest / mean", np.abs(steps[leaps]).max(axis=1) * 19 / total[leaps])


if __name__ == "__main__":
    main(Path(sys.argv[1]))
