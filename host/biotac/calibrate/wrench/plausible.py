"""Whether a run's forces are those of this finger: against the default map's, which needs no calibration.

A map learns any forces that it is given, and the held-out error shows no wrong sign, axis or unit: the default map
does.
"""

from __future__ import annotations

import warnings

import numpy as np

from ...core.compute import compute
from ...errors import RecordingError, RecordingWarning
from ...wire.sensor_gen import FULL_SCALE_COUNT
from .plate_recording import Run

FIRM_N = 1.0
# Where both give an axis this share of the force, they agree on the sign in all rows of F1 and F2, and in 0.67 to 1 of
# the rows of twenty simulated fingers that are loaded all over; in fewer where the default map is weak. With a mirrored
# axis they agree in at most 0.33, with exchanged ones in 0.1 to 0.55 of one of them, as a rule: then exchanged forces
# fit better. If they do not, the default map may be wrong.
MARKED_SHARE = 0.3
LEAST_AGREEING, AGREEING, LEAST_ROWS = 0.4, 0.6, 100
# Their medians of |F| over the default's: 0.51, where tip and sides were loaded, too, to 1.08; in pounds 0.11 to 0.23,
# in kilograms times 9.8, 4.9 to 9.9.
LEAST_RATIO, MOST_RATIO = 0.25, 3.0


def check_sense(run: Run) -> None:
    """Raise RecordingError where forces, in Lin's axes, cannot be those of the counts; warn where they may not be."""
    firm = np.linalg.norm(run.truth[:, :3], axis=1) > FIRM_N
    if not firm.any():
        return
    whole = np.clip(np.rint(run.counts[firm]), 0, FULL_SCALE_COUNT).astype(np.uint16)
    felt_n, force_n = compute(whole, run.tare)["force_n"], run.truth[firm, :3]
    felt_size_n, size_n = (np.linalg.norm(rows, axis=1, keepdims=True) for rows in (felt_n, force_n))
    ratio = float(np.median(size_n / np.maximum(felt_size_n, 0.05)))
    if not LEAST_RATIO < ratio < MOST_RATIO:
        raise RecordingError(
            f"{run.name}: the force is {ratio:.2g} times what the default map feels, expected {LEAST_RATIO:g} to "
            f"{MOST_RATIO:g}: is it in newtons (1 kgf is 9.8, 1 lbf 4.4), of these rows?"
        )
    marked = (np.abs(felt_n) > MARKED_SHARE * felt_size_n) & (np.abs(force_n) > MARKED_SHARE * size_n)
    across, felt_across = force_n[:, :2], felt_n[:, :2]
    exchanged = abs((felt_across * across[:, ::-1]).sum()) > (felt_across * across).sum()
    for axis, rows, same in zip("xyz", marked.T, (felt_n * force_n > 0).T, strict=True):
        share = same[rows].mean() if rows.sum() >= LEAST_ROWS else 1.0
        seen = (
            f"{run.name}: force along {axis} has the default map's sign in {share:.0%} of {rows.sum()} rows, expected "
            f"at least {AGREEING:.0%}, of the force on the finger with x to the tip, y to E11's side and z dorsal"
        )
        cure = "check sign, axes and mounting (in .npz files F has X lateral, Y to the tip, Z out of the pad)"
        if share < LEAST_AGREEING or (share < AGREEING and exchanged):
            raise RecordingError(f"{seen}; {cure}")
        if share < AGREEING:
            warnings.warn(f"{seen}: that map may be what errs, so this goes on; {cure}", RecordingWarning, stacklevel=2)
