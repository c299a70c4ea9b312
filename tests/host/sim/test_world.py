"""A program that loads the simulated fingers round by round, and a board that waits for the program."""

import threading
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from typing import Any

import numpy as np
import pytest
from live_board import WAIT_S

import biotac
from biotac.errors import InputError
from biotac.sim import FAULTS, Course, Sampler, SimFinger, SimTouch, States, sample, touch, world
from biotac.sim.faults import Faulty
from biotac.sim.live import LiveFingers
from biotac.wire import slots
from biotac.wire.messages_gen import EventKind, FrameFlags

LIN = {"force_model": int(biotac.ForceModel.LIN)}
REST_S = 4.0


def pressed(k: int) -> SimTouch:
    """A press of up to 2 N that slides now and then."""
    return SimTouch(
        max(0.0, 2.0 * np.sin(k / 40)), (0.3 * np.sin(k / 30), 0.2), at=(-3.0, 1.0), slip_mm_s=5.0 * (k % 97 < 20)
    )


def all_states(loads: list[SimTouch]) -> States:
    parts = [touch.states(load)[0] for load in loads]
    return States(
        **{field.name: np.concatenate([getattr(part, field.name) for part in parts]) for field in fields(States)}
    )


# ---- a finger, round by round ----------------------------------------------------------------------


@pytest.mark.parametrize("profile", ["new", "worn"])
def test_a_finger_read_round_by_round_is_the_one_read_at_once(profile: Any) -> None:
    loads = [SimTouch(), SimTouch(), *(pressed(k) for k in range(300))]
    sampler = Sampler(SimFinger(3, profile))
    rounds = [sampler.step(*touch.states(load)) for load in loads[1:]]
    np.testing.assert_array_equal(rounds, sample(SimFinger(3, profile), all_states(loads)))


def test_a_course_goes_through_a_round_in_equal_parts() -> None:
    """A load that has gone by the round's end was felt in mid round, by dynamic pressure too."""
    straight, course, silent = (Sampler(SimFinger(1)) for _ in range(3))
    for sampler in (straight, course, silent):
        sampler.step(*touch.states(SimTouch(2.0)))
    plain = straight.step(*touch.states(SimTouch(4.0)))
    parts = course.step(*touch.states(Course([SimTouch(2.5), SimTouch(3.0), SimTouch(3.5), SimTouch(4.0)])))
    steps = [slots.PDC_SLOT, *slots.PAC_SLOT]
    assert np.abs(plain[steps].astype(int) - parts[steps]).max() <= 12  # the skin is no straight line, pressure is
    still = silent.step(*touch.states(SimTouch(2.0)))
    blow = Sampler(SimFinger(1))
    blow.step(*touch.states(SimTouch(2.0)))
    assert touch.states(Course())[0].force_n.tolist() == [0.0]  # which is no load
    struck = blow.step(*touch.states(Course([SimTouch(2.0), SimTouch(6.0), SimTouch(2.0), SimTouch(2.0)])))
    assert np.abs(struck[slots.PAC_SLOT].astype(int) - still[slots.PAC_SLOT]).max() > 500
    middle = [slot for slot in slots.ELECTRODE_SLOT if 15 <= slot <= 25]
    assert np.abs(struck[middle].astype(int) - still[middle]).max() > 30


def test_several_contacts_add_as_in_the_model() -> None:
    both = (SimTouch(2.0, at="E17"), SimTouch(1.0, at="E1"))
    parts = [touch.states(touched)[0] for touched in both]
    finger = SimFinger(4)
    deformed = [finger.deformation(part) for part in parts]
    expected = finger.counts_of(deformed[0][0] + deformed[1][0], deformed[0][1] + deformed[1][1], np.zeros(1))[0]
    sampler = Sampler(finger)
    mean = np.mean([sampler.step(*touch.states(both)) for _ in range(100)], axis=0)[slots.ELECTRODE_SLOT]
    assert np.abs(mean - expected).max() < 5.0 + np.abs(expected - finger.rest_counts(np.zeros(1))[0]).max() * 0.06


