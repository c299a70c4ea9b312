"""Random tare courses, and the invariants that must hold in every frame of each.

A course is a list of steps that the seed decides.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from courses import LEAD_S, Course, Script, resting
from paper_finger import PaperFinger

from biotac import FrameFlags, Setting, TareReason, TareState
from biotac.core.finger import Finger
from biotac.recording.crosscheck import CrossCheck
from biotac.sim import sampling
from biotac.sim.timeline import Pose
from biotac.wire import messages_gen as wire
from biotac.wire.frames import StructArray

# With pressure, after a release: at rest within a second, or in doubt while the press's residue still shows; and at
# rest after at most ten seconds in a row in which the residue is no touch. It may become one again: pressure is low
# for a second after a press, and the residue that then comes back stays above the tare for minutes.
RELEASED_WITHIN = 100
TARED_WITHIN = 1000
PDC_HIT, PDC_NOISE = 6, 3 * sampling.PDC_NOISE  # counts above rest that are a touch; most noise of three rounds
HELD_N = 1.0  # a load above this is never tared away
LATE = 10  # frames after a touch that may still be due to it: three hits, a glitch, one lost word
RELEASES = (TareReason.RELEASE, TareReason.RESIDUE)

Step = tuple[str, dict[str, float]]


@dataclass(frozen=True)
class Recipe:
    """All that makes a course; a test that fails shows it."""

    seed: int
    profile: str
    pdc: bool
    lost_share: float
    drift_scale: float
    settings: dict[str, int]
    steps: tuple[Step, ...]


@dataclass
class Outcome:
    """The result of a course. ``broken``: invariants that did not hold, in words; empty if it is good."""

    broken: list[str] = field(default_factory=list)
    frames: int = 0
    poc_um: float = 0.0
    force_mn: float = 0.0
    torque_share: float = 0.0
    release_frames: int = 0  # with pressure, the longest from a release to rest or doubt
    tared_frames: int = 0  # the longest that a residue was no touch before it was tared
    releases: int = 0
    held_frames: int = 0  # with a load over HELD_N
    tared_away: int = 0  # tared although loaded with more than HELD_N
    idle_touches: int = 0  # contacts that begin without a load, explained by creep or temperature
    locked: int = 0  # without pressure: still in contact at the end of a course


def draw(seed: int) -> Recipe:
    """A random course of 90 to 150 s."""
    rng = np.random.default_rng([seed, 99])

    def log_uniform(low: float, high: float) -> float:
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    steps: list[Step] = []
    for _ in range(int(rng.integers(2, 5))):
        force = log_uniform(0.3, 20.0)
        steps.append(("load", {"force_n": force, "n_per_s": max(log_uniform(0.02, 20.0), force / 40.0), **_place(rng)}))
        for _ in range(int(rng.integers(1, 4))):
            steps.append(_during(rng, force))
        steps.append(("release", {"n_per_s": log_uniform(0.5, 20.0)}))
        steps.append(("rest", {"seconds": float(rng.uniform(4.0, 10.0))}))
        if rng.random() < 0.3:
            steps.append(("warm", {"celsius": float(rng.uniform(-0.05, 0.05)), "seconds": 5.0}))
    steps.append(("rest", {"seconds": 25.0}))  # any doubt has had ten seconds
    return Recipe(
        seed=seed,
        profile=str(rng.choice(["new", "worn"])),
        pdc=bool(rng.random() < 0.75),
        lost_share=float(rng.choice([0.0, 0.0, 0.002, 0.01])),
        drift_scale=float(rng.choice([0.0, 1.0, 1.0])),
        settings={
            "poc_weights": int(rng.integers(0, 3)),
            "thermal_gain_milli": int(rng.choice([0, 500, 1000])),
            "force_gain_z_nn": int(rng.choice([2_262_234, -2_262_234, 100_000_000])),
        },
        steps=tuple(steps),
    )


def _place(rng: np.random.Generator) -> dict[str, float]:
    x_mm = float(rng.uniform(-12.0, 4.0))
    side = 0.9 * np.sqrt(5.08**2 - max(x_mm, 0.0) ** 2)
    return {"x_mm": x_mm, "y_mm": float(rng.uniform(-side, side)), "tip_mm": float(rng.choice([1.2, 2.0, 3.6, 7.0]))}


def _during(rng: np.random.Generator, force_n: float) -> Step:
    seconds = float(rng.uniform(0.3, 6.0))
    kind = int(rng.integers(0, 5))
    if kind == 0:
        return "slide", {"seconds": seconds, **_place(rng)}
    if kind == 1:
        shear = rng.uniform(-0.4, 0.4, 2) * force_n
        return "shear", {"seconds": seconds, "shear_x_n": float(shear[0]), "shear_y_n": float(shear[1])}
    if kind == 2:
        return "force", {"seconds": seconds, "force_n": max(float(rng.uniform(0.2, 1.0)) * force_n, 0.3)}
    if kind == 3:
        return "warm", {"celsius": float(rng.uniform(-4.0, 4.0)), "seconds": seconds}
    return "hold", {"seconds": seconds}


def make(recipe: Recipe) -> Course:
    """The recipe's course without the words that the recipe loses."""
    script = Script(PaperFinger(recipe.seed, "worn" if recipe.profile == "worn" else "new"))
    script.sensor.drift_per_min = script.sensor.drift_per_min * recipe.drift_scale
    script.rest(LEAD_S)
    for kind, how in recipe.steps:
        if kind == "load":
            place = {name: how[name] for name in ("x_mm", "y_mm", "tip_mm")}
            script.load(how["force_n"], how["n_per_s"], Pose(**place))
        elif kind == "release":
            script.load(0.0, how["n_per_s"])
        elif kind == "rest":
            script.rest(how["seconds"])
        elif kind == "warm":
            script.warm(how["celsius"], how["seconds"])
        else:
            pose = replace(script.track.pose, **{name: value for name, value in how.items() if name != "seconds"})
            script.track.ramp(how["seconds"], pose)
    course = script.make()
    rng = np.random.default_rng([recipe.seed, 98])
    for words in course.words.values():
        words[rng.random(words.shape) < recipe.lost_share] = wire.INVALID_COUNT
    return course


