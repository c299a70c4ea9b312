"""The two forces that a demo compares: by Lin's scales as shipped, and by the finger's calibration."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from ..calibrate.wrench import models
from ..calibrate.wrench.moments import air_sums, smoothed, strip_sums
from ..calibrate.wrench.run import run_of
from ..core.compiled import FORCE_GAINS, Settings, on_board_q4
from ..map.board_map import BoardMap
from ..map.board_map import on_board_q4 as mapped_q4
from ..map.fitted import WrenchMap
from ..map.population import in_force
from ..sim.physics import Finger
from ..sim.random_loads import plate_recording, random_loads
from ..sim.scenario import FLAT_MM
from ..sim.source import Source
from ..wire import messages_gen as wire
from ..wire.batches import Batch
from ..wire.frames import FORCE_LSB_PER_N, to_units

LOADS = 4000  # the minimum of `biotac calibrate wrench`
LOADS_SEED = 1


@dataclass(frozen=True)
class Answers:
    """Force (n, 3) in N of each frame: by Lin's scales as in the firmware, and by the finger's calibration.

    If the source's finger is emulated, ``calibrated_n`` is by finger 0's own map and NaN for the other fingers.
    """

    lin_n: NDArray[np.float64]
    calibrated_by: str
    calibrated_n: NDArray[np.float64]


def answers_to(batch: Batch, settings: Settings, source: Source) -> Answers:
    """Both answers, computed by the board's own code from the counts and tares that it sent."""
    frames = batch.wire

    def newtons(force_100un: NDArray[np.int32]) -> NDArray[np.float64]:
        force_n = to_units(force_100un, FORCE_LSB_PER_N)
        force_n[(frames["flags"] & wire.FrameFlags.UNTARED) != 0] = np.nan
        return force_n

    def by(used: Settings) -> NDArray[np.float64]:
        return newtons(on_board_q4(frames["counts"], frames["tare_q4"], used)[1])

    lin_n = by(settings | {gain: wire.SETTINGS[gain].default for gain in FORCE_GAINS})
    if source.emulated:
        calibrated_n = newtons(mapped_q4(frames, settings, own_map(source.emulated[0]))[1])
        calibrated_n[frames["finger"] != 0] = np.nan
        return Answers(lin_n, "finger 0's own wrench map", calibrated_n)
    by_default = settings | {wire.Setting.FORCE_MODEL: wire.ForceModel.POPULATION}
    calibrated_by = "population map of real fingers" if in_force(by_default) else "scales fitted to this finger"
    return Answers(lin_n, calibrated_by, by(by_default))


def own_map(finger: Finger) -> BoardMap:
    """The map fitted to a force plate's recording of other loads on ``finger``: a flat, pressed and sheared at random.

    It takes one model and lambda; `biotac calibrate wrench` would choose among them, which takes a minute.
    """
    loads, cell = random_loads(LOADS, LOADS_SEED)
    loads = replace(loads, tip_radius_mm=np.full(LOADS, FLAT_MM / 2.0))
    recorded = plate_recording(finger, loads, cell, LOADS_SEED)
    run = run_of(Path("loads"), {name: recorded[name] for name in ("E", "F", "E_base", "E_idle")})
    sums, air = strip_sums(smoothed(run, 1), run.truth, run.drift), air_sums(run, 1)
    assert air is not None
    coefficients = models.pulled(sums.plus(air), [models.JOINED])[0][0]
    lag_rows = (0,) * len(run.axes)
    return WrenchMap(models.JOINED.name, run.axes, run.tare, 1, lag_rows, coefficients).on_board()
