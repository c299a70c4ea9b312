"""biotac-lab interval REC...

How often the 95 % intervals of normal and shear hold the true part, on frames that the force's source had not seen.

Three sources, of each of several fingers: its own map, with whole stretches of the recording held out; the population
map, trained on the other fingers; Lin's gains, fitted to the other fingers.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
from threadpoolctl import threadpool_limits

from biotac import Finger as BoardFinger
from biotac import ForceModel, InputError, Setting, compute
from biotac.calibrate.population import Population
from biotac.calibrate.wrench import Run, load, validate
from biotac.core import to_frames
from biotac.kernels.geometry import grip_parts
from biotac.map import Margin, bands, fit_margin, published_parts, unfelt_n

from ..report import Outcome, Show, Table, of_tables
from .training import FingerSums, Floats, aligned, of_others, sums_of

ABOUT = "How often the 95 % intervals of normal and shear are right, on frames that the force's source had not seen."
EXAMPLE = "biotac-lab interval F1.npz F2.npz"
HEAD = ["source", "part", "band [N]", "frames", "within", "median half width [N]", "over RMS error"]
PARTS = ("normal", "shear")
GAINS = (Setting.FORCE_GAIN_X_NN, Setting.FORCE_GAIN_Y_NN, Setting.FORCE_GAIN_Z_NN)
UNIT_NN = 1_000_000
LEAST_N = 0.5
ELECTRODES, MISSING, REST_ROUNDS = 19, 0xFFFF, 50
Settings = dict[Setting, int]


@dataclass(frozen=True)
class Judged:
    """Frames with their parts in N: ``felt_n``, ``half_n`` and ``truth_n`` (n, 2), and the true ``force_n`` (n, 3)."""

    felt_n: Floats
    half_n: Floats
    truth_n: Floats
    force_n: Floats

    def touched(self) -> Judged:
        """The frames of at least LEAST_N with a known contact."""
        rows = np.isfinite(self.felt_n).all(axis=1) & (np.linalg.norm(self.force_n, axis=1) >= LEAST_N)
        return Judged(*(value[rows] for value in (self.felt_n, self.half_n, self.truth_n, self.force_n)))

    @property
    def within(self) -> npt.NDArray[np.bool_]:
        """Whether each part (n, 2) is in the interval."""
        return np.abs(self.felt_n - self.truth_n) <= self.half_n

    def lines(self) -> Iterator[tuple[str, str, int, float, float, float]]:
        """Part, band, rows, share within, median half width in N, and that over the RMS error; first over all."""
        every = np.ones(len(self.force_n), np.bool_)
        for part, name in enumerate(PARTS):
            for band, rows in [("all", every), *bands(self.force_n)]:
                error = (self.felt_n - self.truth_n)[rows, part]
                half = float(np.median(self.half_n[rows, part]))
                share = float(self.within[rows, part].mean())
                yield name, band, int(rows.sum()), share, half, half / float(np.sqrt((error**2).mean()))


def together(parts: Sequence[Judged]) -> Judged:
    """The frames of several fingers."""
    each = [(part.felt_n, part.half_n, part.truth_n, part.force_n) for part in parts]
    return Judged(*(np.concatenate(columns) for columns in zip(*each, strict=True)))


@dataclass(frozen=True)
class Finger:
    """A recording as loaded, and with the truth at the counts' time; counts (n, 19) of the latter as words."""

    run: Run
    aligned: Run
    words: npt.NDArray[np.uint16]
    sums: FingerSums

    @classmethod
    def of_run(cls, run: Run) -> Finger:
        """From a recording as loaded. Raises RecordingError when force and counts do not belong together."""
        own = aligned(run)
        return cls(run, own, np.clip(np.rint(own.counts), 0, 4095).astype(np.uint16), sums_of(own))


def population_rows(finger: Finger, population: Population) -> tuple[Judged, Floats]:
    """A finger by a population map, with only the map's guess (n, 2) for a half width, which is given again."""
    run = finger.aligned
    poc_mm = compute(finger.words, run.tare)["poc_mm"]
    felt = published_parts(population.published(run.counts, run.tare), poc_mm)
    guess = population.judged(run.counts, run.tare).guess_n
    return Judged(felt, guess, grip_parts(run.truth, poc_mm), run.truth), guess


def population_margin(fingers: Sequence[Finger], maps: Sequence[Population]) -> tuple[Margin, list[Judged]]:
    """The population map's margin, fitted to each finger by the map of the others, and these frames with it."""
    each = [population_rows(finger, population) for finger, population in zip(fingers, maps, strict=True)]
    rows, guess = together([judged for judged, _ in each]), np.concatenate([judged for _, judged in each])
    margin = fit_margin(rows.felt_n, rows.truth_n, rows.force_n, guess)
    return margin, [replace(judged, half_n=guess + margin.half_n(judged.felt_n)) for judged, guess in each]


def with_unfelt(finger: Finger, judged: Judged) -> Judged:
    """By a population map's margin and guess, with the half widths as a board publishes them."""
    poc_mm = compute(finger.words, finger.aligned.tare)["poc_mm"]
    return replace(judged, half_n=judged.half_n + unfelt_n(judged.felt_n, poc_mm))


def lin_settings(others: Sequence[Finger]) -> Settings:
    """Lin's gains as fitted to other fingers, axis by axis."""
    unit = {Setting.FORCE_MODEL: ForceModel.LIN, **dict.fromkeys(GAINS, UNIT_NN)}
    felt = np.concatenate([compute(finger.words, finger.aligned.tare, unit)["force_n"] for finger in others])
    truth = np.concatenate([finger.aligned.truth for finger in others])
    gain = (felt * truth).sum(axis=0) / (felt**2).sum(axis=0)
    return {
        Setting.FORCE_MODEL: ForceModel.LIN,
        **{setting: round(UNIT_NN * value) for setting, value in zip(GAINS, gain, strict=True)},
    }


