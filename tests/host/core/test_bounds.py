"""An electrode that a narrow tip presses to the end of the range: a count of 0 or 1 is a bound, and holds still."""

import numpy as np
import pytest
from paper_finger import PaperFinger

from biotac import Finger, FrameFlags
from biotac.kernels.geometry import ELECTRODE_MM, Floats, on_surface
from biotac.sim.physics import States
from biotac.wire import messages_gen as wire

RUNGS = np.r_[np.zeros(200), np.linspace(0.0, 1.0, 100), np.ones(200)]  # of the force: at rest, pressed, held
HELD = slice(320, None)


def held(profile: str, at: int, force_n: float, dithers: int, lin: bool, opens: bool = False) -> np.ndarray:
    """The board's rows while a tip presses an electrode to a count of 1, and a count dithers."""
    sensor, n = PaperFinger(1, profile), len(RUNGS)  # type: ignore[arg-type]
    place: Floats = np.tile(on_surface(ELECTRODE_MM[[at]]), (n, 1))
    states = States(place, RUNGS * force_n, np.zeros((n, 3)), np.zeros(n), np.ones(n), np.zeros(n))
    rng, counts = np.random.default_rng(at), sensor.counts(states)
    counts[200:300] += rng.integers(0, 2, (100, 19))  # while the skin moves no word repeats
    counts[:, at] = counts[0, at] ** (1.0 - RUNGS)
    swing = rng.integers(-1, 2, n) if dithers == at else rng.integers(0, 2, n)
    counts[:, dithers] += np.where(RUNGS > 0.8, swing, 0)
    if opens:
        counts[250:, at] = 0.0  # from mid range, where the lead breaks
    settings = {wire.Setting.FORCE_MODEL: int(wire.ForceModel.LIN)} if lin else {}
    pdc = np.minimum(sensor.pdc_rest + 100.0 * RUNGS * force_n, 4095.0).round().astype(np.uint16)
    return Finger(settings).feed(np.clip(np.rint(counts), 0, 4095).astype(np.uint16), pdc)


def jumps(rows: np.ndarray) -> Floats:
    """The largest from frame to frame, in mm and N."""
    steps = [np.diff(rows[name][HELD] / unit, axis=0) for name, unit in (("poc_um", 1e3), ("force_100un", 1e4))]
    return np.array([np.linalg.norm(step, axis=1).max() for step in steps])


@pytest.mark.parametrize("lin", [False, True], ids=["default", "lin"])
@pytest.mark.parametrize("profile", ["new", "worn"])
def test_a_count_that_dithers_at_the_end_of_its_range_moves_nothing(profile: str, lin: bool) -> None:
    for at in range(19):
        assert (jumps(held(profile, at, 10.0, at, lin)) < [0.2, 0.1]).all(), at
        rows = held(profile, at, 30.0, at, lin)
        assert not rows["electrodes_out"][HELD].any() and (rows["flags"][HELD] & FrameFlags.RAIL).any()
        # A count of an electrode in mid range moves as much in the same hold, but for rounding to whole um and 0.1 mN.
        count = rows["counts"][HELD].mean(axis=0)
        near_first = np.argsort(np.linalg.norm(ELECTRODE_MM - ELECTRODE_MM[at], axis=1))
        others = [other for other in near_first.tolist() if 500 < count[other] < 3500]
        most, reached = jumps(rows) - [0.002, 0.0005], np.zeros(2)
        while (most > reached).any():
            assert others, at
            reached = np.maximum(reached, jumps(held(profile, at, 30.0, others.pop(), lin)))


def test_a_lead_that_opens_in_a_press_is_out_in_its_first_round() -> None:
    rows = held("new", 16, 3.0, 0, False, opens=True)
    assert (rows["electrodes_out"][250:] == 1 << 16).all()
    assert (rows["flags"][250:] & FrameFlags.ELECTRODE_OUT).all()
