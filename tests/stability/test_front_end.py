"""The tare machine on the sensor model: slow loads, noise, drift, creep, temperature. The finger's reading at
rest and under load is the model's own; how the board came to a tare plays no part in judging it.
"""

import numpy as np
import pytest
from courses import PAD, Course, Script, resting, script
from paper_finger import PaperFinger

from biotac import Finger, FrameFlags, Setting, TareReason, TareState

FULL_N = 5.0
SLEW_PER_S = 0.5005  # counts; SPEC.md: drift is followed at 0.5 count/s at most, 328/65536 in every frame


def without_drift(begun: Script) -> Script:
    begun.sensor.drift_per_min = np.zeros(19)
    return begun


def changes(rows: np.ndarray, first: int = 0) -> list[TareReason]:
    """Why the tare changed, from frame ``first`` on."""
    late = rows[first:]
    return [TareReason(r) for r in late["tare_reason"][(late["flags"] & FrameFlags.TARE_CHANGED) != 0]]


# ---- slow loads ------------------------------------------------------------------------------------

_ramps: dict[tuple[str, float], Course] = {}


def ramp(profile: str, n_per_s: float) -> Course:
    """To 5 N at this rate and a hold of ten seconds. Without drift: a frozen tare misses drift too, which is no load
    that the tare took away."""
    if (profile, n_per_s) not in _ramps:
        begun = without_drift(script(1, profile))
        _ramps[profile, n_per_s] = begun.load(FULL_N, n_per_s, PAD).hold(10).make()
    return _ramps[profile, n_per_s]


def kept_in_hold(course: Course, *, pdc: bool) -> float:
    rows = course.run(pdc=pdc)
    held = course.force_n >= FULL_N - 1e-9
    assert held.sum() >= 1000
    assert (rows["tare_state"][held] == TareState.CONTACT).all()
    return float(course.kept(rows)[held].min())


RAMPS = [("new", 0.1), ("new", 0.5), ("new", 2.0), ("new", 20.0), ("worn", 0.1), ("worn", 1.0), ("worn", 20.0)]


@pytest.mark.parametrize(("profile", "n_per_s"), RAMPS)
def test_a_slow_load_keeps_its_signal_without_pressure(profile: str, n_per_s: float) -> None:
    assert kept_in_hold(ramp(profile, n_per_s), pdc=False) >= 0.98


@pytest.mark.parametrize(("profile", "n_per_s"), [pytest.param("new", 0.02, marks=pytest.mark.nightly), *RAMPS])
def test_pressure_keeps_the_slowest_load(profile: str, n_per_s: float) -> None:
    assert kept_in_hold(ramp(profile, n_per_s), pdc=True) >= 0.99


# ---- noise and drift -------------------------------------------------------------------------------


@pytest.mark.parametrize(("noise", "glitches", "per_min"), [(1.5, 0.0, 0.0), (5.0, 0.005, 15.0), (5.0, 0.005, -15.0)])
@pytest.mark.parametrize("profile", ["new", "worn"])
def test_ten_minutes_of_rest_have_no_contact(profile: str, noise: float, glitches: float, per_min: float) -> None:
    sensor = PaperFinger(3, profile)
    sensor.noise_counts, sensor.glitch_share = noise, glitches
    sensor.drift_per_min = np.full(19, per_min)
    rows = Finger().feed(**resting(sensor, 600.0, seed=7))
    assert changes(rows) == [TareReason.START]
    assert (rows["tare_state"][50:] == TareState.REST).all()
    # A tare that follows means of eight rounds is off by no more than the noise of one, five sigma, and the drift
    # of the finger until a sweep's end.
    true = sensor.rest_counts(np.zeros(1)) + np.arange(len(rows))[:, None] / 6000 * per_min
    error = np.abs(true - rows["tare_q4"] / 16.0)[50:].max()
    assert error <= 5 * noise / 8**0.5 + abs(per_min) / 60 * 0.16 + 1 / 16


@pytest.mark.nightly
def test_ten_hours_of_a_worn_finger_have_no_contact() -> None:
    # White noise of sigma 5, glitches in 0.5 % of the words and never two in a row, 15 counts a minute.
    random = np.random.default_rng(5)
    for hour in range(10):
        counts = random.normal(random.uniform(2955, 3100, 19), 5.0, (360_000, 19))
        counts += np.linspace(0, 900 if hour % 2 else -900, 360_000)[:, None]
        glitched = random.random(counts.shape) < 0.005
        glitched[1:] &= ~glitched[:-1]
        counts -= glitched * random.uniform(28, 66, counts.shape)
        pdc = np.rint(random.normal(1326, 1, 360_000)).astype(np.uint16)
        rows = Finger().feed(np.rint(counts).astype(np.uint16), pdc)
        assert changes(rows) == [TareReason.START]


