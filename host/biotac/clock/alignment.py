"""Aligns two clocks by the load on the finger, as seen in the counts and by the reference.

Each stream is reduced to one number that grows with the load. Its rate of change is cross-correlated over every shift
that leaves enough overlap; the peak, to a fraction of a step, is the offset between the clocks. Pieces of the run are
then aligned on their own, and the slope of a line through their offsets is the clocks' drift against each other. A peak
that does not stand out is refused: two files that do not belong together also have a best shift.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import numpy.typing as npt
from numpy.lib.stride_tricks import sliding_window_view

from ..errors import RecordingError
from ..wire import sensor_gen as _sensor

Floats = npt.NDArray[np.float64]

STEP_S = 0.01  # a board's round
# Times after a frame's t_us at which the electrodes, on average, and pressure are read.
ELECTRODES_S = float(np.mean([_sensor.SLOTS.index(name) for name in _sensor.ELECTRODE_NAMES])) / _sensor.SLOT_HZ
PDC_S = _sensor.SLOTS.index("PDC") / _sensor.SLOT_HZ
MAX_GAP_S = 0.05  # between two samples of the reference, or 1.5 of the usual steps: in a longer gap the load is unknown
MIN_OVERLAP_S = 10.0
MIN_OVERLAP_SHARE = 0.3  # of the shorter stream
MIN_PEAK = 0.4  # correlation; unrelated streams of two minutes have 0.2 to 0.3
# Standard errors between the peak and the best further than APART_S from it (Fisher's z). Presses repeated like
# clockwork fit almost as well a period off, but a minute of them is enough to tell the shifts apart.
MIN_CLEAR = 5.0
APART_S = 0.4
PIECE_S = 15.0
PIECE_SEARCH_S = 0.3
MIN_PIECES = 4  # for a drift
MAX_DRIFT_PPM = 1000.0
MAX_SCATTER_S = 0.02  # of the pieces about the fitted line; with more, one of the clocks jumped
MIN_KEPT = 0.8  # of the pieces in which something happens; where more match nowhere near, one of the clocks jumped


@dataclass(frozen=True)
class Alignment:
    """``t_reference = t_board + offset_s + drift_ppm * 1e-6 * (t_board - middle_s)``.

    ``peak`` is the correlation there, ``runner_up`` the best elsewhere, and ``clear`` the standard errors between them.
    ``width_s`` is the peak's width at half height, ``scatter_s`` the RMS of ``pieces`` offsets about the line, and
    ``overlap_s`` the seconds that are in both streams.
    """

    offset_s: float
    drift_ppm: float
    middle_s: float
    peak: float
    runner_up: float
    clear: float
    width_s: float
    scatter_s: float
    pieces: int
    overlap_s: float

    @property
    def sigma_s(self) -> float:
        """One standard deviation of ``offset_s``: by the scatter of the pieces, or by the peak's height and width.

        A peak of correlation r moves as one of overlap_s / width_s independent values does.
        """
        values = max(self.overlap_s / max(self.width_s, STEP_S), 1.0)
        by_peak = self.width_s / 2.355 * float(np.sqrt(max(1.0 / self.peak**2 - 1.0, 0.0) / values))
        return max(by_peak, self.scatter_s / float(np.sqrt(max(self.pieces, 1))))

    def __str__(self) -> str:
        return (
            f"clocks: offset {self.offset_s:+.4f} s, {self.drift_ppm:+.0f} ppm; correlation {self.peak:.2f}, next best "
            f"{self.runner_up:.2f}, {self.width_s * 1e3:.0f} ms wide at half height; {self.pieces} pieces scatter by "
            f"{self.scatter_s * 1e3:.1f} ms"
        )

    def to_reference_s(self, t_board_s: Floats) -> Floats:
        """The reference's times (n,) at the board's times (n,), both in s."""
        return t_board_s + self.offset_s + 1e-6 * self.drift_ppm * (t_board_s - self.middle_s)


def align(where: str, board_s: Floats, board_load: Floats, reference_s: Floats, reference_load: Floats) -> Alignment:
    """Align loads (n,) at ``board_s`` and (m,) at ``reference_s``; scale and offset do not matter, NaN is left out.

    Raises RecordingError that begins with ``where`` for streams that are too short, a peak that is too low or not
    clear, or too much drift or scatter.
    """
    a, a_start = _changes(board_s, board_load)
    b, b_start = _changes(reference_s, reference_load)
    least = max(round(MIN_OVERLAP_S / STEP_S), round(MIN_OVERLAP_SHARE * min(len(a), len(b))))
    if min(len(a), len(b)) < least:
        raise RecordingError(
            f"{where}: {min(len(a), len(b)) * STEP_S:.1f} s of force or counts: expected at least {MIN_OVERLAP_S:g} s "
            "to align them; record longer"
        )
    lags, correlation, overlap = _correlate(a, b, least)
    best = int(np.argmax(correlation))
    peak, shift = _peak(correlation, best)
    far = np.abs(lags - lags[best]) > APART_S / STEP_S
    runner_up = float(max(correlation[far].max(initial=0.0), 0.0))
    offset = b_start - a_start + (lags[best] + shift) * STEP_S
    not_aligned = f"{where}: force and counts are not aligned"
    if peak < MIN_PEAK:
        raise RecordingError(
            f"{not_aligned}: they agree best with the force {offset:+.2f} s off the counts' clock, where their "
            f"changes correlate with {peak:.2f}: expected at least {MIN_PEAK:g}; are both from the same run?"
        )
    width_s = _width(correlation, best)
    overlap_s = float(overlap[best] * STEP_S)
    fisher = np.arctanh(np.minimum([peak, runner_up], 0.9999))
    clear = float((fisher[0] - fisher[1]) * np.sqrt(overlap_s / max(width_s, STEP_S)))
    if clear < MIN_CLEAR:
        raise RecordingError(
            f"{not_aligned}: their best agreement ({peak:.2f}) is not clear: another shift has {runner_up:.2f}, "
            f"{clear:.1f} standard errors lower, expected {MIN_CLEAR:g}; press less regularly, or record longer"
        )
    drift = _drift(a, b, a_start, b_start, int(lags[best]), offset)
    if abs(drift.ppm) > MAX_DRIFT_PPM or drift.scatter_s > MAX_SCATTER_S:
        raise RecordingError(
            f"{not_aligned}: the clocks drift by {drift.ppm:.0f} ppm over the run, and parts of it lie "
            f"{drift.scatter_s * 1e3:.0f} ms off that: expected at most {MAX_DRIFT_PPM:g} ppm and "
            f"{MAX_SCATTER_S * 1e3:g} ms; did a clock jump?"
        )
    if drift.pieces >= MIN_PIECES and len(drift.lost_s) > (1.0 - MIN_KEPT) * drift.busy:
        raise RecordingError(
            f"{not_aligned}: {len(drift.lost_s)} of {drift.busy} pieces, {min(drift.lost_s) - board_s[0]:.0f} to "
            f"{max(drift.lost_s) - board_s[0]:.0f} s after the start, match at no shift near that of the others: "
            f"expected at most {1.0 - MIN_KEPT:.0%}; did a clock jump there?"
        )
    return Alignment(
        float(drift.offset_s), drift.ppm, drift.middle_s, peak, runner_up, clear, width_s, scatter_s=drift.scatter_s,
        pieces=drift.pieces, overlap_s=overlap_s,
    )  # fmt: skip


def align_best(where: str, board: list[tuple[Floats, Floats]], t_s: Floats, load: Floats) -> Alignment:
    """``align`` by each of the board's (times, loads); the result with the highest peak. Raises as ``align`` does."""
    found: list[Alignment] = []
    refusals: list[RecordingError] = []
    for board_s, board_load in board:
        try:
            found.append(align(where, board_s, board_load, t_s, load))
        except RecordingError as error:
            refusals.append(error)
    if not found:
        raise refusals[0]
    return max(found, key=lambda alignment: alignment.peak)


