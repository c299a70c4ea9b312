"""Device time to host time, judged by a model that knows the truth (clock_model.py)."""

import dataclasses
import doctest
import time

import numpy as np
import pytest
from clock_model import WAY_S, Model
from hypothesis import given, settings
from hypothesis import strategies as st

import biotac
import biotac.clock
from biotac.clock import LAST_SAMPLE_US, Arrivals, DeviceClock, channel_t_us, electrode_t_us, pac_t_us
from biotac.clock.band import between
from biotac.clock.segment import MAX_DRIFT, WANDER_PER_S
from biotac.wire import messages_gen as wire
from biotac.wire import sensor_gen as sensor
from biotac.wire.framing import encode

SEEDS = range(8)
BY_DAY = [pytest.param(seed, marks=() if seed < 2 else pytest.mark.nightly) for seed in SEEDS]
WORST = {"wander_ppm_per_s": WANDER_PER_S * 1e6, "way_back_s": 0.000_6}


def follow(model: Model, *, every_s: float = 0.25) -> tuple[DeviceClock, np.ndarray]:
    """Feed a clock; returns the clock and a row of (time, error, stated uncertainty) for each newest event."""
    clock = DeviceClock()
    rows = []
    due_s = model.host_start_s
    for received_s, sent_s, t_us in model.events():
        if np.isnan(sent_s):
            clock.arrived(t_us, received_s)
        else:
            clock.round_trip(sent_s, t_us, received_s)
        if received_s >= due_s and clock.now().known:
            due_s = received_s + every_s
            error_s = float(clock.host_time_s(t_us)) - float(model.host_s(t_us))
            rows.append((received_s - model.host_start_s, error_s, float(clock.uncertainty_s(t_us))))
    return clock, np.array(rows)


def unseen_s(model: Model) -> float:
    """An error that no observation can show: half the difference of the two ways' least delays."""
    return (model.way_back_s - WAY_S) / 2


# ---- promises --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("changes", "seeds"),
    [
        pytest.param(WORST, SEEDS[:2], id="worst"),
        pytest.param(WORST, SEEDS, id="worst, by night", marks=pytest.mark.nightly),
        pytest.param({}, SEEDS, id="steady", marks=pytest.mark.nightly),
    ],
)
def test_a_crystal_50_ppm_off_behind_a_jittery_link(changes: dict[str, float], seeds: range) -> None:
    residuals_s, after_a_minute_s = [], []
    for seed in seeds:
        model = Model(seed, 120.0, ppm=50.0, **changes)
        clock, rows = follow(model)
        time_s, error_s, stated_s = rows.T
        assert clock.resets == 0
        assert (np.abs(error_s) <= stated_s).all()
        residuals_s.append(np.abs(error_s - unseen_s(model)))
        after_a_minute_s.append(residuals_s[-1][time_s > 60])
        now = clock.now()
        drift_ppm = 1e6 * (float(np.diff(model.device_us(model.host_start_s + np.array([118.0, 119.0])))[0]) / 1e6 - 1)
        assert abs(now.drift_ppm - drift_ppm) <= now.drift_uncertainty_ppm
        assert abs(now.drift_ppm - drift_ppm) < 10
        # The bound is useful: with a round trip of 1.2 ms it is no wider than that.
        assert np.median(stated_s[time_s > 60]) < clock.quickest_round_trip_s
    assert np.quantile(np.concatenate(residuals_s), 0.99) <= 0.001
    assert np.quantile(np.concatenate(after_a_minute_s), 0.99) <= 0.000_2


@pytest.mark.parametrize("seed", BY_DAY)
def test_every_sample_of_a_recording_gets_a_time_within_the_stated_uncertainty(seed: int) -> None:
    model = Model(seed, 400.0, **WORST)
    clock, _ = follow(model, every_s=50.0)
    t_us = model.frames()[0]
    error_s = clock.host_time_s(t_us) - model.host_s(t_us)
    assert (np.abs(error_s) <= clock.uncertainty_s(t_us)).all()
    assert np.quantile(np.abs(error_s - unseen_s(model)), 0.99) <= 0.000_2
    # Samples of 2200 Hz stay in order, over knots too.
    pac_s = clock.host_time_s(pac_t_us(t_us).ravel())
    assert np.diff(pac_s).min() > 0.000_4


def test_old_times_keep_a_bound_that_holds_when_the_crystal_has_turned() -> None:
    model = Model(3, 300.0, ppm=-20.0, wander_ppm_per_s=WANDER_PER_S * 1e6)
    clock, rows = follow(model, every_s=5.0)
    assert (np.abs(rows[:, 1]) <= rows[:, 2]).all()
    silent_us = clock.segments[-1].last_t_us + np.array([1, 10, 50]) * 1_000_000
    error_s = clock.host_time_s(silent_us) - model.host_s(silent_us)
    assert (np.abs(error_s) <= clock.uncertainty_s(silent_us)).all()
    assert (np.diff(clock.uncertainty_s(silent_us)) > 0).all()


