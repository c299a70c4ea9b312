"""Electrodes without their excitation, whose noise is alive: a press that pressure alone feels is not acted on."""

import courses
import numpy as np
import pytest
import sensor_faults
from maps import make_map
from sensor_faults import MORE, Press

from biotac import Finger, FrameFlags, Trust
from biotac.sim.faults import FAULTS
from biotac.sim.timeline import Pose
from biotac.wire import slots
from biotac.wire.native import ffi, lib

UNFELT = FrameFlags.LEAP_PENDING | FrameFlags.SENSOR_FAULT
PRESSES = [sensor_faults.press(1), sensor_faults.press(2, "worn"), sensor_faults.press(3)]


def fed(finger: Finger, words: np.ndarray) -> np.ndarray:
    return finger.feed(words[:, slots.ELECTRODE_SLOT], words[:, slots.PDC_SLOT], tdc=words[:, slots.TDC_SLOT])


def silent(press: Press, noise: int) -> np.ndarray:
    fault = MORE[f"all silent, with noise of {noise}"]
    return sensor_faults.spoil(press, fault, press.begins("rest"), np.random.default_rng(press.seed))


@pytest.mark.parametrize("model", [*sensor_faults.MODELS, "own map"])
@pytest.mark.parametrize("noise", [1, 3, 8])
def test_no_press_that_they_do_not_feel_is_acted_on(noise: int, model: str) -> None:
    for press in PRESSES:
        finger = Finger(wrench_map=make_map(3)) if model == "own map" else Finger(press.settings(model))
        rows = fed(finger, silent(press, noise))
        assert (rows["trust"][press.squeeze + 40 : press.free] <= Trust.HOLD).all()  # the squeeze is 10 N/s
        assert (rows["flags"][press.hold + 100 : press.free] & FrameFlags.SENSOR_FAULT).all() or noise == 8


def test_it_ends_with_a_press_that_they_feel_and_with_a_hosts_tare() -> None:
    press = PRESSES[0]
    again = fed(Finger(), np.concatenate([silent(press, 3), press.words]))[len(press.words) :]
    distrusted = (again["flags"] & FrameFlags.SENSOR_FAULT) != 0
    assert distrusted[:100].all() and not distrusted[press.hold :].any()
    fed(tared := Finger(), silent(press, 3))
    tared.tare_now()
    rest = fed(tared, press.words[press.begins("rest") : press.squeeze])
    assert not (rest["flags"] & FrameFlags.SENSOR_FAULT)[10:].any()


@pytest.mark.parametrize("seed", range(4))
def test_pressure_that_a_long_press_leaves_condemns_no_electrode(seed: int) -> None:
    """Over 100 counts after 9 N for two minutes; also where the board restarts, or a host gives back a tare, in it."""
    script = courses.script(seed, "worn" if seed % 2 else "new").load(9, 30, Pose(x_mm=-4.0, tip_mm=4.0)).hold(120)
    free = round(script.load(0, 30).track.seconds / slots.FRAME_S)
    course = script.rest(60).make()
    assert not (course.run()["flags"] & UNFELT).any()
    above = course.words["pdc"].astype(float) - course.words["pdc"][:500].mean()
    assert above[free + 100 : free + 200].mean() > 48
    for after in (-50, 10, 100, 400):
        before, finger, kept = Finger(), Finger(), ffi.new("bt_tare_kept *")
        before.feed(**{name: words[: free + after] for name, words in course.words.items()})
        lib.bt_tare_keep(ffi.addressof(before._finger, "tare"), kept)
        lib.bt_tare_restore(ffi.addressof(finger._finger, "tare"), kept)
        rows = finger.feed(**{name: words[free + after :] for name, words in course.words.items()})
        assert not (rows["flags"] & UNFELT).any(), after


@pytest.mark.parametrize("fault", ["PDC stuck", "PDC 0", "PDC 4095"])
def test_pressure_that_is_stuck_or_at_an_end_condemns_no_electrode(fault: str) -> None:
    for press in PRESSES:
        bad = sensor_faults.spoil(press, FAULTS[fault], press.begins("hold"), np.random.default_rng(0))
        assert not (fed(Finger(), bad)["flags"] & UNFELT).any()


def test_electrodes_that_fall_silent_in_a_hold_are_not_acted_on() -> None:
    for press in PRESSES:
        begin = press.begins("hold")
        words = sensor_faults.spoil(press, MORE["all silent, with noise of 3"], begin, np.random.default_rng(0))
        assert (fed(Finger(), words)["trust"][begin + 20 : press.free] <= Trust.HOLD).all()
