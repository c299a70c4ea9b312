"""Faults of a sensor or of the wires, laid over a healthy finger's words, and the board's frames under them.

A fault changes the words of one finger from a round on: at rest two seconds before a press, in the middle of the
squeeze, or while it is held. The error is the force's distance from the same finger's without the fault.
"""

from dataclasses import dataclass
from functools import cache

import numpy as np
from paper_finger import PaperFinger

from biotac import Finger, FrameFlags
from biotac.kernels.geometry import ELECTRODE_MM, Floats, normals_at, on_surface, tangents_at
from biotac.sim import physics, sampling
from biotac.sim.faults import FAULTS, Fault, Faulty, electrode_fault
from biotac.sim.timeline import Pose, Track
from biotac.wire import messages_gen as wire
from biotac.wire import slots
from biotac_lab.gains import fit_gains

Words = np.ndarray  # uint16 (n, 44), INVALID_COUNT where no good word came

PROOF_S, REST_S, SQUEEZE_N_PER_S, HOLD_S, FREE_S = 4.0, 10.0, 10.0, 6.0, 3.0
WHEN = ("rest", "touch", "hold")
MODELS = ("fitted", "lin", "population")
OFF_N, SILENT_ROUNDS = 0.5, 10
WARNINGS = (
    FrameFlags.UNTARED | FrameFlags.FAULT | FrameFlags.DOUBT | FrameFlags.RAIL | FrameFlags.TEMP | FrameFlags.OUTSIDE
    | FrameFlags.ELECTRODE_MISSING | FrameFlags.PDC_MISSING | FrameFlags.TAC_MISSING | FrameFlags.TDC_MISSING
    | FrameFlags.SENSOR_UNSURE | FrameFlags.SENSOR_OTHER | FrameFlags.ELECTRODE_OUT | FrameFlags.SENSOR_FAULT
    | FrameFlags.ELECTRODE_ALONE | FrameFlags.BASE_OLD | FrameFlags.LEAP_PENDING
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Press:
    """A finger that rests, is pressed, held and released: words (n, 44), and when each part begins, in rounds."""

    seed: int
    profile: str
    pose: Pose
    words: Words
    other: Words  # of another finger of the hand, pressed from the same moment on
    gains: dict[wire.Setting, int]
    squeeze: int
    hold: int
    free: int

    def begins(self, when: str) -> int:
        """Round at which a fault begins."""
        return {"rest": self.squeeze - 200, "touch": (self.squeeze + self.hold) // 2, "hold": self.hold + 100}[when]

    def settings(self, model: str) -> dict[wire.Setting, int]:
        """The board's settings with this force model."""
        if model == "population":
            return {}
        return {wire.Setting.FORCE_MODEL: int(wire.ForceModel.LIN), **(self.gains if model == "fitted" else {})}

    @cache  # noqa: B019 - a press lives as long as the tests
    def healthy(self, model: str) -> np.ndarray:
        """The board's rows without a fault."""
        return run(self.words, self.settings(model))


@cache
def press(
    seed: int, profile: str = "new", pose: Pose | None = None, force_n: float = 5.0, rest_s: float = REST_S
) -> Press:
    """A press of ``force_n`` at ``pose``'s place, or at a random one of the pad, ``rest_s`` after a lighter one."""
    rng = np.random.default_rng([seed, 4])
    pose = pose or Pose(x_mm=float(rng.uniform(-11, 2)), y_mm=float(rng.uniform(-2.5, 2.5)), tip_mm=2.0)
    sensor = PaperFinger(seed, profile)  # type: ignore[arg-type]
    track = _track(Pose(**{**pose.__dict__, "force_n": force_n}), rest_s)
    times: Floats = np.arange(round(track.seconds / slots.FRAME_S) + 1) * slots.FRAME_S
    states = track.states(times)
    squeeze = round((PROOF_S + rest_s) / slots.FRAME_S)
    hold = squeeze + round(force_n / SQUEEZE_N_PER_S / slots.FRAME_S)
    beside = PaperFinger(seed + 1000, profile)  # type: ignore[arg-type]
    elsewhere = _track(Pose(x_mm=-4.0, y_mm=1.0, tip_mm=2.0, force_n=3.0, shear_y_n=1.5), rest_s)
    return Press(
        seed, profile, pose, sampling.sample(sensor, states), sampling.sample(beside, elsewhere.states(times)),
        _calibrated(sensor),
        squeeze, hold, hold + round(HOLD_S / slots.FRAME_S),
    )  # fmt: skip


def _calibrated(sensor: physics.SimFinger) -> dict[wire.Setting, int]:
    """Gains fitted to the finger pressed and sheared all over the pad, as a calibration would find them."""
    n, rng = 400, np.random.default_rng(sensor.seed)
    contact = on_surface(np.column_stack([rng.uniform(-12, 3, n), rng.uniform(-3.5, 3.5, n)]))
    force_n, (to_tip, to_side) = rng.uniform(0.5, 8, n), tangents_at(normals_at(contact))
    shear = [(rng.uniform(-0.4, 0.4, n) * force_n)[:, None] * to for to in (to_tip, to_side)]
    states = physics.States(contact, force_n, sum(shear), np.zeros(n), np.full(n, 1.0), np.zeros(n))
    signal = sensor.counts(states) - sensor.rest_counts(states.warm_c)
    return {wire.Setting[name.upper()]: gain for name, gain in fit_gains(signal, *states.wrench()).items()}


def _track(pressed: Pose, rest_s: float) -> Track:
    track, free = Track(), pressed.released()
    track.pose = free
    squeeze_s = pressed.force_n / SQUEEZE_N_PER_S
    light = Pose(**{**free.__dict__, "force_n": 1.0})  # the time in which static pressure shows that it works
    for seconds, pose in (
        (PROOF_S / 2, free),
        (PROOF_S / 4, light),
        (PROOF_S / 4, free),
        (rest_s, free),
        (squeeze_s, pressed),
        (HOLD_S, pressed),
        (squeeze_s, free),
        (FREE_S, free),
    ):
        track.ramp(seconds, pose)
    return track


def run(words: Words, settings: dict[wire.Setting, int]) -> np.ndarray:
    """The board's rows (n,) for these words."""
    column = {"pdc": slots.PDC_SLOT, "tac": slots.TAC_SLOT, "tdc": slots.TDC_SLOT, "pac": slots.PAC_SLOT}
    finger = Finger(settings)
    return finger.feed(words[:, slots.ELECTRODE_SLOT], **{name: words[:, slot] for name, slot in column.items()})


# ---- faults ----------------------------------------------------------------------------------------------


def most_pressed(press: Press) -> int:
    """The electrode that the press moves most."""
    counts = press.words[:, slots.ELECTRODE_SLOT].astype(float)
    return int(np.abs(counts[press.hold : press.free].mean(axis=0) - counts[: press.squeeze].mean(axis=0)).argmax())


def spoil(press: Press, lay: Fault, begin: int, rng: np.random.Generator) -> Words:
    """The press's words with a fault laid on the most pressed electrode from a round on."""
    rest, other_rest = (w[: press.squeeze, slots.ELECTRODE_SLOT].mean(axis=0) for w in (press.words, press.other))
    bad = press.words.copy()
    bad[begin:] = lay(Faulty(most_pressed(press), rest, other_rest, rng), press.words[begin:], press.other[begin:])
    return bad


def _neighbours(electrode: int, n: int) -> np.ndarray:  # itself comes first
    return np.argsort(np.linalg.norm(np.asarray(ELECTRODE_MM) - ELECTRODE_MM[electrode], axis=1))[:n]


def stuck(n: int) -> Fault:
    """So many neighbours."""

    def stick(on: Faulty, counts: Floats, _: Floats) -> Floats:
        some = _neighbours(on.electrode, n)
        counts[:, some] = on.first(counts[0, some].copy())
        return counts

    return electrode_fault(stick)


def _copies(on: Faulty, counts: Floats, _: Floats) -> Floats:
    other = _neighbours(on.electrode, 4)[3]
    counts[:, on.electrode] = on.rest[on.electrode] + counts[:, other] - on.rest[other]
    return counts


def _two(on: Faulty, counts: Floats, t_s: Floats) -> Floats:
    counts[:, _neighbours(on.electrode, 2)[1]] -= 50 * t_s
    counts[:, on.electrode] = 4095
    return counts


def _silent(noise: float) -> Fault:
    """As a converter without its excitation."""
    return electrode_fault(lambda on, x, t: on.rest + on.rng.normal(0, noise, x.shape))


#: Faults of more than one electrode.
MORE: dict[str, Fault] = {
    **{f"{word} neighbours stuck": stuck(n) for n, word in ((3, "three"), (4, "four"), (5, "five"))},
    **{
        f"all drift {rate} counts/s": electrode_fault(lambda on, x, t, rate=rate: x - rate * t[:, None])
        for rate in (2, -5, 8, 12, -20, 30)
    },
    **{
        f"half drift up by {rate} counts/s, half down": electrode_fault(
            lambda on, x, t, rate=rate: x + rate * t[:, None] * (-1) ** np.arange(19)
        )
        for rate in (4, 12, 30)
    },
    "all aged by 0.7": electrode_fault(lambda on, x, t: on.rest + 0.7 * (x - on.rest)),
    "one copies another": electrode_fault(_copies),
    "all inverted": electrode_fault(lambda on, x, t: 2 * on.rest - x),
    "one open, its neighbour drifts": electrode_fault(_two),
    **{f"all silent, with noise of {noise}": _silent(noise) for noise in (1, 3, 8)},
}


@dataclass(frozen=True)
class Outcome:
    """Effect of a fault: the largest error in N, the largest over SILENT_ROUNDS without a new warning, and rounds.

    ``flag_after``: from the beginning to the first warning that the healthy finger lacks, -1: none. ``silent_rounds``:
    the longest stretch of an error of over OFF_N without one.
    """

    worst_n: float
    silent_n: float
    silent_rounds: int
    flag_after: int
    flags: FrameFlags
    last_n: float = 0.0  # in the last second of the hold


def longest(mask: np.ndarray) -> int:
    """How many rows in a row."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], mask.astype(int), [0]])))
    return int((edges[1::2] - edges[0::2]).max(initial=0))


def outcome(press: Press, name: str, when: str, model: str, seed: int = 0) -> Outcome:
    """Run a fault of FAULTS or MORE."""
    begin = press.begins(when)
    bad = spoil(press, (FAULTS | MORE)[name], begin, np.random.default_rng([press.seed, seed, 7]))
    good, rows = press.healthy(model)[begin:], run(bad, press.settings(model))[begin:]
    new = rows["flags"] & WARNINGS & ~good["flags"]
    given = (rows["force_100un"] != wire.INVALID_I32).all(axis=1) & (good["force_100un"] != wire.INVALID_I32).all(
        axis=1
    )
    error = np.where(
        given, np.linalg.norm((rows["force_100un"] - good["force_100un"].astype(float)) / 1e4, axis=1), 0.0
    )
    silent = np.where(new == 0, error, 0.0)
    lasting = np.lib.stride_tricks.sliding_window_view(silent, SILENT_ROUNDS + 1)
    flagged = np.flatnonzero(new)
    seen = np.bitwise_or.reduce(new)
    last = error[press.free - 100 - begin : press.free - begin]
    return Outcome(
        float(error.max()), float(lasting.min(axis=1).max()), longest(silent > OFF_N),
        int(flagged[0]) if len(flagged) else -1, FrameFlags(int(seen)), float(last.mean()),
    )  # fmt: skip