@pytest.mark.parametrize(
    "wrong",
    [{"normal_n": -1.0}, {"normal_n": np.nan}, {"normal_n": "2"}, {"normal_n": True}, {"at": "E20"}, {"at": (9, 9)},
     {"at": 5}, {"at": (1, "2")}, {"shear_n": (30, 0)}, {"shear_n": (0.0, np.nan)}, {"shear_n": 1.0},
     {"shear_n": (1,)}],
)  # fmt: skip
def test_a_touch_that_cannot_be_is_refused_in_words(wrong: dict[str, Any]) -> None:
    with pytest.raises(InputError, match=r"SimTouch: .*expected"):
        SimTouch(**wrong)


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_the_same_however_its_rounds_are_cut(name: str) -> None:
    words = sample(SimFinger(1), all_states([pressed(k) for k in range(121)]))
    other = sample(SimFinger(2), all_states([SimTouch(1.0)] * 121))
    rest = SimFinger(1).rest_counts(np.zeros(1))[0]
    faulty = [Faulty(16, rest, rest, np.random.default_rng(5)) for _ in range(2)]
    whole = FAULTS[name](faulty[0], words, other)
    cut = [FAULTS[name](faulty[1], words[k : k + 1], other[k : k + 1]) for k in range(len(words))]
    np.testing.assert_array_equal(np.concatenate(cut), whole)
    assert (whole != words).any()


# ---- lock-step -----------------------------------------------------------------------------------------


def course(fingers: int, rounds: int) -> tuple[bytes, list[Any], list[int]]:
    """All bytes that a board of so many fingers sends in so many rounds, the events, and the seq of each step."""
    names = [f"f{k}" for k in range(fingers)]
    with world({name: SimFinger(k + 1) for k, name in enumerate(names)}, settings=LIN) as w:
        received = bytearray()
        tap = type("Tap", (), {"put": lambda *_: None, "wake": lambda *_: None, "is_full": lambda *_: False})()
        tap.put_raw = lambda chunk, batch: received.extend(chunk)
        w.hand.add(tap)
        nows = [
            w.step(**{name: pressed(k + 7 * n) if k > 150 else None for n, name in enumerate(names)})
            for k in range(rounds)
        ]
    events = [(event.t_us, event.kind, event.finger) for now in nows for event in now.events]
    return bytes(received), events, [now.seq for now in nows]


@pytest.mark.parametrize(
    ("fingers", "rounds"), [(2, 400), pytest.param(5, 10_000, marks=pytest.mark.nightly, id="five fingers")]
)
def test_the_same_loads_give_the_same_bytes_and_each_step_gives_one_round(fingers: int, rounds: int) -> None:
    first, second = course(fingers, rounds), course(fingers, rounds)
    assert first == second
    assert first[2] == list(range(1, rounds + 1))
    assert any(kind == EventKind.TOUCH for _, kind, _ in first[1])


def test_a_controller_closes_its_loop(biotac_world: Callable[..., Any]) -> None:
    """Steps by the force felt, at half the board's rate: the program hears of every event, and ends where it wants."""
    w = biotac_world(index=1)
    w.run(REST_S)
    press, events = 0.0, []
    for _ in range(300):
        now = w.run(0.02, index=SimTouch(press))
        events += now.events
        press = min(max(press + 0.05 * (2.0 - now["index"].frame.force_n[2]), 0.0), 20.0)
    assert abs(now["index"].frame.force_n[2] - 2.0) < 0.3
    assert [event.kind for event in events].count(EventKind.TOUCH) == 1