def means(t_s: Floats, values: Floats, at_s: Floats) -> Floats:
    """Means (k, columns) over a board's step around ``at_s`` (k,); linear interpolation where samples are sparser.

    NaN beyond the ends and in gaps.
    """
    good = np.isfinite(values).all(axis=1)
    t_s, values = t_s[good], values[good]
    sums = np.concatenate([np.zeros((1, values.shape[1])), np.cumsum(values - values[0], axis=0)])
    low, high = (np.searchsorted(t_s, at_s + side * STEP_S) for side in (-0.5, 0.5))
    many = high - low
    with np.errstate(invalid="ignore", divide="ignore"):
        result: Floats = (sums[high] - sums[low]) / many[:, None] + values[0]
    after = np.clip(np.searchsorted(t_s, at_s), 1, len(t_s) - 1)
    share = (at_s - t_s[after - 1]) / (t_s[after] - t_s[after - 1])
    line = values[after - 1] + share[:, None] * (values[after] - values[after - 1])
    result = np.where((many >= 2)[:, None], result, line)
    longest_s = max(MAX_GAP_S, 1.5 * float(np.median(np.diff(t_s))))
    gap = (t_s[after] - t_s[after - 1] > longest_s) & (many == 0)
    result[gap | (at_s < t_s[0]) | (at_s > t_s[-1])] = np.nan
    return result


