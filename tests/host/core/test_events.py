"""Events by the board's own code: on recordings of real fingers, and on noise."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pac_events import pac_events

import biotac
from biotac import EventKind

SLIDING_M_S = 0.002
PER_S = 2200


def of_kind(events: Any, kind: EventKind) -> Any:
    return events[events["kind"] == kind]


@pytest.mark.nightly  # by day a scenario's slips, in tests/host/sim/test_stick_slip.py
def test_real_slides_slip_and_begin_to_when_the_robot_moves(shared_data: Path) -> None:
    # Ten materials, ten slides; the arm's speed is known every 7 ms, with holes of 40 ms.
    data = np.load(shared_data / "slides/slides.npz")
    called, late_s = [], []
    for trial in (f"m{m}_{k}_" for m in range(1, 11) for k in range(1, 11)):
        t_s, at_s = data[trial + "t"], data[trial + "cv_t"]
        speed_m_s = np.linalg.norm(data[trial + "cv"][:, :3], axis=1)
        events, slips = pac_events(data[trial + "frame"][:, 3:25])
        called.append(slips[np.interp(t_s, at_s, speed_m_s) > SLIDING_M_S].mean())
        begins_s = at_s[speed_m_s > SLIDING_M_S][0]
        if begins_s > 0.03:  # else it slides as the recording begins
            first = of_kind(events, EventKind.SLIP)[0]
            late_s.append(t_s[0] + first["t_us"] / 1e6 - begins_s)
    assert min(called) >= 0.95
    assert len(late_s) == 30
    assert np.sum(np.abs(late_s) <= 0.05) >= 28


def test_real_taps_are_jolts(shared_data: Path) -> None:
    # A tap is visible where the signal leaves, within 70 ms, twice the range of the 43 ms before.
    data = np.load(shared_data / "taps/handover.npz")
    signals = np.concatenate([data[f"handover_{what}_signals"] for what in ("rod", "box", "plate")]).astype(int)
    height = np.abs(signals - np.median(signals[:, :95], axis=1, keepdims=True))
    visible = height[:, 95:250].max(axis=1) > 2 * height[:, :95].max(axis=1)
    found, early = [], []
    for signal in signals:
        events, _ = pac_events(np.clip(2038 + signal[:594].reshape(-1, 22), 0, 4095))
        sample = of_kind(events, EventKind.JOLT)["t_us"].astype(int) * PER_S // 1_000_000
        early.append((sample < 95).any())
        found.append(((sample >= 95) & (sample < 250)).any())
    assert visible.sum() > 200
    assert np.mean(np.array(found)[visible]) >= 0.6
    assert np.mean(early) <= 0.05


@pytest.mark.parametrize("seconds", [60, pytest.param(600, marks=pytest.mark.nightly)])
def test_noise_held_holds_no_event(seconds: int) -> None:
    noise = np.rint(2038 + np.random.default_rng(3).normal(0.0, 5.0, (100 * seconds, 22))).astype(int)
    events, slips = pac_events(noise)
    assert len(events) == 0 and not slips.any()


def test_a_finger_tells_its_events_in_order() -> None:
    finger = biotac.Finger(index=2)
    counts = np.full((400, 19), 3000)
    counts[300:370, :6] -= 100
    pdc = np.full(400, 1326)
    pdc[300:370] += 60
    pac = np.full((400, 22), 2038)
    sway = np.rint(80 * np.sin(np.arange(20 * 22) * 2 * np.pi * 150 / PER_S)).astype(int)
    pac[320:340] += sway.reshape(20, 22)
    events = finger.events(counts, pdc, pac=pac)
    kinds = [EventKind(kind) for kind in events["kind"]]
    assert kinds == [EventKind.TOUCH, EventKind.JOLT, EventKind.SLIP, EventKind.STUCK, EventKind.LIFT]
    assert (events["finger"] == 2).all() and (np.diff(events["t_us"].astype(int)) >= 0).all()
    slip = of_kind(events, EventKind.SLIP)[0]
    assert 0 <= int(slip["onset_us"]) - 3_200_000 <= 5000 and slip["peak_count"] > 60
    assert of_kind(events, EventKind.TOUCH)["seq"][0] in (300, 301)


def held_in_noise(sigma: float) -> tuple[biotac.Finger, dict[str, Any]]:
    """A finger that judges slips, and rounds: pressed from 3 s on, with PAC noise of ``sigma`` from 4 s on."""
    counts, pdc = np.full((460, 19), 3000), np.full(460, 1326)
    counts[300:, :6], pdc[300:] = 2900, 1386
    noise = np.random.default_rng(5).normal(0.0, 1.0, (460, 22)) * np.where(np.arange(460) < 400, 4.0, sigma)[:, None]
    finger = biotac.Finger(quantities=biotac.QuantityFlags.FORCE | biotac.QuantityFlags.EVENTS)
    return finger, {"counts": counts, "pdc": pdc, "pac": np.rint(2038 + noise).astype(int)}


@pytest.mark.parametrize("sigma", [4.0, 16.0, 54.0])
def test_a_level_is_that_of_a_slip_and_not_of_noise(sigma: float) -> None:
    finger, rounds = held_in_noise(sigma)
    assert (finger.feed(**rounds)["slip_level"] == 0).all()
    finger, rounds = held_in_noise(sigma)
    sway = 150 * np.sin(np.arange(20 * 22) * 2 * np.pi * 150 / PER_S).reshape(20, 22)
    rounds["pac"][420:440] += np.rint(sway).astype(int)
    level = finger.feed(**rounds)["slip_level"]
    # rms of the change, within eight samples, of the mean of four: known of a sine; the explained part is left out
    ring = np.sqrt(2) * 150 * np.sin(8 * np.pi * 150 / PER_S) * np.sin(4 * np.pi * 150 / PER_S) / 4
    ring /= np.sin(np.pi * 150 / PER_S)
    assert (level[:420] == 0).all() and (level[442:] < 0.2 * ring).all()  # it listens on for a while
    assert 0.7 * ring <= np.median(level[424:440]) <= 1.1 * ring


def test_without_events_no_level_is_judged() -> None:
    _, rounds = held_in_noise(4.0)
    assert (biotac.Finger().feed(**rounds)["slip_level"] == 255).all()
    del rounds["pac"]
    finger = biotac.Finger(quantities=biotac.QuantityFlags.EVENTS)
    assert (finger.feed(**rounds)["slip_level"] == 255).all()