def test_a_slow_reader_widens_nothing_once_it_has_been_quick() -> None:
    """Delays are one-sided: a row that a busy program reads a second late neither moves nor breaks the clock."""
    clock = DeviceClock()
    for k in range(60):
        clock.round_trip(10.0 + k, 1_000_000 * k + 400, 10.001 + k)
        for j in range(1, 100):
            clock.arrived(1_000_000 * k + 10_000 * j, 11.9 + k)
    assert clock.resets == 0
    assert abs(float(clock.host_time_s(30_000_000)) - 40.0001) < 0.000_7
    assert float(clock.uncertainty_s(30_000_000)) < 0.000_7


# ---- restarts, jumps, wraps ----------------------------------------------------------------------


def feed(clock: DeviceClock, *, from_us: int, host_s: float, seconds: int = 20) -> None:
    for k in range(seconds * 2):
        clock.round_trip(host_s + k / 2, from_us + k * 500_000 + 400, host_s + k / 2 + 0.001)


def test_a_reboot_begins_a_segment_and_the_old_one_still_answers() -> None:
    clock = DeviceClock()
    feed(clock, from_us=900_000_000, host_s=100.0)
    feed(clock, from_us=5_000, host_s=130.0)
    assert clock.resets == 1
    assert clock.segments[-1].because == "device time stepped back"
    assert float(clock.host_time_s(1_005_000)) == pytest.approx(131.0, abs=0.001)
    assert float(clock.host_time_s(901_000_000, segment=-2)) == pytest.approx(101.0, abs=0.001)


def test_a_reboot_whose_time_goes_on_by_chance_is_told_by_its_boot_id() -> None:
    clock = DeviceClock()
    feed(clock, from_us=0, host_s=100.0)
    clock.restart("boot_id changed")
    feed(clock, from_us=21_000_000, host_s=130.0)
    assert clock.resets == 1
    assert clock.segments[-1].because == "boot_id changed"
    assert float(clock.host_time_s(22_000_000)) == pytest.approx(131.0, abs=0.001)


def test_a_device_time_that_runs_ahead_of_its_arrival_is_another_clock() -> None:
    clock = DeviceClock()
    feed(clock, from_us=4_000_000_000, host_s=100.0)
    # A reboot seen through unwrapping: a small number becomes one behind the wrap.
    feed(clock, from_us=2**32 + 5_000, host_s=130.0)
    assert clock.resets == 1
    assert clock.segments[-1].because == "a message arrived before it could have been sent"
    assert float(clock.host_time_s(2**32 + 1_005_000)) == pytest.approx(131.0, abs=0.001)


def test_a_host_clock_that_stood_still_is_noticed() -> None:
    """time.monotonic() stops while some computers sleep; the board's goes on."""
    clock = DeviceClock()
    feed(clock, from_us=0, host_s=100.0)
    feed(clock, from_us=3_600_000_000, host_s=121.0)
    assert clock.resets == 1
    clock = DeviceClock()
    feed(clock, from_us=0, host_s=100.0)
    feed(clock, from_us=20_500_000, host_s=3_700.0)  # the board's stood still
    assert clock.resets == 1
    assert clock.segments[-1].because == "an answer is older than its question"


def test_a_rate_that_no_crystal_has_is_told_by_segment_after_segment() -> None:
    clock = DeviceClock()
    for k in range(200):  # a simulated board at twice the speed
        clock.round_trip(100.0 + k / 2, k * 1_000_000, 100.001 + k / 2)
    assert clock.resets > 10


@pytest.mark.parametrize("silence_s", [0.5, 1800.0, 5 * 86_400.0])
def test_32_bits_of_time_are_extended_over_wraps(silence_s: float) -> None:
    clock = DeviceClock()
    first_us = 2**32 - 10_000_000
    feed(clock, from_us=first_us, host_s=100.0, seconds=20)
    later_us = first_us + 20_000_000 + round(silence_s * 1e6)
    assert later_us >= 2**32
    assert clock.extend(later_us % 2**32, 120.0 + silence_s + 0.05) == later_us
    # One that was overtaken by newer ones keeps the same place.
    assert clock.extend((first_us + 9_000_000) % 2**32, 120.0) == first_us + 9_000_000
    assert clock.resets == 0


# ---- uncertainty is stated -------------------------------------------------------------------


