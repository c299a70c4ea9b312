"""What a force is good for: link.toml is the truth, and the board, the library and its events say the same."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import tomllib

import biotac
from biotac import EventKind, Trust
from biotac.core.compiled import trust_of
from biotac.wire import messages_gen as wire
from biotac.wire.native import lib

LINK = tomllib.loads((Path(__file__).resolve().parents[3] / "protocol/link.toml").read_text(encoding="utf-8"))
FLAGS = {name: flag for name, flag in LINK["flags"]["frame"].items() if name != "doc"}
UNKNOWN, RISE_ROUNDS = wire.INVALID_COUNT, 10


def levels(flags: int) -> set[Trust]:
    return {Trust[flag.get("trust", "ACT")] for flag in FLAGS.values() if flags >> flag["bit"] & 1} or {Trust.ACT}


def test_trust_is_the_lowest_that_a_flag_allows() -> None:
    rng = np.random.default_rng(1)
    bits = np.array([flag["bit"] for flag in FLAGS.values()], np.uint32)
    some = [(1 << bits[rng.random(len(bits)) < share]).sum() for share in (0.03, 0.1, 0.3) for _ in range(200)]
    flags = np.array([0, *(1 << bits), *some], np.uint32)
    wanted = [min(levels(int(value))) for value in flags]
    assert {*wanted} == {*Trust}
    assert [lib.bt_trust(int(value), 0, UNKNOWN) for value in flags] == wanted
    force = np.zeros((len(flags), 3), np.int32)
    assert trust_of(flags, force).tolist() == wanted
    force[:, 2] = wire.INVALID_I32
    assert (trust_of(flags, force) == Trust.NONE).all()


@pytest.mark.parametrize(
    ("force_mn", "half_mn", "wanted"),
    [(0, 400, Trust.ACT), (0, 401, Trust.INTERVAL), (1600, 401, Trust.INTERVAL), (1608, 402, Trust.ACT),
     (4000, 1000, Trust.ACT), (4000, 1001, Trust.INTERVAL), (65534, 65534, Trust.INTERVAL)],
)  # fmt: skip
def test_a_wide_interval_is_to_be_kept_in_mind(force_mn: int, half_mn: int, wanted: Trust) -> None:
    assert lib.bt_trust(0, force_mn, half_mn) == wanted
    for flag in FLAGS.values():
        assert lib.bt_trust(1 << flag["bit"], force_mn, half_mn) == min(wanted, *levels(1 << flag["bit"]))


def test_events_tell_falls_at_once_and_rises_that_last() -> None:
    with biotac.open("sim:press.toml") as hand:
        hand.stream("results", "events")
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
    assert [(event.t_us, event.trust) for event in events] == wanted and len({trust for _, trust in wanted}) > 1


def test_a_frame_says_why() -> None:
    with biotac.open("sim:press.toml?seconds=3") as hand:
        frame = biotac.Frame.from_row(hand.read_batch(0.5).frames[-1])
    assert frame.trust == Trust.HOLD and frame.reasons == biotac.FrameFlags.TARE_UNSURE
