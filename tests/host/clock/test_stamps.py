"""Stamps for other programs always grow, for any estimates of a clock and any delays of a link."""

from types import SimpleNamespace

import numpy as np

from biotac.clock import DeviceClock
from biotac.clock.stamps import Stamps


def board_of(clock: DeviceClock) -> SimpleNamespace:
    return SimpleNamespace(clock=clock, ended=False, sync=lambda round_trips=5: None)


def test_batches_that_come_early_and_late_are_stamped_in_order_and_each_stream_by_itself() -> None:
    now = [0.0]
    stamps = Stamps(board_of(DeviceClock()), lambda: now[0])
    random = np.random.default_rng(1)
    made: dict[int, list[float]] = {0: [], 1: []}
    for k in range(500):
        now[0] = max(now[0], k * 0.01 + random.exponential(0.02))
        for stream in (0, 1):
            t_us = 1e4 * k + np.arange(22) * 455.0 + 5000 * stream
            made[stream] += stamps.of(t_us, stream).tolist()
    for stream in (0, 1):
        assert np.diff(made[stream]).min() > 0
    assert stamps.by_arrival == 2 * 500 * 22


def test_an_estimate_that_falls_back_is_waited_for() -> None:
    clock = DeviceClock()
    for k in range(10):
        clock.round_trip(k - 0.5, 1_000_000 * k, k + 0.5)  # known to half a second
    stamps = Stamps(board_of(clock), lambda: 1000.0)
    before = stamps.of(np.array([9e6]))
    for k in range(10, 20):
        clock.round_trip(k - 0.5, 1_000_000 * k, k - 0.4)  # and now much better: the stamps told before were late
    after = stamps.of(np.array([9.001e6, 9.002e6, 30e6]))
    assert before[0] < after[0] < after[1] < after[2]


def test_a_clock_that_is_set_back_is_followed() -> None:
    now = [1000.0]
    stamps = Stamps(board_of(DeviceClock()), lambda: now[0])
    assert stamps.of(np.array([0.0])).tolist() == [1000.0]
    now[0] = 500.0
    assert stamps.of(np.array([1e4])).tolist() == [500.0]
    assert stamps.of(np.array([])).tolist() == []