def test_two_glitches_among_noise_are_no_touch() -> None:
    # Confirming jumps from word to word, the first glitch passed for motion, the word after it, which is the way
    # back, was held back as a jump, and the second glitch was no jump from there.
    rest = np.full((100, 19), 3000)
    noise = np.where(np.arange(19) % 2, 5, -5)  # 450 count^2 on the other electrodes
    words = np.tile(rest[0] + noise, (7, 1))
    words[:, 5] = 3000 + np.array([-10, -32, 0, -52, 0, 0, 0])
    finger = Finger()
    finger.feed(rest, np.full(100, 1326))
    rows = finger.feed(words, np.full(7, 1326))
    assert (rows["tare_state"] == TareState.REST).all()


@pytest.mark.parametrize("per_min", [15.0, -15.0])
def test_after_hours_of_drift_a_press_is_seen_whole(per_min: float) -> None:
    # An hour at the worst drift is as far as the converter's range goes: 900 counts.
    sensor = PaperFinger(3)
    sensor.noise_counts, sensor.glitch_share = 5.0, 0.005
    sensor.drift_per_min = np.full(19, per_min)
    finger = Finger()
    for minute in range(60):
        rows = finger.feed(**resting(sensor, 60.0, seed=minute, start_s=60.0 * minute))
        assert (rows["tare_state"][50:] == TareState.REST).all() and len(changes(rows)) == (minute == 0)
    true = sensor.rest_counts(np.zeros(1))[0] + 60 * per_min
    np.testing.assert_allclose(finger.tare_counts, true, atol=5 * 5.0 / 8**0.5)
    pressed = np.rint(np.tile(true, (10, 1))).astype(int)
    pressed[:, [1, 11, 16]] -= 200
    rows = finger.feed(pressed, np.full(10, sensor.pdc_rest + 300).astype(int))
    assert rows["tare_state"][-1] == TareState.CONTACT
    kept = (rows["tare_q4"][-1] / 16.0 - pressed[-1])[[1, 11, 16]]
    # The roll-back is to a tare of at most two seconds before, half a count of drift.
    np.testing.assert_allclose(kept, 200, atol=5 * 5.0 / 8**0.5 + 0.5 + 0.5)


# ---- release, creep, cycles ------------------------------------------------------------------------

# With pressure the slowest way out is a residue: 12 still sweeps of 80 ms, one that was under way, one that still
# moved; creep of 5 % of 1,000 counts moves by less than the 12 counts a second that count as still.
TARED_WITHIN = 120  # frames


@pytest.mark.parametrize("profile", ["new", "worn"])
@pytest.mark.parametrize("force_n", [1.0, 5.0, 10.0, 20.0])
def test_a_released_finger_is_tared_though_it_creeps(profile: str, force_n: float) -> None:
    begun = without_drift(script(2, profile))
    begun.sensor.creep_share = 0.05
    course = begun.load(force_n, 10.0, PAD).hold(30).load(0, 20).rest(60).make()
    released = int(np.flatnonzero(course.force_n > 0)[-1])
    rows = course.run()
    state = rows["tare_state"][released:]
    # Tared, or in doubt for as long as the model's pressure creeps: after half a minute at 5 N by 29 counts.
    assert np.isin(state[: TARED_WITHIN + 1], (TareState.REST, TareState.DOUBT)).any()
    if state[-1] == TareState.DOUBT:
        assert course.words["pdc"][-100:].mean() - rows["pdc_tare_q4"][-1] / 16 > 10
        return
    # The skin creeps back by up to 150 counts. Where that passes the threshold it looks like touches; none of them
    # may last: after a minute the finger rests. The tare was last set to the reading then, creep and all, and has
    # followed the creep at the slew since.
    assert state[-1] == TareState.REST
    last = int(np.flatnonzero((rows["flags"] & FrameFlags.TARE_CHANGED) != 0)[-1])
    creep = np.abs(course.reads - course.rest).max(axis=1)
    followed = SLEW_PER_S * (len(rows) - last) / 100
    noise = 5 * course.sensor.noise_counts / 8**0.5
    assert course.tare_error(rows)[-1] <= max(creep[last] - followed, creep[-1]) + noise


def test_fifty_presses_are_each_seen_and_leave_no_bias() -> None:
    begun = without_drift(script(4, "worn"))
    for _ in range(50):
        begun.load(FULL_N, 20, PAD).hold(0.25).load(0, 20).rest(0.5)
    course = begun.rest(5).make()
    rows = course.run()
    touched = rows["tare_state"] == TareState.CONTACT
    starts = np.flatnonzero(np.diff((course.force_n > 0).astype(int)) == 1)
    assert len(starts) == 50
    # At 20 N/s, 0.1 N is past the pressure's six counts in one frame; three make a contact, and one glitch may
    # hold the first back.
    assert all(touched[start + 1 : start + 8].any() for start in starts)
    held = course.force_n >= FULL_N - 1e-9
    assert touched[held].all()
    # Creep that is tared away between two presses is missed by the next; it is no more than the creep's share.
    assert course.kept(rows)[held].min() >= 1 - course.sensor.creep_share - 0.01
    assert (rows["tare_state"][-100:] == TareState.REST).all()


