"""A guided calibration on a board: warm up, tare, load everywhere, done.

The procedure is fed with a board's frames and a reference's samples, each by its own clock; it has no clock itself and
asks nobody. ``show`` gets a line for everything that a person must do or may want to know. walk() reads both streams
and records them. The files are complete up to the last second, so that they can be fitted later however it ends.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ...errors import CommandRefusedError, InputError
from ...hand.hand import Hand
from ...kernels.geometry import Floats
from ...wire import messages_gen as wire
from ..reference.csv_file import CsvWriter
from ..reference.mounting import Mounting
from ..reference.samples import Samples, SensorReader
from .coverage import Coverage

Frames = npt.NDArray[np.void]

MEAN_FRAMES = 50  # drift is slow: means over half a second show it without the noise
TARE_FRAMES = 200
TARE_SAMPLES_S = 1.0
MAX_ZERO_SPREAD_N = 0.15  # 10 to 90 % of the reference while it is zeroed
MAX_WARM_UP_S = 3600.0
DRIFT_OVER_S = 60.0


Show = Callable[[str], None]


class Step(Enum):
    """Step of the procedure; the value is the text for the person."""

    WARM_UP = "warming up: leave the finger alone"
    TARE = "taring: leave the finger alone"
    LOADS = "press, shear and twist all over the finger, and let go in between"
    DONE = "done"


@dataclass
class WrenchProcedure:
    """Guides one finger's calibration. Feed ``frames`` and ``samples`` as they come, and look at ``step``.

    When ``wants_tare`` is true, the caller tells the board to tare, and calls ``tared`` with whether it accepted. Drift
    is that of the mean over the electrodes, over the last DRIFT_OVER_S.
    """

    finger: int
    mounting: Mounting
    show: Show = lambda event: None
    max_drift_counts_per_min: float = 20.0
    coverage: Coverage = field(default_factory=Coverage)
    step: Step = Step.WARM_UP
    zero: Floats | None = None
    drift_counts_per_min: float = float("nan")
    last_step: Step = Step.WARM_UP  # the step before the current one

    def __post_init__(self) -> None:
        self._means: deque[tuple[float, float]] = deque()  # time in s, mean over the electrodes
        self._half: list[tuple[float, float]] = []
        self._begin_s: float | None = None
        self._untouched = 0
        self._asked = False
        self._tared_frames = 0
        self._recent: deque[Samples] = deque()
        self._last_status = ""

    # ---- input ---------------------------------------------------------------------------------

    def frames(self, frames: Frames) -> None:
        """Take FRAME_DTYPE rows of any fingers, in order."""
        if self.step in (Step.WARM_UP, Step.TARE):  # then the reference alone decides
            for row in frames[frames["finger"] == self.finger]:
                self._frame(row)

    def samples(self, samples: Samples) -> None:
        """Take the reference's samples since the last call. Raises InputError for a reference of three axes."""
        if not len(samples):
            return
        if samples.wrench.shape[1] < 6:
            raise InputError(
                "the reference has no torque: expected six axes, to locate contacts; use a six-axis sensor"
            )
        if self.step in (Step.WARM_UP, Step.TARE):
            self._recent.append(samples)
            while len(self._recent) > 1 and samples.t_s[-1] - self._recent[1].t_s[0] > TARE_SAMPLES_S:
                self._recent.popleft()
        elif self.step is Step.LOADS and self.zero is not None:
            step_s = float(np.median(np.diff(samples.t_s))) if len(samples) > 1 else 0.0
            self.coverage.add(self.mounting.to_finger(samples.wrench - self.zero), step_s)
            text = self.status()
            if self.coverage.complete:
                self._enter(Step.DONE, f"covered: {self.coverage.summary()}")
            elif text != self._last_status:
                self._last_status = text
                self.show(text)

    def tared(self, *, accepted: bool) -> None:
        """Take the board's answer; if it refused, it is asked again after TARE_FRAMES untouched frames."""
        self._asked = accepted
        self._tared_frames = 0
        if not accepted:
            self._untouched = 0
            self.show("the board refused to tare, as its signals are moving: leave the finger alone")

    def finish(self, why: str) -> None:
        """End the procedure, complete or not: at the user's request, or because no more data comes."""
        if self.step is not Step.DONE:
            self._enter(Step.DONE, why)

    def status(self) -> str:
        """One line of progress, for a display that is refreshed."""
        if self.step is Step.WARM_UP:
            return f"{Step.WARM_UP.value}: {self.drift_counts_per_min:+.0f} counts/min"
        if self.step is Step.LOADS:
            return f"{self.coverage.summary()}; missing: {next(iter(self.coverage.missing()), 'nothing')}"
        return str(self.step.value)

    @property
    def wants_tare(self) -> bool:
        return self.step is Step.TARE and not self._asked and self._untouched >= TARE_FRAMES

    # ---- warm-up and tare ----------------------------------------------------------------------

    def _frame(self, row: np.void) -> None:
        flags = int(row["flags"])
        at_s = int(row["t_us"]) / 1e6
        missing = bool((row["counts"] == wire.INVALID_COUNT).any()) or bool(flags & wire.FrameFlags.FAULT)
        touched = bool(flags & wire.FrameFlags.CONTACT)
        self._untouched = 0 if touched or missing else self._untouched + 1
        if self.step is Step.WARM_UP:
            self._warm_up(at_s, row, touched or missing)
        elif self.step is Step.TARE and self._asked:
            self._tared_frames = 0 if touched or missing else self._tared_frames + 1
            if self._tared_frames >= TARE_FRAMES and not flags & wire.FrameFlags.UNTARED:
                self._zero_reference()

    def _warm_up(self, at_s: float, row: np.void, disturbed: bool) -> None:
        if self._begin_s is None:
            self._begin_s = at_s
            self.show(Step.WARM_UP.value)
        if at_s - self._begin_s > MAX_WARM_UP_S:
            raise InputError(
                f"after {MAX_WARM_UP_S / 60:.0f} minutes the finger still drifts by {self.drift_counts_per_min:+.0f} "
                f"counts/min: expected at most {self.max_drift_counts_per_min:g}; is it untouched, and powered on?"
            )
        if disturbed and self._untouched == 0:
            # the board reports a touch for a finger that drifts fast enough, too: either way, wait on
            self._half.clear()
            return
        self._half.append((at_s, float(row["counts"].mean())))
        if len(self._half) < MEAN_FRAMES:
            return
        mean_s, mean_counts = (float(np.mean(values)) for values in zip(*self._half, strict=True))
        self._means.append((mean_s, mean_counts))
        self._half.clear()
        while mean_s - self._means[0][0] > DRIFT_OVER_S:
            self._means.popleft()
        times, counts = np.array(self._means).T
        if len(times) > 3:
            self.drift_counts_per_min = 60.0 * float(np.polyfit(times - times[0], counts, 1)[0])
        long_enough = mean_s - self._begin_s >= DRIFT_OVER_S
        enough = len(times) >= 0.8 * DRIFT_OVER_S * 100.0 / MEAN_FRAMES
        if long_enough and enough and abs(self.drift_counts_per_min) <= self.max_drift_counts_per_min:
            self._enter(Step.TARE, f"warm: {self.drift_counts_per_min:+.1f} counts/min over the last minute")

    def _zero_reference(self) -> None:
        wrench = np.concatenate([np.empty((0, 6)), *(samples.wrench for samples in self._recent)])
        wrench = wrench[np.isfinite(wrench).all(axis=1)]
        if not len(wrench):
            return
        spread_n = float(np.ptp(np.percentile(wrench[:, :3], (10, 90), axis=0), axis=0).max())
        if spread_n > MAX_ZERO_SPREAD_N:
            self._tared_frames = 0
            self.show(f"the reference moves by {spread_n:.2f} N: let go of everything")
            return
        self.zero = np.median(wrench, axis=0)
        self._recent.clear()
        self._enter(Step.LOADS, Step.LOADS.value)

    def _enter(self, step: Step, event: str) -> None:
        self.last_step, self.step = self.step, step
        self.show(event)


