"""The uses that a force is good for: link.toml is the truth; the board, the library and the events agree with it."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import biotac
from biotac import EventKind, FrameFlags, Trust
from biotac.documents import tomllib
from biotac.kernels.compiled import trust_of
from biotac.sim import physics, sampling
from biotac.sim.timeline import Pose, Track
from biotac.wire import messages_gen as wire
from biotac.wire import slots
from biotac.wire.native import lib

LINK = tomllib.loads((Path(__file__).resolve().parents[3] / "protocol/link.toml").read_text(encoding="utf-8"))
FLAGS = {name: flag for name, flag in LINK["flags"]["frame"].items() if name != "doc"}
RISE_ROUNDS = 10


def levels(flags: int) -> set[Trust]:
    return {Trust[flag.get("trust", "ACT")] for flag in FLAGS.values() if flags >> flag["bit"] & 1} or {Trust.ACT}


def test_trust_is_the_lowest_that_a_flag_allows() -> None:
    rng = np.random.default_rng(1)
    bits = np.array([flag["bit"] for flag in FLAGS.values()], np.uint32)
    some = [(1 << bits[rng.random(len(bits)) < share]).sum() for share in (0.03, 0.1, 0.3) for _ in range(200)]
    flags = np.array([0, *(1 << bits), *some], np.uint32)
    wanted = [min(levels(int(value))) for value in flags]
    assert {*wanted} == {*Trust}
    assert [lib.bt_trust(int(value), 0, 0) for value in flags] == wanted
    frames = np.zeros(
        len(flags), [("flags", "u4"), ("normal_mn", "u2"), ("normal_half_mn", "u2"), ("force_100un", "i4", 3)]
    )
    frames["flags"] = flags
    assert trust_of(frames).tolist() == wanted
    frames["force_100un"][:, 2] = wire.INVALID_I32
    assert (trust_of(frames) == Trust.NONE).all()


@pytest.mark.parametrize(
    ("force_mn", "half_mn", "wanted"),
    [(0, 400, Trust.ACT), (0, 401, Trust.INTERVAL), (1600, 401, Trust.INTERVAL), (1608, 402, Trust.ACT),
     (4000, 1000, Trust.ACT), (4000, 1001, Trust.INTERVAL), (65534, 65534, Trust.INTERVAL),
     (4000, wire.INVALID_COUNT, Trust.INTERVAL)],
)  # fmt: skip
def test_a_wide_interval_is_to_be_kept_in_mind(force_mn: int, half_mn: int, wanted: Trust) -> None:
    assert lib.bt_trust(0, force_mn, half_mn) == wanted
    for flag in FLAGS.values():
        assert lib.bt_trust(1 << flag["bit"], force_mn, half_mn) == min(wanted, *levels(1 << flag["bit"]))


@pytest.mark.parametrize("finger", [0, 1])
def test_events_tell_falls_at_once_and_rises_that_last(finger: int) -> None:
    with biotac.open("sim:press.toml?fingers=2") as hand:
        hand.stream("results", "events", fingers=[finger])
        frames, events = [], []
        for batch in hand.batches():
            frames += [(int(row["t_us"]), Trust(row["trust"])) for row in batch.frames]
            events += [m for m in batch.messages if isinstance(m, biotac.Event) and m.kind == EventKind.TRUST]
    reported, higher, wanted = frames[0][1], 0, []
    for t_us, trust in frames:
        higher = higher + 1 if trust > reported else 0
        if trust < reported or higher >= RISE_ROUNDS:
            reported, higher = trust, 0
            wanted.append((t_us + 43 * 1_000_000 // 4400, trust))
    assert {event.finger for event in events} == {finger}
    assert [(event.t_us, event.trust) for event in events] == wanted and len({trust for _, trust in wanted}) > 1


def test_a_frame_says_why() -> None:
    with biotac.open("sim:press.toml?seconds=3") as hand:
        frame = biotac.Frame.from_row(hand.read_batch(0.5).frames[-1])
    assert frame.trust == Trust.HOLD and frame.reasons == biotac.FrameFlags.TARE_UNSURE


@pytest.fixture(scope="module")
def gripped() -> tuple[biotac.Finger, np.ndarray, Callable[[biotac.Finger, int, int], np.ndarray]]:
    """A tare that a release confirmed, and the feed of a finger that is gripped with 4 N from round 800 on."""
    track = Track()
    track.pose = free = Pose(-2.8, 0.0, tip_mm=2.0)
    for seconds, force_n in ((5, 0), (0.2, 2), (0.3, 2), (0.2, 0), (2, 0), (0.3, 4), (40, 4), (0.3, 0), (4, 0)):
        track.ramp(seconds, replace(free, force_n=force_n))
    words = sampling.sample(physics.SimFinger(3, "new"), track.states(np.arange(5231) * 0.01))

    def feed(finger: biotac.Finger, first: int, end: int) -> np.ndarray:
        part = words[first:end]
        return finger.feed(
            part[:, slots.ELECTRODE_SLOT],
            part[:, slots.PDC_SLOT],
            tdc=part[:, slots.TDC_SLOT],
            pac=part[:, slots.PAC_SLOT],
        )

    finger = biotac.Finger()
    rows = feed(finger, 0, 760)
    assert not rows["flags"][-1] & (FrameFlags.TARE_UNSURE | FrameFlags.TARE_LIKELY)
    return finger, rows[-1], feed


@pytest.mark.parametrize("held", [False, True])
def test_a_tare_in_a_hold_is_not_acted_on(gripped: Any, held: bool) -> None:
    _, _, feed = gripped
    finger = biotac.Finger()
    feed(finger, 0, 800)
    if held:
        finger.hold()
    feed(finger, 800, 2300)
    finger.tare_now()
    assert set(feed(finger, 2300, 4800)["trust"]) == {Trust.HOLD}
    assert (feed(finger, 4800, 5230)["trust"] <= Trust.HOLD).all()  # let go: the tare is lost, or still unsure


NONSENSE = {
    "all zero": lambda tare, pdc: (0 * tare, pdc),
    "all zero, pressure too": lambda tare, pdc: (0 * tare, 0.0),
    "100 counts up at rest": lambda tare, pdc: (tare + 100, pdc),
    "pressure zero": lambda tare, pdc: (tare, 0.0),
}


@pytest.mark.parametrize("first", [750, 1500])
@pytest.mark.parametrize("name", [*NONSENSE, "right"])
def test_a_given_tare_is_worth_what_the_reading_allows(gripped: Any, name: str, first: int) -> None:
    _, row, feed = gripped
    finger = biotac.Finger()
    feed(finger, 0, first)
    tare, pdc = NONSENSE.get(name, lambda *both: both)(row["tare_q4"] / 16, float(row["pdc_tare_q4"]) / 16)
    finger.set_tare(tare, pdc, age_s=1.0)
    rows = feed(finger, first, first + 30)
    assert rows["trust"][0] == Trust.HOLD  # until a sweep has been compared
    gripped_with_offset = name in ("100 counts up at rest", "pressure zero") and first == 1500
    if not gripped_with_offset:  # which reads as a harder press
        assert rows["trust"][-1] == (Trust.INTERVAL if name == "right" else Trust.HOLD)


def test_an_old_tare_of_a_grip_is_not_acted_on(gripped: Any) -> None:
    _, row, feed = gripped
    for age_s, wanted in ((600.0, Trust.INTERVAL), (601.0, Trust.HOLD), (None, Trust.HOLD)):
        finger = biotac.Finger()
        feed(finger, 1400, 1500)  # it started in the grip
        finger.set_tare(row["tare_q4"] / 16, float(row["pdc_tare_q4"]) / 16, age_s=age_s)
        rows = feed(finger, 1500, 1550)
        assert rows["trust"][-1] == wanted
        assert np.linalg.norm(rows["force_100un"][-1]) > 5000  # the grip's, not zero