def test_without_a_round_trip_nothing_is_claimed() -> None:
    clock = DeviceClock()
    assert np.isnan(clock.host_time_s([[0, 1]])).all()
    assert np.isinf(clock.uncertainty_s(0))
    assert not clock.now().known
    for k in range(100):
        clock.arrived(k * 10_000, 100.0 + k / 100)
    assert np.isnan(clock.host_time_s([0, 1])).all()
    assert np.isinf(clock.uncertainty_s([0, 1])).all()
    assert clock.host_time_s(np.empty((0, 22))).shape == (0, 22)


@pytest.mark.parametrize("seed", BY_DAY)
def test_a_promise_stands_in_for_round_trips(seed: int) -> None:
    model = Model(seed, 120.0)
    clock = DeviceClock(promised_delay_s=0.002)
    t_us, arrived_s = model.frames()
    for t, at in zip(t_us, arrived_s, strict=True):
        clock.arrived(int(t) + LAST_SAMPLE_US, float(at))
    error_s = clock.host_time_s(t_us) - model.host_s(t_us)
    assert (np.abs(error_s) <= clock.uncertainty_s(t_us)).all()
    assert np.median(clock.uncertainty_s(t_us)) < 0.002


def test_the_cheap_estimate_and_the_extended_fit_are_within_the_bound() -> None:
    clock = DeviceClock()
    for k in range(100):
        clock.round_trip(50.0 + k, 1_000_000 * k, 50.001 + k)  # answered after half a ms
    host_s, bound_s = clock.now().extended(np.array([102_250_000.0]))
    for found_s in (clock.estimate_s(102_250_000), host_s[0]):
        assert abs(found_s - 152.2505) < bound_s[0] < 0.001
    assert np.isnan(DeviceClock().estimate_s(0))


def test_the_example_in_the_documentation_is_true() -> None:
    done = doctest.testmod(biotac.clock)
    assert done.attempted > 0
    assert done.failed == 0


def test_unix_time_needs_an_offset() -> None:
    clock = DeviceClock()
    feed(clock, from_us=0, host_s=100.0)
    with pytest.raises(ValueError, match="unix_offset_s is not set"):
        clock.unix_time_s([0])
    clock.unix_offset_s = 1.7e9
    assert float(clock.unix_time_s(1_000_000)) == pytest.approx(1.7e9 + 101.0, abs=0.001)


def test_nonsense_is_refused() -> None:
    with pytest.raises(ValueError, match="promised_delay_s is nan"):
        DeviceClock(promised_delay_s=float("nan"))
    with pytest.raises(ValueError, match="before sent_s"):
        DeviceClock().round_trip(2.0, 0, 1.0)
    with pytest.raises(ValueError, match="channel is 'E20'"):
        channel_t_us(0, "E20")


# ---- the parts -----------------------------------------------------------------------------------

POINT = st.tuples(st.floats(-100, 100), st.floats(0, 2))


@settings(max_examples=200, deadline=None)
@given(
    a=st.floats(-5, 5),
    slope=st.floats(-0.9, 0.9),
    above=st.lists(POINT, min_size=1, max_size=30),
    below=st.lists(POINT, min_size=1, max_size=30),
)
def test_the_true_line_is_in_the_band_and_its_corners_touch(a, slope, above, below) -> None:
    ux, uy = np.array([(x, a + slope * x + gap + 1e-9) for x, gap in above]).T
    lx, ly = np.array([(x, a + slope * x - gap - 1e-9) for x, gap in below]).T
    band = between((ux, uy), (lx, ly), (-1.0, 1.0))
    assert band is not None
    low, high = band.at_zero()
    assert low <= a <= high
    assert band.slopes[0] <= slope <= band.slopes[-1]
    y, middle = band.centre()
    assert low <= y <= high
    assert band.slopes[0] <= middle <= band.slopes[-1]
    for b, lo, hi in zip(band.slopes, band.low, band.high, strict=True):
        # Every corner is a line that fits, and none fits beyond it.
        assert np.isclose((uy - b * ux).min(), hi, atol=1e-7)
        assert np.isclose((ly - b * lx).max(), lo, atol=1e-7)
        assert hi >= lo - 1e-9


def test_points_that_contradict_leave_no_line() -> None:
    x = np.array([0.0, 1.0, 2.0])
    assert between((x, np.array([1.0, 0.0, 1.0])), (x, np.array([0.0, 0.5, 0.0])), (-1, 1)) is None
    assert between((x, x * 2), (x, x * 2 - 0.1), (-1, 1)) is None  # only a slope of 2 would do


