"""A finger's course: a script of loads and temperatures, and the counts that the sensor model makes of it.

The truth, the finger's reading at rest and under load, is the model's and not the board's.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
from paper_finger import PaperFinger

from biotac.core.finger import Finger
from biotac.kernels.geometry import Floats
from biotac.sim import physics, sampling
from biotac.sim.timeline import Pose, Track
from biotac.wire import messages_gen as wire
from biotac.wire import slots
from biotac.wire.frames import StructArray

PAD = Pose(x_mm=-2.8, y_mm=0.0, tip_mm=2.0)  # over E17
LEAD_S = 10.0  # of rest at the start, in which the tare is taken and the noise measured


@dataclass(frozen=True)
class Course:
    """n frames of one finger. ``words`` are the input of Finger.feed; the rest is the model's truth.

    ``force_n`` (n,): the largest normal force within the frame. ``rest`` (n, 19): counts without load at the frame's
    middle, with drift and temperature; ``reads`` (n, 19): counts with load and creep, without noise; ``signal``
    (n, 19): the load's own part on top of ``rest``; ``pressure`` (n,): PDC with load, undershoot and creep, no noise;
    ``warm_c`` (n,): degrees above the model's 30.
    """

    sensor: physics.SimFinger
    words: dict[str, np.ndarray]
    force_n: Floats
    rest: Floats
    reads: Floats
    signal: Floats
    pressure: Floats
    warm_c: Floats

    def __len__(self) -> int:
        return len(self.force_n)

    def run(
        self, settings: dict[wire.Setting, int] | None = None, *, pdc: bool = True, tdc: bool = True
    ) -> StructArray:
        """The board's rows for this course, with or without the pressure and the thermometer."""
        skipped = {name for name, is_present in (("pdc", pdc), ("tdc", tdc)) if not is_present}
        return Finger(settings).feed(**{name: words for name, words in self.words.items() if name not in skipped})

    def kept(self, rows: StructArray) -> Floats:
        """Share of the signal (n,) that the tare leaves: 1 if the tare is the true rest; NaN without a load."""
        missing = self.rest - rows["tare_q4"] / 16.0
        with np.errstate(divide="ignore", invalid="ignore"):
            share: Floats = 1.0 + (missing * self.signal).sum(axis=1) / (self.signal**2).sum(axis=1)
        return share

    def tare_error(self, rows: StructArray) -> Floats:
        """Largest distance (n,), in counts, of an electrode's tare from the true rest."""
        error: Floats = np.abs(self.rest - rows["tare_q4"] / 16.0).max(axis=1)
        return error


@dataclass
class Script:
    """A course in the making: ``track`` grows; ``sensor`` may be changed before make()."""

    sensor: physics.SimFinger
    track: Track = field(default_factory=Track)

    def rest(self, seconds: float) -> Script:
        """Nothing touches the finger."""
        self.track.ramp(seconds, self.track.pose.released())
        return self

    def hold(self, seconds: float) -> Script:
        """Load and temperature stay as they are."""
        self.track.ramp(seconds, self.track.pose)
        return self

    def load(self, force_n: float, n_per_s: float, at: Pose | None = None) -> Script:
        """Go to this normal force at this rate; ``at`` is the place, after a release."""
        place = at or self.track.pose
        seconds = max(abs(force_n - self.track.pose.force_n) / n_per_s, slots.FRAME_S)
        start = replace(place, force_n=self.track.pose.force_n, celsius=self.track.pose.celsius) if at else None
        end = place if force_n else place.released()  # a lifting finger drags no longer
        self.track.ramp(seconds, replace(end, force_n=force_n, celsius=self.track.pose.celsius), start)
        return self

    def warm(self, celsius: float, seconds: float) -> Script:
        """Warm by ``celsius`` within ``seconds``; all else stays."""
        self.track.ramp(seconds, replace(self.track.pose, celsius=self.track.pose.celsius + celsius))
        return self

    def make(self) -> Course:
        """The course: counts and truth."""
        frames = round(self.track.seconds / slots.FRAME_S)
        times: Floats = np.arange(frames + 1, dtype=np.float64) * slots.FRAME_S
        states = self.track.states(times)
        effects = sampling.effects_of(self.sensor, states)
        samples = sampling.Sampler(self.sensor, effects[:1]).read(effects[1:])
        drift = self.sensor.drift_per_min / 60.0 * times[:, None]
        still = self.sensor.rest_counts(states.warm_c)
        loaded = effects["exact"]
        rest = still + drift
        creep = self.sensor.creep_share * lag(loaded - still, sampling.CREEP_S)
        return Course(
            sensor=self.sensor,
            words={
                "counts": samples[:, slots.ELECTRODE_SLOT],
                "pdc": samples[:, slots.PDC_SLOT],
                "tac": samples[:, slots.TAC_SLOT],
                "tdc": samples[:, slots.TDC_SLOT],
                "pac": samples[:, slots.PAC_SLOT],
            },
            force_n=np.maximum(states.force_n[:-1], states.force_n[1:]),
            rest=_middle(rest),
            reads=_middle(loaded + creep + drift),
            signal=_middle(loaded - still),
            pressure=self.sensor.pdc_rest + _middle(pressure(effects["pressure"])),
            warm_c=_middle(states.warm_c),
        )


