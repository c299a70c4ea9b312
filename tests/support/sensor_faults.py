"""What breaks in a sensor or on its wires, laid over a healthy finger's words, and what the board then makes of it.

A fault changes the words of one finger from a round on: at rest two seconds before a press, in the middle of the
squeeze, or while it is held. Its error is the force's distance from the same finger's without the fault.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache

import numpy as np
from courses import Sensor

from biotac import Finger, FrameFlags
from biotac.core.geometry import Floats, normals_at, on_surface, tangents_at
from biotac.sim import physics, sampling
from biotac.sim.gains import fit_gains
from biotac.sim.timeline import Pose, Track
from biotac.wire import messages_gen as wire
from biotac.wire import slots

Words = np.ndarray  # uint16 (n, 44), INVALID_COUNT where no good word came
Fault = Callable[["Press", Words, int, np.random.Generator], Words]

PROOF_S, REST_S, SQUEEZE_N_PER_S, HOLD_S, FREE_S = 4.0, 10.0, 10.0, 6.0, 3.0
WHEN = ("rest", "touch", "hold")
MODELS = ("fitted", "lin", "population")
OFF_N, SILENT_ROUNDS = 0.5, 10
WARNINGS = (
    FrameFlags.UNTARED | FrameFlags.FAULT | FrameFlags.DOUBT | FrameFlags.RAIL | FrameFlags.TEMP | FrameFlags.OUTSIDE
    | FrameFlags.ELECTRODE_MISSING | FrameFlags.PDC_MISSING | FrameFlags.TAC_MISSING | FrameFlags.TDC_MISSING
    | FrameFlags.SENSOR_UNSURE | FrameFlags.SENSOR_OTHER | FrameFlags.ELECTRODE_OUT | FrameFlags.SENSOR_FAULT
    | FrameFlags.ELECTRODE_ALONE
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Press:
    """A finger that rests, is pressed, held and released: its words (n, 44), and when each part begins, in rounds."""

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
        """The round in which a fault begins."""
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


def press(seed: int, profile: str = "new", pose: Pose | None = None, force_n: float = 5.0) -> Press:
    """A press of ``force_n`` at ``pose``'s place, or at a random one of the pad."""
    rng = np.random.default_rng([seed, 4])
    pose = pose or Pose(x_mm=float(rng.uniform(-11, 2)), y_mm=float(rng.uniform(-2.5, 2.5)), tip_mm=2.0)
    sensor = Sensor(seed, profile)  # type: ignore[arg-type]
    track = _track(Pose(**{**pose.__dict__, "force_n": force_n}))
    times: Floats = np.arange(round(track.seconds / slots.FRAME_S) + 1) * slots.FRAME_S
    states = track.states(times)
    squeeze = round((PROOF_S + REST_S) / slots.FRAME_S)
    hold = squeeze + round(force_n / SQUEEZE_N_PER_S / slots.FRAME_S)
    beside = Sensor(seed + 1000, profile)  # type: ignore[arg-type]
    elsewhere = _track(Pose(x_mm=-4.0, y_mm=1.0, tip_mm=2.0, force_n=3.0, shear_y_n=1.5))
    return Press(
        seed, profile, pose, sampling.sample(sensor, states), sampling.sample(beside, elsewhere.states(times)),
        _calibrated(sensor),
        squeeze, hold, hold + round(HOLD_S / slots.FRAME_S),
    )  # fmt: skip


def _calibrated(sensor: physics.Finger) -> dict[wire.Setting, int]:
    """Gains fitted to the finger pressed and sheared all over its pad, as a calibration would find them."""
    n, rng = 400, np.random.default_rng(sensor.seed)
    contact = on_surface(np.column_stack([rng.uniform(-12, 3, n), rng.uniform(-3.5, 3.5, n)]))
    force_n, (to_tip, to_side) = rng.uniform(0.5, 8, n), tangents_at(normals_at(contact))
    shear = [(rng.uniform(-0.4, 0.4, n) * force_n)[:, None] * to for to in (to_tip, to_side)]
    states = physics.States(contact, force_n, sum(shear), np.zeros(n), np.full(n, 1.0), np.zeros(n))
    signal = sensor.counts(states) - sensor.rest_counts(states.warm_c)
    return {wire.Setting[name.upper()]: gain for name, gain in fit_gains(signal, *states.wrench()).items()}


