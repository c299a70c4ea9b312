"""Lin 2013, IV.B in float64: the tare of the paper's authors, as a reference for the board's machine.

"A 100 ms window was used to tare the measured values if the change in impedance was small or drifting. The threshold
was set to 1000 bit^2, equivalent to roughly 0.5 N." The plain reading is of windows side by side, each of which either
gives a new tare or does not; the change is from the tare in force to the window's mean. Two others: a window that ends
in every row, so that the change allowed is in 10 ms and not in 100; and the change within the window. The threshold is
the sum of the change's squares over the 19 electrodes.
"""

from __future__ import annotations

import numpy as np

from .trial import Bools, Floats, Words

WINDOW_ROWS = 10  # 100 ms
THRESHOLD_COUNT2 = 1000.0
READINGS = ("windows side by side", "a window ends in every row", "change within the window")


def renormalised(counts: Words, reading: str = READINGS[0]) -> tuple[Floats, Bools]:
    """The tare (n, 19) in counts in force at each row of ``counts`` (n, 19), and whether the row gave a new one (n,).

    The first window's mean is the first tare; until then it is NaN. The last of READINGS compares the two halves of the
    window that ends in a row; it has no tare to compare with.
    """
    values = np.asarray(counts, np.float64)
    tare, is_new = np.full(values.shape, np.nan), np.zeros(len(values), np.bool_)
    base = np.full(values.shape[1], np.nan)
    half = WINDOW_ROWS // 2
    every = WINDOW_ROWS if reading == READINGS[0] else 1
    for k in range(WINDOW_ROWS - 1, len(values)):
        window = values[k + 1 - WINDOW_ROWS : k + 1]
        mean = window.mean(axis=0)
        change = window[half:].mean(axis=0) - window[:half].mean(axis=0) if reading == READINGS[2] else mean - base
        if (k + 1) % every == 0 and (np.isnan(base[0]) or (change**2).sum() < THRESHOLD_COUNT2):
            base, is_new[k] = mean, True
        tare[k] = base
    return tare, is_new