def test_samples_have_the_times_of_their_slots() -> None:
    t_us = np.array([1_000_000, 1_010_000])
    electrodes, pac = electrode_t_us(t_us), pac_t_us(t_us)
    assert electrodes.shape == (2, 19)
    assert pac.shape == (2, 22)
    for name, at in zip([f"E{k}" for k in range(1, 20)], electrodes[0], strict=True):
        assert round((at - 1_000_000) * 4400 / 1e6) == sensor.SLOTS.index(name)
    assert np.allclose(np.diff(pac), 1e6 / 2200)
    assert np.array_equal(pac[:, 0], t_us)
    assert np.allclose(channel_t_us(t_us, "E19")[:, 0], electrodes[:, 18])
    # The round's last sample is E19's: no message of the round is sent before.
    assert 0 <= electrodes[0].max() - 1_000_000 - LAST_SAMPLE_US < 1


# ---- in a Hand and in a recording ----------------------------------------------------------------


def test_a_hand_asks_the_board_for_its_time(scripted_board, hello) -> None:
    """The board's clock here is the computer's own, from a start that is known: only one result is right."""
    begin_s = time.monotonic() - 4000.0

    def answer(message_id: int, payload: bytes) -> bytes:
        if message_id == wire.HelloRequest.ID:
            return hello(payload)
        if message_id == wire.GetStatus.ID:
            facts = dict.fromkeys((f.name for f in dataclasses.fields(wire.Status)), 0) | {"finger_faults": (0,) * 5}
            t_us = int((time.monotonic() - begin_s) * 1e6) % 2**32
            return encode(wire.Status.ID, wire.Status(**facts | {"t_us": t_us, "req_id": payload[0]}).pack())
        return b""

    with biotac.open(scripted_board(answer).path) as hand:
        assert not hand.clock.now().known
        asked_s = time.monotonic()
        hand.sync()
        now, took_s = hand.clock.now(), time.monotonic() - asked_s
    assert now.known
    assert hand.clock.resets == 0
    # The quickest round trip may be the first of those that a busy computer stretches.
    bound_s = hand.clock.quickest_round_trip_s + MAX_DRIFT * took_s
    assert abs(now.host_s - begin_s - now.t_us / 1e6) <= now.uncertainty_s <= bound_s
    unix_s = float(hand.clock.unix_time_s(now.t_us))
    assert unix_s - now.host_s == pytest.approx(time.time() - time.monotonic(), abs=60)


class Heard:
    """In place of a DeviceClock: notes each observation."""

    def __init__(self) -> None:
        self.received: list[tuple[int, float]] = []

    def arrived(self, t_us: int, host_s: float) -> None:
        self.received.append((t_us, host_s))


def test_of_a_fast_link_the_clock_is_told_the_quickest_of_every_20_ms() -> None:
    clock = Heard()
    arrivals = Arrivals(clock)  # type: ignore[arg-type]
    delays_us = [900, 500, 100, 700, 800, 300, 600, 200]
    for k in range(400):  # a message each 5 ms
        delay_us = delays_us[k % 8]
        arrivals.note(5_000 * k, 5.0 + (5_000 * k + delay_us) / 1e6)
    assert clock.received[0] == (0, pytest.approx(5.0009))
    lags_us = [round((host_s - 5.0) * 1e6) - t_us for t_us, host_s in clock.received[1:]]
    assert set(lags_us) <= {100, 200, 300} and len(lags_us) >= 79


def test_what_came_before_a_restart_is_not_told_after_it() -> None:
    clock = Heard()
    arrivals = Arrivals(clock)  # type: ignore[arg-type]
    arrivals.note(10**9, 50.0)
    arrivals.note(10**9 + 5_000, 50.005)
    arrivals.forget()
    arrivals.note(1_000, 50.03)
    assert clock.received == [(10**9, 50.0), (1_000, 50.03)]


@pytest.mark.filterwarnings("ignore::biotac.ReadWarning")  # of rows that are lost when this computer stops
def test_a_simulated_board_in_real_time_is_a_clock() -> None:
    """However late this computer lets it run: it sends nothing ahead of its time, and reads nothing behind it."""
    with biotac.open("sim:press.toml?pace=real&fingers=2") as hand:
        hand.stream()
        ages_s: list[float] = []
        resets = 0
        while len(ages_s) < 3:  # on a busy computer replies come late, and after many frames
            last_us = int(hand.read(0.3)["t_us"][-1])
            if hand.clock.resets > resets:  # it got no core for longer than the board catches up (port_posix.c)
                ages_s, resets = [], hand.clock.resets
            elif hand.clock.now().known:
                ages_s.append(time.monotonic() - float(hand.clock.host_time_s(last_us)))
        assert min(ages_s) > 0 and max(ages_s) < 600