def test_what_a_program_gets_wrong_costs_no_time(biotac_world: Callable[..., Any]) -> None:
    w = biotac_world(index=1)
    with pytest.raises(KeyError, match="no finger 'thumb', expected one of index"):
        w.step(thumb=SimTouch(1.0))
    with pytest.raises(InputError, match="no fault 'loose'"):
        w.fault("index", "loose")
    with pytest.raises(InputError, match="channel is 'E77'"):
        w.fault("index", "unplugged", channel="E77")
    for load in (2.0, ["E17"], Course([Course([SimTouch()])]), [SimTouch(celsius=20.0), SimTouch()]):
        with pytest.raises(InputError, match=r"a load has .*expected"):
            w.step(index=load)
    for act in (w.run, w.unplug, w.hang, w.stall_host, w.cut_power, lambda s: w.restart(boot_s=s)):
        for seconds in (0, -1.0, np.nan, np.inf):
            with pytest.raises(InputError, match=r"seconds is .*expected a number above 0"):
                act(seconds)
    assert w.step().seq == 1 and w.hand.connected
    with pytest.raises(InputError, match="expected 1 to 5"):
        LiveFingers({str(k): SimFinger(k) for k in range(6)})


@pytest.mark.parametrize(
    "wrong",
    [{"settings": {"nope": 1}}, {"maps": {"thumb": b""}}, {"settings": LIN, "hand": False}, {"fingers": {"index": 1}}],
)
def test_a_world_that_cannot_be_starts_no_board(wrong: dict[str, Any]) -> None:
    before = {*threading.enumerate()}
    with pytest.raises(InputError):
        world(**{"fingers": {"index": SimFinger(1)}} | wrong)
    assert {*threading.enumerate()} <= before
    for seed, profile in ((-1, "new"), (1.5, "new"), (2**31, "new"), (1, "wron")):
        with pytest.raises(InputError, match=r"a finger's .*expected"):
            SimFinger(seed, profile)


def test_what_needs_an_open_hand_is_refused_at_once_without_one() -> None:
    without, closed = world({"index": SimFinger(1)}, hand=False), world({"index": SimFinger(1)})
    for w in (without, closed):
        w.close()
        for act in (w.restart, w.hang, lambda w=w: w.unplug(1.0), lambda w=w: w.stall_host(1.0)):
            with pytest.raises(InputError, match=r"needs a hand|was closed"):
                act()


def test_a_second_thread_that_steps_is_refused(biotac_world: Callable[..., Any]) -> None:
    w, refused = biotac_world(index=1), []

    def steps() -> None:
        while not refused:
            try:
                w.step()
            except InputError as error:
                refused.append(str(error))

    with ThreadPoolExecutor(2) as pool:
        list(pool.map(lambda _: steps(), range(2)))
    assert all("another thread" in text for text in refused) and w.step().seq > 0


# ---- faults ------------------------------------------------------------------------------------------


def test_faults_begin_and_end(biotac_world: Callable[..., Any]) -> None:
    w = biotac_world(index=1, thumb=2)
    w.run(REST_S)
    w.fault("index", "open", channel="E3")
    now = w.run(0.3)
    assert now["index"].frame.counts[2] == 4095 and now["thumb"].frame.counts[2] < 4090
    w.fault("index", "unplugged")
    assert w.run(0.3)["index"].frame is None
    w.fault("index", None)
    now = w.run(0.5)
    assert now["index"].frame.counts[2] < 4090 and now["thumb"].frame is not None


def test_exchanged_fingers_have_each_others_words(biotac_world: Callable[..., Any]) -> None:
    w, alone = biotac_world(index=1, thumb=2, little=3), biotac_world(index=1)
    before = w.run(0.5)
    w.fault("index", "two fingers exchanged")
    now = w.run(0.5)
    w.fault("thumb", None)
    after = w.run(0.5)
    for name, then in (("index", "thumb"), ("thumb", "index"), ("little", "little")):
        is_of = [np.abs(now[name].frame.counts - before[k].frame.counts.astype(int)).mean() < 20 for k in (then, name)]
        assert is_of == [True, name == then]
        assert np.abs(after[name].frame.counts - before[name].frame.counts.astype(int)).mean() < 20
    with pytest.raises(InputError, match=r"needs a second finger, and there is only 'index'"):
        alone.fault("index", "cross-talk of 30 % between fingers")


