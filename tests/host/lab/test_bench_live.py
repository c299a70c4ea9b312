"""biotac bench live: everything that is offered is accounted for. Times are not looked at."""

from __future__ import annotations

import json
import os

import numpy as np
import pytest

from biotac.cli.main import main
from biotac.lab.bench import flood, live
from biotac.wire import messages_gen as wire
from biotac.wire.decoder import Decoder
from biotac.wire.dtypes_gen import DTYPES
from biotac.wire.framing import encode


def test_the_flood_is_good_frames_of_five_fingers() -> None:
    decoded = Decoder().feed(b"".join(flood.frames(50)))
    assert decoded.frames["finger"].tolist() == [0, 1, 2, 3, 4] * 10
    assert decoded.frames["seq"].tolist() == np.repeat(np.arange(10), 5).tolist()
    assert (decoded.frames["tare_q4"] == decoded.frames["counts"] * 16).all()
    assert DTYPES[wire.Frame.ID].itemsize > 100


def test_both_readers_get_what_the_slow_board_sends() -> None:
    outcome = live.measure(rates=(500,), rounds=1, seconds=0.4)
    assert [row.name for row in outcome.rows] == [live.OURS, live.PYSERIAL]
    for row in outcome.rows:
        assert row.loss == 0
        assert row.median_us > 0 and row.cpu_percent > 0
    assert live.asked(outcome)


def test_what_was_asked_is_judged() -> None:
    rows = [live.Row(50_000, live.OURS, 0.002, 0.003, 99.0, 200.0, 10.0)]
    judged = live.asked(live.Outcome(rows, {50_000: 0.61}, 1, 1.0))
    assert [one.met for one in judged] == [False, True, False]


def test_the_command_prints_a_verdict_for_each_figure(monkeypatch, capsys) -> None:
    rows = [live.Row(5_000, name, 0.0, 0.0, 50.0, 90.0, 10.0) for name in (live.OURS, live.PYSERIAL)]
    monkeypatch.setattr(live, "measure", lambda rounds: live.Outcome(rows, {5_000: 1.0}, rounds, 2.0))
    assert main(["bench", "live", "--rounds", "2"]) == 0
    text = capsys.readouterr().out
    assert text.count("(target") == text.count("met)") == 2
    assert main(["bench", "live", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["rounds"] == 5


def test_without_cobs_it_says_what_to_install(monkeypatch) -> None:
    monkeypatch.setitem(__import__("sys").modules, "cobs", None)
    with pytest.raises(live.InputError, match="biotac-gateway"):
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