def script(seed: int, profile: physics.Profile = "new", lead_s: float = LEAD_S) -> Script:
    """A new sensor that has rested for ``lead_s``."""
    begun = Script(PaperFinger(seed, profile))
    begun.track.pose = PAD
    return begun.rest(lead_s)


def resting(sensor: physics.SimFinger, seconds: float, seed: int, start_s: float = 0.0) -> dict[str, np.ndarray]:
    """Words of an untouched finger, from ``start_s`` of the drift on; cheap enough for hours."""
    frames = round(seconds * slots.FRAME_HZ)
    rng = np.random.default_rng([seed, round(start_s)])
    time_min = (start_s + np.arange(frames) * slots.FRAME_S) / 60.0
    counts = rng.standard_normal((frames, 19), dtype=np.float32) * np.float32(sensor.noise_counts)
    counts += sensor.rest_counts(np.zeros(1)) + time_min[:, None] * sensor.drift_per_min
    hit = rng.random((frames, 19), dtype=np.float32) < sensor.glitch_share
    hit[1:] &= ~hit[:-1]  # never two in a row
    counts -= hit * rng.uniform(30.0, 66.0, (frames, 19))
    pdc = sensor.pdc_rest + rng.standard_normal(frames) * sampling.PDC_NOISE
    return {"counts": np.rint(counts).astype(np.uint16), "pdc": np.rint(pdc).astype(np.uint16)}


def lag(signal: Floats, seconds: float) -> Floats:
    """A lag of the first order of values (n, ...) at the boundaries of rounds, from 0 on."""
    keep, span = np.exp(-slots.FRAME_S / seconds), np.arange(64)  # SciPy's filter takes two seconds to import
    since = span[:, None] - span
    answer = np.where(since >= 0, (1.0 - keep) * keep ** np.maximum(since, 0), 0.0)
    lagged, last = np.empty_like(signal), np.zeros_like(signal[:1])
    for first in range(0, len(signal), len(span)):
        part = signal[first : first + len(span)]
        n = len(part)
        fades = (keep ** (span[:n] + 1)).reshape(n, *[1] * (signal.ndim - 1))
        lagged[first : first + n] = answer[:n, :n] @ part + fades * last
        last = lagged[first + n - 1 : first + n]
    return lagged


def pressure(load: Floats) -> Floats:
    """Static pressure above rest (n,), in counts: a spring's load, undershoot and creep."""
    low = sampling.PDC_UNDERSHOOT * np.tanh(lag(load, sampling.PDC_UNDERSHOOT_S) / sampling.PDC_UNDERSHOOT_AT)
    return load - low + sampling.PDC_CREEP_SHARE * lag(load, sampling.PDC_CREEP_S)


def _middle(boundary: Floats) -> Floats:
    middle: Floats = (boundary[:-1] + boundary[1:]) / 2.0
    return middle