def run(recipe: Recipe) -> tuple[Course, dict[Setting, int], StructArray]:
    """The course, the board's settings, and the rows that its code makes of it."""
    course = make(recipe)
    settings = {setting: spec.default for setting, spec in wire.SETTINGS.items()}
    settings |= {Setting[name.upper()]: value for name, value in recipe.settings.items()}
    return course, settings, course.run(settings, pdc=recipe.pdc)


def judge(recipe: Recipe) -> Outcome:
    """Run the course through the board's code and check every frame."""
    return verdict(recipe, *run(recipe))


def verdict(recipe: Recipe, course: Course, settings: dict[Setting, int], rows: StructArray) -> Outcome:
    """Check every frame of a course that was run."""
    outcome = Outcome(frames=len(rows))
    _judge_results(rows, settings, outcome)
    _judge_ranges(rows, settings, outcome)
    _judge_touches(course, rows, outcome)
    if recipe.pdc:
        _judge_loads(course, rows, outcome)
    else:
        outcome.locked = int(course.force_n[-200:].max() == 0 and rows["tare_state"][-1] == TareState.CONTACT)
    return outcome


def _judge_results(rows: StructArray, settings: dict[Setting, int], outcome: Outcome) -> None:
    check = CrossCheck()
    check.add(rows, settings)
    outcome.broken += check.findings[:3]
    outcome.poc_um = check.poc_um_max
    outcome.force_mn = check.force_mn_max
    outcome.torque_share = check.torque_nmm_max / check.torque_nmm_bound if check.torque_nmm_bound else 0.0


def _judge_ranges(rows: StructArray, settings: dict[Setting, int], outcome: Outcome) -> None:
    tares = rows["tare_q4"][(rows["flags"] & FrameFlags.UNTARED) == 0]
    known = tares[tares != wire.INVALID_COUNT]
    limit = settings[Setting.CONTACT_ENERGY_COUNT2]
    for held, problem in (
        (bool((known <= 65520).all()), "a tare is out of range"),
        # 19 electrodes of 4095 counts; and three times the noise, which is capped at the setting
        (bool((rows["energy_count2"] <= 19 * 4095**2).all()), "an energy wrapped"),
        (bool((rows["threshold_count2"] <= 3 * limit).all()), "the threshold is over three times the setting"),
        (bool((np.diff(rows["seq"].astype(np.int64)) == rows["present"][1:]).all()), "the sequence has a gap"),
        (bool(np.isin(rows["tare_state"], list(TareState)).all()), "a tare state is unknown"),
    ):
        if not held:
            outcome.broken.append(problem)