def _changes(t_s: Floats, load: Floats) -> tuple[Floats, float]:
    """Rate of change of the load on an even grid, and the grid's start in s. Gaps are interpolated linearly."""
    start = float(t_s[0])
    # cells are centred on their times: a board's one sample per cell keeps that time, and means are centred
    edges = start + STEP_S * (np.arange(int((t_s[-1] - start) / STEP_S) + 2, dtype=np.float64) - 0.5)
    cells = len(edges) - 1
    cell = np.searchsorted(edges, t_s, side="right") - 1
    good = np.isfinite(load) & np.isfinite(t_s) & (cell >= 0) & (cell < cells)
    count = np.bincount(cell[good], minlength=cells)
    known = count > 0
    # means rather than the nearest sample: the noise of a sensor ten times as fast as the grid would be aliased; at
    # the mean time of each cell's samples, which lie to one side of the middle depending on their phase
    sums = (np.bincount(cell[good], weights=values[good], minlength=cells) for values in (t_s, load))
    mean_s, mean_load = (values[known] / count[known] for values in sums)
    even: Floats = np.interp(edges[:-1] + STEP_S / 2.0, mean_s, mean_load) if known.any() else np.zeros(cells)
    smooth = np.convolve(np.pad(even, 2, mode="edge"), np.full(5, 0.2), mode="valid")
    change: Floats = np.gradient(smooth)
    # without a limit a single knock would decide alone
    size = float(np.sqrt((change**2).mean()))
    change = np.clip(change, -3.0 * size, 3.0 * size)
    return change - change.mean(), start


def _correlate(a: Floats, b: Floats, least: int) -> tuple[npt.NDArray[np.int64], Floats, npt.NDArray[np.int64]]:
    """Lags, correlation of a[k] with b[k + lag], and overlap in steps, for every lag that leaves ``least`` steps."""
    n = 1 << (len(a) + len(b)).bit_length()
    spectrum = np.conj(np.fft.rfft(a, n)) * np.fft.rfft(b, n)
    product = np.fft.irfft(spectrum, n)
    lags = np.arange(-(len(a) - least), len(b) - least + 1)
    begin, end = np.maximum(0, -lags), np.minimum(len(a), len(b) - lags)
    energy_a, energy_b = (np.concatenate([[0.0], np.cumsum(v**2)]) for v in (a, b))
    ea = energy_a[end] - energy_a[begin]
    eb = energy_b[end + lags] - energy_b[begin + lags]
    # an overlap in which almost nothing happens correlates by chance
    floor = 0.2 * min(energy_a[-1], energy_b[-1] * energy_a[-1] / max(energy_b[-1], 1e-300))
    norm = np.sqrt(np.maximum(ea, floor) * np.maximum(eb, 0.2 * energy_b[-1]))
    return lags, product[lags % n] / np.maximum(norm, 1e-300), end - begin


