"""biotac-lab bench live: everything that is offered is accounted for. Times are not looked at."""

from __future__ import annotations

import os

import numpy as np
import pytest

from biotac.wire import messages_gen as wire
from biotac.wire.decoder import Decoder
from biotac.wire.dtypes_gen import DTYPES
from biotac.wire.framing import encode
from biotac_lab.bench import flood, live


def test_the_flood_is_good_frames_of_five_fingers() -> None:
    decoded = Decoder().feed(b"".join(flood.frames(50)))
    assert decoded.frames["finger"].tolist() == [0, 1, 2, 3, 4] * 10
    assert decoded.frames["seq"].tolist() == np.repeat(np.arange(10), 5).tolist()
    assert (decoded.frames["tare_q4"] == decoded.frames["counts"] * 16).all()
    assert DTYPES[wire.Frame.ID].itemsize > 100


def test_both_readers_get_what_the_slow_board_sends() -> None:
    live_path, asked = live.measure(rates=(500,), rounds=1, seconds=0.4)
    assert [row[1] for row in live_path.rows] == [live.OURS, live.PYSERIAL]
    for row in live_path.rows:
        assert row[2] == 0, "loss"
        assert row[4] > 0 and row[6] > 0
    assert asked.rows


def test_what_was_asked_is_judged() -> None:
    taken = {(50_000, live.OURS): [live.Round(0.002, 99.0, 200.0, 61.0)],
             (50_000, live.PYSERIAL): [live.Round(0.0, 50.0, 90.0, 100.0)]}  # fmt: skip
    assert [row[3] for row in live.report(taken, 1.0)[1].rows] == ["NOT met", "met", "NOT met"]


def test_without_cobs_it_says_what_to_install(monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "cobs", None)
    with pytest.raises(live.InputError, match="biotac-lab"):
        live.measure()


def test_answers_wait_their_turn_behind_a_frame_that_is_half_sent() -> None:
    near, far = os.pipe()
    board = flood.Board.__new__(flood.Board)
    board._master, board._decoder = near, Decoder()
    os.write(far, encode(wire.Ping.ID, wire.Ping(9).pack()))
    half = flood.frames(1)[0][50:]
    ring = bytearray(half)
    assert board.serve(ring) is False
    os.close(near)
    os.close(far)
    assert ring == half + encode(wire.Reply.ID, wire.Reply(9, wire.Ping.ID, 0).pack())
