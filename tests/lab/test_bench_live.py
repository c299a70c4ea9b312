"""biotac-lab bench live: every frame offered is accounted for. Times are not looked at."""

import numpy as np

from biotac.wire import messages_gen as wire
from biotac.wire.decoder import Decoder
from biotac.wire.dtypes_gen import DTYPES
from biotac_lab.bench import flood, live


def test_the_flood_is_good_frames_of_five_fingers() -> None:
    decoded = Decoder().feed(b"".join(flood.frames(50)))
    assert decoded.frames["finger"].tolist() == [0, 1, 2, 3, 4] * 10
    assert decoded.frames["seq"].tolist() == np.repeat(np.arange(10), 5).tolist()
    assert (decoded.frames["tare_q4"] == decoded.frames["counts"] * 16).all()
    assert DTYPES[wire.FrameMessage.ID].itemsize > 100


def test_both_readers_get_what_the_slow_board_sends() -> None:
    live_path, asked = live.measure(rates=(500,), rounds=1, seconds=0.08)  # the ring's content
    assert [row[1] for row in live_path.rows] == [live.OURS, live.PYSERIAL]
    for row in live_path.rows:
        assert row[1] == live.PYSERIAL or row[2] == 0, "loss"  # a busy computer's pyserial is late for the last ones
        assert not row[4] <= 0 and row[6] > 0
    assert asked.rows


def test_what_was_asked_is_judged() -> None:
    rounds = {(50_000, live.OURS): [live.Round(0.002, 99.0, 200.0, 61.0)],
             (50_000, live.PYSERIAL): [live.Round(0.0, 50.0, 90.0, 100.0)]}  # fmt: skip
    assert [row[3] for row in live.report(rounds, 1.0)[1].rows] == ["NOT met", "met", "NOT met"]