def _peak(correlation: Floats, best: int) -> tuple[float, float]:
    """Height of the peak and the offset from ``best`` in steps, by a parabola through it and both neighbours."""
    if not 0 < best < len(correlation) - 1:
        return float(correlation[best]), 0.0
    before, at, after = correlation[best - 1 : best + 2]
    bend = before - 2.0 * at + after
    shift = 0.5 * (before - after) / bend if bend < 0.0 else 0.0
    return float(at - 0.25 * (before - after) * shift), float(shift)


def _width(correlation: Floats, best: int) -> float:
    """Width in s at half the peak's height."""
    below = correlation < 0.5 * correlation[best]
    left = best - int(np.argmax(below[best::-1])) if below[: best + 1].any() else 0
    right = best + int(np.argmax(below[best:])) if below[best:].any() else len(correlation) - 1
    return float((right - left) * STEP_S)


class _Drift(NamedTuple):
    """A line through the offsets of pieces; ``pieces`` of them lie on it. ``offset_s`` is at the board's ``middle_s``.

    Something happens in ``busy`` pieces; those at ``lost_s`` match nowhere near the line.
    """

    ppm: float
    middle_s: float
    offset_s: float
    scatter_s: float
    pieces: int
    busy: int
    lost_s: list[float]


def _drift(a: Floats, b: Floats, a_start: float, b_start: float, lag: int, offset_s: float) -> _Drift:
    size, reach = round(PIECE_S / STEP_S), round(PIECE_SEARCH_S / STEP_S)
    busy = 0.2 * float((a**2).mean())
    at: list[float] = []
    offsets: list[float] = []
    lost: list[float] = []
    for begin in range(max(0, -lag + reach), min(len(a), len(b) - lag - reach) - size + 1, size):
        piece = a[begin : begin + size]
        if float((piece**2).mean()) < busy:
            continue
        others = sliding_window_view(b[begin + lag - reach : begin + lag + reach + size], size)
        found = others @ piece / np.maximum(np.linalg.norm(others, axis=1) * np.linalg.norm(piece), 1e-300)
        best = int(np.argmax(found))
        height, shift = _peak(found, best)
        piece_s = a_start + (begin + size / 2) * STEP_S
        if not (0 < best < 2 * reach and height >= MIN_PEAK):
            lost.append(piece_s)
        else:
            at.append(piece_s)
            offsets.append(b_start - a_start + (lag + best - reach + shift) * STEP_S)
    middle = a_start + len(a) * STEP_S / 2
    if len(at) < MIN_PIECES:
        return _Drift(0.0, middle, offset_s, 0.0, len(at), len(at) + len(lost), lost)
    slope, value, keep = 0.0, float(np.median(offsets)), np.ones(len(at), dtype=np.bool_)
    times, found = np.array(at) - middle, np.array(offsets)
    for _ in range(3):  # a piece that locked onto another press must not bend the line
        slope, value = (float(v) for v in np.polyfit(times[keep], found[keep], 1))
        off = np.abs(found - value - slope * times)
        near = off <= max(3.0 * float(np.median(off)), 1e-3)
        if near.sum() < MIN_PIECES:
            break
        keep = near
    scatter = float(np.sqrt(((found - value - slope * times)[keep] ** 2).mean()))
    far = np.abs(found - value - slope * times) > MAX_SCATTER_S
    lost_s = [*lost, *(times[far] + middle).tolist()]
    return _Drift(1e6 * slope, middle, value, scatter, int(keep.sum()), len(at) + len(lost), lost_s)