def _track(pressed: Pose) -> Track:
    track, free = Track(), pressed.released()
    track.pose = free
    squeeze_s = pressed.force_n / SQUEEZE_N_PER_S
    light = Pose(**{**free.__dict__, "force_n": 1.0})  # by which static pressure shows that it works
    for seconds, pose in (
        (PROOF_S / 2, free),
        (PROOF_S / 4, light),
        (PROOF_S / 4, free),
        (REST_S, free),
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


def _electrodes(change: Callable[[Press, Floats, np.random.Generator], Floats]) -> Fault:
    """A fault of the electrodes' words (n, 19) from the round on, given and returned as float64."""

    def fault(of: Press, words: Words, begin: int, rng: np.random.Generator) -> Words:
        bad = words.copy()
        counts = change(of, words[begin:, slots.ELECTRODE_SLOT].astype(float), rng)
        bad[begin:, slots.ELECTRODE_SLOT] = np.clip(np.rint(counts), 0, 4095)
        return bad

    return fault


def _one(change: Callable[[Floats, Floats, np.random.Generator], Floats]) -> Fault:
    """The same of the electrode that the press moves most: its words (n,), and the time in s."""

    def electrodes(of: Press, counts: Floats, rng: np.random.Generator) -> Floats:
        worst = most_pressed(of)
        counts[:, worst] = change(counts[:, worst].copy(), np.arange(len(counts)) * slots.FRAME_S, rng)
        return counts

    return _electrodes(electrodes)


def most_pressed(of: Press) -> int:
    """The electrode that the press moves most."""
    counts = of.words[:, slots.ELECTRODE_SLOT].astype(float)
    return int(np.abs(counts[of.hold : of.free].mean(axis=0) - counts[: of.squeeze].mean(axis=0)).argmax())


def _half_gain(of: Press, counts: Floats, _: np.random.Generator) -> Floats:
    worst = most_pressed(of)
    rest = of.words[: of.squeeze, slots.ELECTRODE_SLOT[worst]].mean()
    counts[:, worst] = rest + (counts[:, worst] - rest) / 2
    return counts


def _exchange(of: Press, counts: Floats, _: np.random.Generator) -> Floats:
    a = most_pressed(of)
    b = (a + 7) % counts.shape[1]
    counts[:, [a, b]] = counts[:, [b, a]]
    return counts


def _freeze(slots_frozen: Iterable[int]) -> Fault:
    def fault(of: Press, words: Words, begin: int, rng: np.random.Generator) -> Words:
        bad = words.copy()
        columns = np.array(list(slots_frozen))
        bad[begin:, columns] = bad[begin, columns]
        return bad

    return fault


def _channel(slot: int, value: Callable[[Floats], Floats | float]) -> Fault:
    def fault(of: Press, words: Words, begin: int, rng: np.random.Generator) -> Words:
        bad = words.copy()
        bad[begin:, slot] = np.clip(value(bad[begin:, slot].astype(float)), 0, 4095)
        return bad

    return fault


def _shifted(of: Press, words: Words, begin: int, rng: np.random.Generator) -> Words:
    bad = words.copy()
    bad[begin:] = np.roll(words.reshape(-1), 1).reshape(words.shape)[begin:]
    return bad


def _exchanged_fingers(of: Press, words: Words, begin: int, rng: np.random.Generator) -> Words:
    bad = words.copy()
    bad[begin:] = of.other[begin:]
    return bad


def _cross_talk(share: float) -> Fault:
    def fault(of: Press, words: Words, begin: int, rng: np.random.Generator) -> Words:
        bad = words.copy()
        e = slots.ELECTRODE_SLOT
        signal = of.other[:, e] - of.other[: of.squeeze, e].mean(axis=0)
        bad[begin:, e] = np.clip(np.rint(words[begin:, e] + share * signal[begin:]), 0, 4095)
        return bad

    return fault


_PARITY = np.array([bin(byte).count("1") & 1 for byte in range(256)], bool)


def noisy_line(a_bit: float) -> Fault:
    """Every bit flips with this chance; what parity does not show is believed."""

    def fault(of: Press, words: Words, begin: int, rng: np.random.Generator) -> Words:
        bad = words.copy()
        counts = words[begin:].astype(np.uint16)
        sent = np.stack([counts >> 5 << 1, (counts & 31) << 3], axis=-1).astype(np.uint8)
        sent |= ~_PARITY[sent]  # the last bit makes each byte's parity odd
        flips = np.packbits(rng.random((*sent.shape, 8)) < a_bit, axis=-1)[..., 0]
        sent ^= flips
        good = _PARITY[sent].all(axis=-1)
        read = (sent[..., 0].astype(np.uint16) >> 1 << 5) + (sent[..., 1] >> 3)
        bad[begin:] = np.where(good, read, wire.INVALID_COUNT)
        return bad

    return fault


FAULTS: dict[str, Fault] = {
    "electrode open": _one(lambda x, t, rng: np.full_like(x, 4095)),
    "electrode shorted": _one(lambda x, t, rng: np.zeros_like(x)),
    "electrode floating: walks 20 counts a round": _one(lambda x, t, rng: x[0] + np.cumsum(rng.normal(0, 20, len(x)))),
    "electrode floating: uniform noise": _one(lambda x, t, rng: rng.uniform(1, 4089, len(x))),
    "electrode with noise of 200 counts": _one(lambda x, t, rng: x + rng.normal(0, 200, len(x))),
    "electrode stuck": _one(lambda x, t, rng: np.full_like(x, x[0])),
    "electrode at half gain": _electrodes(_half_gain),
    "electrode drifts 10 counts/s": _one(lambda x, t, rng: x - 10 * t),
    "electrode drifts 50 counts/s": _one(lambda x, t, rng: x - 50 * t),
    "electrode drifts 200 counts/s": _one(lambda x, t, rng: x - 200 * t),
    "all electrodes drift 1 count/s": _electrodes(lambda of, x, rng: x - 1 * np.arange(len(x))[:, None] / 100),
    "all electrodes drift 5 counts/s": _electrodes(lambda of, x, rng: x - 5 * np.arange(len(x))[:, None] / 100),
    "all electrodes drift 20 counts/s": _electrodes(lambda of, x, rng: x - 20 * np.arange(len(x))[:, None] / 100),
    "all electrodes jump by 50": _electrodes(lambda of, x, rng: x - 50),
    "noise of 30 counts on all electrodes": _electrodes(lambda of, x, rng: x + rng.normal(0, 30, x.shape)),
    "two electrodes' wires exchanged": _electrodes(_exchange),
    "the same words for ever": _freeze(range(slots.SLOTS_PER_FRAME)),
    "electrodes frozen, pressure alive": _freeze(slots.ELECTRODE_SLOT),
    "channels shifted by a slot": _shifted,
    "two fingers exchanged": _exchanged_fingers,
    "cross-talk of 30 % between fingers": _cross_talk(0.3),
    "cross-talk of 100 % between fingers": _cross_talk(1.0),
    "noisy line, 1e-3 a bit": noisy_line(1e-3),
    "noisy line, 3e-3 a bit": noisy_line(3e-3),
    "TDC jumps by 300 counts": _channel(slots.TDC_SLOT, lambda x: x + 300),
    "PDC stuck": _channel(slots.PDC_SLOT, lambda x: x[0]),
    "PDC 0": _channel(slots.PDC_SLOT, lambda x: 0.0),
    "PDC 4095": _channel(slots.PDC_SLOT, lambda x: 4095.0),
}


@dataclass(frozen=True)
class Outcome:
    """What a fault does: the largest error in N, what of it lasts over SILENT_ROUNDS without a new warning, and rounds.

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


def outcome(of: Press, name: str, when: str, model: str, seed: int = 0) -> Outcome:
    """Run a fault of FAULTS."""
    begin = of.begins(when)
    bad = FAULTS[name](of, of.words, begin, np.random.default_rng([of.seed, seed, 7]))
    good, rows = of.healthy(model)[begin:], run(bad, of.settings(model))[begin:]
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
    last = error[of.free - 100 - begin : of.free - begin]
    return Outcome(
        float(error.max()), float(lasting.min(axis=1).max()), longest(silent > OFF_N),
        int(flagged[0]) if len(flagged) else -1, FrameFlags(int(seen)), float(last.mean()),
    )  # fmt: skip
