"""Electrodes without their excitation, whose noise is alive: a press that pressure alone feels is not acted on."""

from __future__ import annotations

import numpy as np
import pytest
import sensor_faults
from maps import make_map
from sensor_faults import MORE, Press

from biotac import Finger, FrameFlags, Trust
from biotac.wire import slots

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