@pytest.mark.parametrize("first", ["hang", "restart"])
def test_a_cable_that_comes_out_of_a_dead_board_comes_back(first: str, biotac_world: Callable[..., Any]) -> None:
    w = biotac_world(index=1)
    w.run(0.5)
    getattr(w, first)()
    w.unplug(1.0)
    assert w.run(4.0)["index"].frame is not None


def test_a_run_counts_all_rounds_that_were_missed(biotac_world: Callable[..., Any]) -> None:
    steps, runs = biotac_world(index=1), biotac_world(index=1)
    for w in (steps, runs):
        w.run(1.0)
        w.unplug(0.3)
    assert runs.run(1.5).missed == sum(steps.step().missed for _ in range(150)) >= 29


def test_a_board_that_restarts_hangs_or_loses_its_cable_comes_back(biotac_world: Callable[..., Any]) -> None:
    w = biotac_world(index=1)
    w.run(1.0)
    t_us, boots = w.step().t_us, {w.hand.info.boot_id}
    w.unplug(0.3)
    assert [w.step().seq for _ in range(29)] == [-1] * 29 and not w.hand.connected
    now = w.run(0.02)
    assert now.t_us == t_us + 310_000 and w.hand.connected  # it went on
    for fail, silent in ((w.restart, 50), (w.hang, 250), (lambda: w.cut_power(0.2), 70)):
        fail()
        rounds = [w.step() for _ in range(silent + 2)]
        assert [now.seq for now in rounds[: silent - 1]] == [-1] * (silent - 1) and rounds[-1].seq > 0
        boots.add(w.hand.info.boot_id)
    assert len(boots) == 4
    w.hand.board.restart()
    w.step()
    assert w.step().seq >= 0 and w.hand.info.boot_id not in boots


def test_settings_survive_a_restart_as_the_library_promises(biotac_world: Callable[..., Any]) -> None:
    w = biotac_world({"settings": LIN}, index=1)
    w.run(REST_S)
    before = w.run(0.3, index=SimTouch(3.0))["index"].frame.force_n
    w.run(REST_S)
    w.restart()
    w.run(REST_S + 1)
    after = w.run(0.3, index=SimTouch(3.0))["index"].frame
    assert not after.flags & FrameFlags.MAPPED
    np.testing.assert_allclose(after.force_n, before, atol=0.15)


def test_a_program_that_stands_still_gets_every_event_afterwards(biotac_world: Callable[..., Any]) -> None:
    w = biotac_world(index=1)
    w.run(REST_S)
    w.stall_host(0.5)
    assert all(w.step(index=SimTouch(2.0)).seq == -1 for _ in range(50))
    now = w.step(index=SimTouch(2.0))
    assert now.missed == 50 and EventKind.TOUCH in [event.kind for event in now.events]


def test_a_hold_outlasts_a_cable_that_is_out_for_less_than_its_timeout() -> None:
    with world({"index": SimFinger(1)}) as hand:
        hand.hand.hold("index")
        hand.run(3.0)  # in which this side said nothing
        hand.unplug(1.0)
        hand.run(3.0)
        assert hand.step()["index"].frame.flags & FrameFlags.HELD


# ---- rounds of any hand --------------------------------------------------------------------------------


def test_the_next_round_has_all_fingers_of_one_time_and_every_event_once() -> None:
    with biotac.open("sim:grasp.toml?fingers=3&pace=4&seconds=120") as hand:
        hand.stream("results", "events")
        kinds, now = [], None
        for _ in range(300):
            now = hand.next_round(now, timeout_s=WAIT_S)
            assert {now[name].frame.t_us for name in hand if now[name].frame} == {now.t_us}
            assert len([name for name in hand if now[name].frame]) == 3
            kinds += [(event.kind, event.finger, event.t_us) for event in now.events]
    assert len(kinds) == len(set(kinds))


def test_no_next_round_comes_from_a_source_that_ended() -> None:
    with biotac.open("sim:press.toml?seconds=0.05") as hand:
        hand.next_round(timeout_s=WAIT_S)
        with pytest.raises(TimeoutError, match=r"no new round in 0\.2 s"):
            while True:
                hand.next_round(timeout_s=0.2)
