"""The same live loads on the emulated Pico as on a board in this process, and on a sensor board wired to a gateway."""

from collections.abc import Iterator
from contextlib import closing

import numpy as np
import pytest
from live_board import until

from biotac.hand.rounds import Round
from biotac.sim import SimFinger, SimTouch, world
from biotac.wire.sensor_gen import SLOTS
from biotac_rig.two_picos import TwoPicos
from biotac_rig.wired import wired_world

FINGERS = {"index": SimFinger(1), "thumb": SimFinger(2, "worn")}
SETTINGS = {"force_model": 0}


def frames(board: str, rounds: int) -> list[np.ndarray]:
    """All that the FRAMEs of so many rounds say, but for t_us."""
    rows = []
    with world(FINGERS, settings=SETTINGS, board=board) as w:
        for k in range(rounds):
            now = w.step(index=SimTouch(min(max(k - 30, 0) * 0.05, 3.0)), thumb=SimTouch(1.0 * (k > 40), (0.2, -0.3)))
            for name in FINGERS:
                frame = now[name].frame
                assert frame is not None
                rest = frame.seq, int(frame.flags), frame.pdc, frame.tac, frame.tdc, frame.pdc_filtered
                rows.append(np.concatenate([frame.counts, frame.force_n, frame.torque_nmm, frame.poc_mm, rest]))
    return rows


@pytest.mark.usefixtures("emulated_pico")
@pytest.mark.parametrize("rounds", [60, pytest.param(1000, marks=pytest.mark.nightly)])
def test_the_emulated_pico_computes_what_the_board_in_this_process_computes(rounds: int) -> None:
    np.testing.assert_array_equal(frames("pico", rounds), frames("sim", rounds))


def pressure(now: Round, finger: str) -> float:
    frame = now[finger].frame
    assert frame is not None
    return frame.pdc


@pytest.fixture
def pair(two_picos: None) -> Iterator[TwoPicos]:
    with closing(TwoPicos(None, pace=0.0, hold=False)) as board:
        yield board


@pytest.mark.nightly
def test_two_wired_boards_are_loaded_ahead_and_late_rounds_are_counted(pair: TwoPicos) -> None:
    """The number of late ones depends on this computer's speed; that it rises while nobody steps does not."""
    with wired_world(FINGERS, port=pair.path, sensor_port=pair.sensor_path, ahead=4) as w:
        assert w.sensors.status().slots_taken == 4 * len(SLOTS)
        untouched, first = w.step(), 1
        while any(untouched[name].frame is None for name in FINGERS):
            untouched, first = w.step(), first + 1  # the gateway finds sensors one after the other
        for _ in range(300):
            now = w.step(index=SimTouch(2.0))
        assert w.sensors.status().slots_taken == (4 + first + 300) * len(SLOTS)
        rise = {name: pressure(now, name) - pressure(untouched, name) for name in FINGERS}
        assert rise["index"] > 100 and abs(rise["thumb"]) < 20
        late = w.rounds_late
        until(lambda: w.rounds_late > late)