def lin_rows(finger: Finger, others: Sequence[Finger]) -> Judged:
    """A finger by gains fitted to the ``others``, as a board publishes it."""
    found = _on_board(finger.words, finger.aligned.tare, lin_settings(others), None)
    truth = finger.aligned.truth
    return Judged(_parts(found), _halves(found), grip_parts(truth, found["poc_mm"]), truth)


def own_rows(finger: Finger) -> tuple[Judged, Judged, bytes]:
    """A finger by its own map, each block of it by the map of the others; and that map's blob for a board.

    First with the margin that is fitted to all blocks, then with one that is fitted to every other block and evaluated
    on the others.
    """
    found = validate(finger.run)
    felt, truth = found.parts()
    force_n = finger.run.truth[:, :3]
    whole = Judged(felt, found.margin.half_n(felt), truth, force_n)
    half = np.full(felt.shape, np.nan)
    odd = np.zeros(len(felt), np.bool_)
    for block in range(1, len(found.folds), 2):
        odd[found.blocks.rows(block)] = True
    for fitted in (odd, ~odd):
        half[~fitted] = fit_margin(felt[fitted], truth[fitted], force_n[fitted]).half_n(felt[~fitted])
    return whole, replace(whole, half_n=half), found.wrench_map.on_board().blob


def share_without_electrode(finger: Finger, settings: Settings, own_map: bytes | None) -> list[float]:
    """Of frames with a healthy finger's known force, how many hold it with one electrode out: normal and shear.

    Of each electrode in turn, on a board where it is silent.
    """
    words, tare = finger.words, finger.aligned.tare
    healthy = _parts(_on_board(words, tare, settings, own_map))
    within = []
    for electrode in range(ELECTRODES):
        silent = words.copy()
        silent[:, electrode] = MISSING
        found = _on_board(silent, tare, settings, own_map)
        within.append(np.abs(_parts(found) - healthy) <= _halves(found))
    return [float(share) for share in np.concatenate(within).mean(axis=0)]


def _on_board(
    words: npt.NDArray[np.uint16], tare: Floats, settings: Settings, own_map: bytes | None
) -> npt.NDArray[np.void]:
    """Rows of FRAME_DTYPE from a board that has the tare, and a HOLD for the finger."""
    board = BoardFinger(settings, wrench_map=own_map)
    rest = np.tile(np.rint(tare).astype(np.uint16), (REST_ROUNDS, 1))
    board.feed(rest)
    board.set_tare(tare)
    board.feed(rest)  # with which the board compares it
    board.hold()
    return to_frames(board.feed(words))


def _parts(rows: npt.NDArray[np.void]) -> Floats:
    return np.column_stack([rows["normal_n"], rows["shear_n"]])


def _halves(rows: npt.NDArray[np.void]) -> Floats:
    return np.column_stack([rows["normal_half_n"], rows["shear_half_n"]])


# ---- the verb ---------------------------------------------------------------------------------------


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add the recordings."""
    parser.add_argument(
        "files", metavar="REC", nargs="+", type=Path, help="one finger per file, as for calibrate wrench; two or more"
    )


def run(args: argparse.Namespace, show: Show) -> Outcome:
    """Evaluate the three sources on each finger."""
    if len(args.files) < 2:
        raise InputError("one recording: expected at least two fingers, each to be left out of the others' map")
    with threadpool_limits(limits=1, user_api="blas"):
        tables = judge([Finger.of_run(load(path).run) for path in args.files], [path.name for path in args.files], show)
    return of_tables(tables, {"tables": [table.facts() for table in tables]})


def judge(fingers: list[Finger], names: list[str], show: Show) -> list[Table]:
    """The tables: the three sources by band, and with one electrode out."""
    margin, judged = population_margin(fingers, of_others([finger.sums for finger in fingers], symmetric=True))
    by_population = [with_unfelt(finger, each) for finger, each in zip(fingers, judged, strict=True)]
    rows, own, out = [], [], []
    for finger, name in zip(fingers, names, strict=True):
        show(f"{name}: its own map")
        others = [other for other in fingers if other is not finger]
        whole, crossed, blob = own_rows(finger)
        own.append(whole)
        rows += _rows(f"own map, {name}", whole) + _rows(f"the same, margin of every other block, {name}", crossed)
        show(f"{name}: electrodes out")
        by: tuple[tuple[str, Settings, bytes | None], ...]
        by = (("own map", {}, blob), ("population", {}, None), ("Lin", lin_settings(others), None))
        out += [[source, name, *share_without_electrode(finger, *given)] for source, *given in by]
    lin = [lin_rows(finger, [other for other in fingers if other is not finger]) for finger in fingers]
    for source, each in (("own map", own), ("population", by_population), ("Lin", lin)):
        rows += _rows(source, together(each))
    text = f"The population map's margin: base {list(margin.base_mn)} mN, share {list(margin.share_q8)} / 256."
    title = "With one electrode out: the healthy finger's force is within"
    return [
        Table("Left-out frames within the interval", HEAD, rows, text),
        Table(title, ["source", "finger", "normal", "shear"], out),
    ]


def _rows(source: str, judged: Judged) -> list[list[object]]:
    return [[source, *line] for line in judged.touched().lines()]