def walk(
    hand: Hand,
    reader: SensorReader,
    procedure: WrenchProcedure,
    path: Path,
    *,
    overwrite: bool = False,
    progress: Show | None = None,
) -> bool:
    """Run the procedure until it is done or the board's source ends (returns True), or a KeyboardInterrupt ends it.

    The board is recorded to ``path``, the reference to a .csv beside it. The board does not stream afterwards. Raises
    InputError when a file exists or cannot be written, when the finger keeps drifting or the reference has no torque,
    and DeviceLostError when the board or the reference is lost; the files then hold everything until that moment.
    """
    reference = CsvWriter(path.with_suffix(".csv"), procedure.mounting, reader.sensor, overwrite=overwrite)
    interrupted = False
    with closing(reference) as writer, closing(hand.record(path, overwrite=overwrite)):
        try:
            first_us: int | None = None
            for batch in hand.batches():
                last_us = batch.last_t_us()
                if last_us is not None:
                    first_us = last_us if first_us is None else first_us
                    samples = reader.read((last_us - first_us) / 1e6)
                    # written before the procedure sees it, which may raise
                    writer.add(samples)
                    procedure.frames(batch.frames)
                    procedure.samples(samples)
                if procedure.wants_tare:
                    try:
                        hand.tare(procedure.finger)
                        procedure.tared(accepted=True)
                    except CommandRefusedError:
                        procedure.tared(accepted=False)
                if progress is not None:
                    progress(procedure.status())
                if procedure.step is Step.DONE:
                    break
            procedure.finish("the simulated source has ended")
        except KeyboardInterrupt:
            interrupted = True
            procedure.finish("stopped by Ctrl-C")
    # needed even if the board's source has ended: it sends nothing more, but still refuses as busy
    hand.stop()
    return not interrupted