def _judge_touches(course: Course, rows: StructArray, outcome: Outcome) -> None:
    """A contact must begin with a load, or because the finger's reading has left the tare."""
    begins = (rows["tare_reason"] == TareReason.ROLL_BACK) & ((rows["flags"] & FrameFlags.TARE_CHANGED) != 0)
    # On 19 electrodes noise reaches 2.5 times the mean once in 3,000 rounds, and in three rounds running once in 10^10.
    noise = np.sqrt(2.5 * 19) * course.sensor.noise_counts
    for k in np.flatnonzero(begins).tolist():
        if course.force_n[max(k - LATE, 0) : k + 1].max() > 0:
            continue
        outcome.idle_touches += 1
        away = np.linalg.norm(course.reads[k] - rows["tare_q4"][k - 1] / 16.0)
        above = course.pressure[k] - rows["pdc_tare_q4"][k - 1] / 16.0  # of the undershoot that recovers
        if away + noise < np.sqrt(rows["threshold_count2"][k]) and above + PDC_NOISE < PDC_HIT:
            outcome.broken.append(f"frame {k}: contact without load, {away:.1f} counts from the tare")


def _judge_loads(course: Course, rows: StructArray, outcome: Outcome) -> None:
    changed = (rows["flags"] & FrameFlags.TARE_CHANGED) != 0
    released = changed & np.isin(rows["tare_reason"], RELEASES)
    held = course.force_n > HELD_N
    outcome.held_frames = int(held.sum())
    outcome.tared_away = int((released & held).sum())
    for k in np.flatnonzero(released & held)[:3].tolist():
        outcome.broken.append(f"frame {k}: a load of {course.force_n[k]:.2f} N was tared away")
    # A load must have lasted to be seen; a lost word and the glitch filter each take a round.
    lasting = held.copy()
    for back in range(1, LATE + 1):
        lasting[back:] &= held[:-back]
        lasting[:back] = False
    for k in np.flatnonzero(lasting & (rows["tare_state"] == TareState.REST))[:1].tolist():
        outcome.broken.append(f"frame {k}: {course.force_n[k]:.2f} N for {LATE} frames, but the finger is at rest")
    _judge_releases(course, rows, outcome)


def _judge_releases(course: Course, rows: StructArray, outcome: Outcome) -> None:
    loaded = course.force_n > 0
    touch = _is_touch(course, rows)
    ends = [*np.flatnonzero(~loaded[:-1] & loaded[1:]).tolist(), len(rows) - 1]
    for k in (np.flatnonzero(loaded[:-1] & ~loaded[1:]) + 1).tolist():
        end = next(e for e in ends if e >= k) + 1
        state = rows["tare_state"][k:end]
        if len(state) < RELEASED_WITHIN:
            continue
        outcome.releases += 1
        free = np.flatnonzero(np.isin(state, (TareState.REST, TareState.DOUBT)))
        outcome.release_frames = max(outcome.release_frames, int(free[0]) if len(free) else len(state))
        if not len(free) or free[0] > RELEASED_WITHIN:
            outcome.broken.append(f"frame {k}: released, but in contact for more than {RELEASED_WITHIN} frames")
        tared = int(np.argmax(np.append(state == TareState.REST, True)))
        touched = np.flatnonzero(np.append(touch[k : k + tared], True))
        waited = int(np.diff(touched, prepend=-1).max()) - 1
        outcome.tared_frames = max(outcome.tared_frames, waited)
        if waited > TARED_WITHIN:
            outcome.broken.append(f"frame {k}: released, but not tared within {TARED_WITHIN} frames of no touch")


def _is_touch(course: Course, rows: StructArray) -> np.ndarray:
    """Whether the finger's reading by the model would be a touch against the tare in force (n,)."""
    above = course.pressure - rows["pdc_tare_q4"] / 16.0
    away = course.reads - rows["tare_q4"] / 16.0
    touch: np.ndarray = (above > PDC_HIT) | ((away**2).sum(axis=1) > rows["threshold_count2"])
    return touch


def rest(seed: int, seconds: float, *, worn: bool) -> int:
    """The number of contacts that the board sees on a drifting, untouched finger; each is a defect."""
    sensor = PaperFinger(seed, "worn" if worn else "new")
    # The worst drift measured, in either direction.
    sensor.drift_per_min = np.full(19, 15.0 if seed % 2 else -15.0)
    rows = Finger().feed(**resting(sensor, seconds, seed))
    changed = (rows["flags"] & FrameFlags.TARE_CHANGED) != 0
    return int((changed & (rows["tare_reason"] == TareReason.ROLL_BACK)).sum())