# ---- temperature -----------------------------------------------------------------------------------


def pressed_once(profile: str) -> Script:
    """Without drift. After a press has shown that pressure moves, pressure says that nothing touches."""
    return without_drift(script(2, profile)).load(3, 20).hold(1).load(0, 20).rest(20)


# Twenty minutes of a sensor's time each: by day each profile, and each kind, once.
@pytest.mark.parametrize(
    ("profile", "pdc"),
    [
        ("new", True),
        ("worn", False),
        *(pytest.param(profile, pdc, marks=pytest.mark.nightly) for profile, pdc in [("new", False), ("worn", True)]),
    ],
)
def test_eight_degrees_at_rest_are_followed_within_the_slew(profile: str, pdc: bool) -> None:
    begun = without_drift(script(2, profile)).warm(8, 400).rest(5).warm(-16, 800).rest(5)
    course = begun.make()
    rate = np.abs(np.diff(course.rest, axis=0)).max() * 100
    assert 0.25 < rate < SLEW_PER_S  # counts/s; faster than this is no drift to the machine
    rows = course.run(pdc=pdc)
    assert changes(rows) == [TareReason.START]
    assert course.tare_error(rows)[100:].max() <= 5 * course.sensor.noise_counts / 8**0.5 + rate * 0.16 + 1 / 16


@pytest.mark.parametrize("profile", ["new", "worn"])
@pytest.mark.parametrize("celsius", [8.0, -8.0])
@pytest.mark.parametrize("seconds", [16, 30])
def test_faster_warming_looks_like_touches_and_ends_in_a_tare(profile: str, celsius: float, seconds: int) -> None:
    # Up to half a degree a second. While it lasts nothing but the pressure tells it from a touch.
    begun = pressed_once(profile)
    over = round((begun.track.seconds + seconds) * 100)
    course = begun.warm(celsius, seconds).rest(10).make()
    rows = course.run()
    assert (rows["tare_state"][over + 2 * TARED_WITHIN :] == TareState.REST).all()
    assert course.tare_error(rows)[-1] <= 5 * course.sensor.noise_counts / 8**0.5 + 1


@pytest.mark.parametrize("profile", ["new", "worn"])
@pytest.mark.parametrize("celsius", [8.0, -8.0])
def test_a_jump_of_temperature_is_no_touch_five_seconds_after_it_began(profile: str, celsius: float) -> None:
    begun = pressed_once(profile)
    over = round((begun.track.seconds + 5) * 100)
    course = begun.warm(celsius, 4).rest(30).make()
    rows = course.run()
    assert (rows["tare_state"][over:] == TareState.REST).all()
    assert course.tare_error(rows)[-1] <= 5 * course.sensor.noise_counts / 8**0.5 + 1


@pytest.mark.parametrize("profile", ["new", "worn"])
@pytest.mark.parametrize(("pdc", "electrodes", "seconds"), [(8, 0, 2.0), (0, 20, 5.0), (5, 20, 5.0)])
def test_a_shift_is_no_touch(profile: str, pdc: int, electrodes: int, seconds: float) -> None:
    words = {name: channel.copy() for name, channel in script(5, profile).rest(20).make().words.items()}
    words["pdc"][1500:] += pdc
    words["counts"][1500:] += electrodes
    state = Finger().feed(**words)["tare_state"][1500:]
    assert (state[round(100 * seconds) :] == TareState.REST).all()


def thermal_error(course: Course, gain_milli: int, before: slice, after: slice) -> float:
    """Length of the change of signal that the temperature alone made, in counts."""
    rows = course.run({Setting.THERMAL_GAIN_MILLI: gain_milli})
    assert (rows["tare_state"][after] == TareState.CONTACT).all()
    assert (rows["flags"][after] & FrameFlags.TEMP).all()
    signal = course.reads - rows["tare_q4"] / 16.0
    return float(np.linalg.norm(signal[after].mean(axis=0) - signal[before].mean(axis=0)))


@pytest.mark.parametrize(("profile", "celsius"), [("new", 8.0), ("new", -8.0), ("worn", 8.0), ("worn", -8.0)])
def test_the_thermal_term_removes_part_of_a_step_in_a_hold(profile: str, celsius: float, record_property) -> None:
    removed = []
    for seed in range(1, 6):
        begun = without_drift(script(seed, profile))
        begun.sensor.creep_share = 0.0
        course = begun.load(FULL_N, 5, PAD).hold(3).warm(celsius, 5).hold(10).make()
        before, after = slice(1300, 1400), slice(-200, None)
        without = thermal_error(course, 0, before, after)
        removed.append(1 - thermal_error(course, 500, before, after) / without)
    record_property("share_removed", removed)
    print(
        f"{profile}, {celsius:+.0f} degrees in a 5 N hold: thermal term removes {min(removed):.2f}..{max(removed):.2f}"
    )
    # Never worse than none. The removed part depends on the sensor: one gain for all electrodes, while the change
    # of each per degree goes with count and load.
    assert min(removed) > 0
