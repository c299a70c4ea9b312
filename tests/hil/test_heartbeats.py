"""An untouched finger without subscribed frames sends heartbeats, and every other message stays the same."""

from pathlib import Path

import numpy as np
import pytest
from core_in_units import on_board

from biotac.map import published_parts
from biotac.wire import messages_gen as wire
from biotac.wire.sensor_gen import SLOTS

TOUCHED_TWICE = """
name = "touched twice"
seed = 3
fingers = 2
step = [
    {do = "rest", seconds = 1.5},
    {do = "press", seconds = 0.4, at = "E17", force_n = 3.0},
    {do = "press", seconds = 0.2, force_n = 0.0},
    {do = "rest", seconds = 1.5},
    {do = "press", seconds = 0.2, at = "E10", force_n = 2.0},
]
"""
EVERYTHING = ("poc", "force", "torque")


@pytest.fixture
def play(board, tmp_path: Path):
    """Stream names of the scenario; returns the batch, the link's statistics and the board's status."""

    def run(*names: str, rest: bool = False):
        path = tmp_path / "case.toml"
        path.write_text(TOUCHED_TWICE)
        hand = board(str(path))
        hand.board.set_setting(wire.Setting.FORCE_MODEL, wire.ForceModel.LIN)
        hand.stream(*names, rest=rest)
        batch = hand.read_batch(100)
        return batch, hand.stats, hand.status()

    return run


def test_heartbeats_stand_for_the_frames_that_are_not_sent_and_no_value_changes(play) -> None:
    eager, eager_stats, _ = play(*EVERYTHING, rest=True)
    lazy, lazy_stats, status = play(*EVERYTHING)
    assert (eager_stats.frames_lost, lazy_stats.frames_lost, lazy_stats.disordered) == (0, 0, 0)
    assert len(eager.idle) == 0
    assert int(lazy.idle["frames"].sum()) == status.frames_idle == len(eager.frames) - len(lazy.frames)
    assert 0.2 < len(lazy.frames) / len(eager.frames) < 0.8  # presses and rest are about even
    keep = np.isin(eager.wire[["finger", "seq"]], lazy.wire[["finger", "seq"]])
    assert eager.wire[keep].tobytes() == lazy.wire.tobytes()
    # Every touched round is there.
    touched = eager.wire["tare_state"] == wire.TareState.CONTACT
    assert keep[touched].all()
    # Ten heartbeats a second of rest, a closing one before each touch.
    for finger in (0, 1):
        spans = lazy.idle["frames"][lazy.idle["finger"] == finger]
        assert spans.max() == 10
        assert np.count_nonzero(spans < 10) <= 8


def test_what_nobody_asked_for_is_marked_and_counted(play) -> None:
    full, _, _ = play(*EVERYTHING)
    force, stats, status = play("force")
    assert stats.frames_lost == 0
    assert np.isnan(force.frames["poc_mm"]).all()
    assert np.isnan(force.frames["torque_nmm"]).all()
    assert (force.frames["flags"] & wire.FrameFlags.NOT_ASKED != 0).all()
    assert force.wire["force_100un"].tobytes() == full.wire["force_100un"].tobytes()
    sent = len(force.frames)
    assert status.force_skipped == status.frames_idle
    assert status.poc_skipped == status.torque_skipped == status.frames_idle + sent


def test_normal_and_shear_come_with_their_intervals(play) -> None:
    batch, _, _ = play(*EVERYTHING, rest=True)
    rows = batch.frames[batch.wire["tare_state"] == wire.TareState.CONTACT]
    parts = published_parts(rows["force_n"], rows["poc_mm"])
    np.testing.assert_allclose(rows["normal_n"], parts[:, 0], rtol=0, atol=0.005)
    np.testing.assert_allclose(rows["shear_n"], parts[:, 1], rtol=0, atol=0.01)
    assert (rows["normal_half_n"] > 0).all() and (rows["shear_half_n"] > 0).all()


def test_a_point_inside_a_round_is_that_of_the_words_that_have_come(board, tmp_path: Path) -> None:
    path = tmp_path / "case.toml"
    path.write_text(TOUCHED_TWICE)
    hand = board(str(path))
    first = hand.read_batch(1.25).wire  # the board, which waits only for full buffers, is in the first press by then
    point = hand.point(0)
    sent = np.concatenate([first, hand.read_batch(100).wire])
    sent = sent[sent["finger"] == 0]
    before = sent[sent["seq"] == point.seq - 1][0]
    under_way = sent[sent["seq"] == point.seq][0]
    come = np.array([SLOTS.index(f"E{k}") for k in range(1, 20)]) < point.slot
    counts = np.where(come, under_way["counts"], before["counts"])
    board_computes = on_board(counts[None], before["tare_q4"] / 16.0, hand.board.settings())
    assert np.array_equal(board_computes.poc_mm[0], np.array(point.poc_um) / 1000)
