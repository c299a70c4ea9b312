"""`biotac-lab finger`: the measures, on signals with known gain and hysteresis."""

from types import SimpleNamespace

import numpy as np
import pytest

from biotac.sim import SimFinger
from biotac_lab.calibrate import off_pad
from biotac_lab.calibrate.finger_command import Touched, _memory, _pressed
from biotac_lab.calibrate.plates import TENTHS, KnownNormal

FINGERS = [SimFinger(seed) for seed in range(20)]
# Medians of trial_15330 (`biotac-lab finger F1 F2 --plates trial_15330`): where the point of contact lies over the
# radius when the plate's normal is in a tenth, and by place and pressure squeezed counts per count of pressure and
# bulged counts over squeezed ones, in cells of 50 rows or more.
POINTS = {"ny": (0.03, 0.02, 0.25, 0.32, 0.49, 0.54), "nx": (0.00, 0.00, 0.25, 0.43, 0.57, 0.74, 0.80)}
CELLS = {
    ("pad", 400): (1.73, 0.90), ("flank .2-.4", 200): (1.21, 1.53), ("flank .2-.4", 400): (1.78, 1.09),
    ("flank .4-.6", 200): (1.75, 0.98), ("flank .4-.6", 400): (2.39, 0.60), ("tip .25-.45", 200): (2.12, 1.03),
    ("tip .25-.45", 400): (2.22, 0.99), ("tip .45-.7", 200): (2.16, 1.29), ("tip > .7", 80): (1.70, 2.52),
    ("tip > .7", 200): (1.85, 1.66),
}  # fmt: skip
PLACES = {
    "pad": (0.0, 0.1), "flank .2-.4": (0.0, 0.3), "flank .4-.6": (0.0, 0.5), "tip .25-.45": (0.35, 0.0),
    "tip .45-.7": (0.57, 0.0), "tip > .7": (0.78, 0.0),
}  # fmt: skip
FLAT = "tip > .7"  # where simulated fingers bulge less than they may


def test_the_point_of_contact_follows_a_plate_as_a_real_fingers_does() -> None:
    for k, axis in ((1, "ny"), (0, "nx")):
        for low, real in zip(TENTHS, POINTS[axis], strict=False):
            seen = np.median(off_pad.points_seen(FINGERS, k, low + 0.05))  # of three forces
            assert abs(seen - real) <= 0.12, f"{axis} {low:.1f}"


def test_squeezed_and_bulged_counts_are_those_of_a_real_finger_from_pad_to_tip() -> None:
    flat = set()
    for (place, low), (squeezed, bulged) in CELLS.items():
        nx, ny = PLACES[place]
        normal = np.array([[nx, ny, -np.sqrt(1.0 - nx * nx - ny * ny)]])
        none = np.zeros((1, 19))
        plate = KnownNormal(none, none, np.array([low * np.sqrt(2.0)]), normal, np.ones(1, np.int64))
        found = np.median(
            [off_pad.squeezed_and_bulged(off_pad.signal_under(one, plate), plate.pressure) for one in FINGERS], axis=0
        )
        times = 2.5 if low == 80 else 1.5
        assert squeezed / times <= found[0] <= times * squeezed, (place, low)
        if not 0.6 * bulged <= found[1] <= 1.7 * bulged:
            flat.add(place)
    assert flat == {FLAT}, "more, or to be taken off"


def test_straight_presses_mend_some_of_a_gain() -> None:
    truth = np.column_stack([np.zeros((60, 2)), np.linspace(1.0, 7.0, 60)])
    weak = SimpleNamespace(force=lambda counts, tare: 0.7 * truth)
    left_n = _pressed(weak, Touched(np.zeros((60, 19)), np.zeros(19), truth), seed=1)
    assert left_n[2] < np.sqrt(((0.3 * truth[:, 2]) ** 2).mean())


def test_a_signal_that_is_higher_as_force_falls_remembers() -> None:
    t_s = np.arange(0, 20, 0.01)
    size_n = 4.0 - 2.0 * np.cos(t_s)
    assert _memory(3.0 * size_n, size_n) == pytest.approx(1.0)
    assert _memory(size_n * np.where(np.sin(t_s) > 0, 1.0, 1.1), size_n) == pytest.approx(1.1, abs=1e-3)
