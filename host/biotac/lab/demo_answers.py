"""The forces that a demo shows beside each other: by Lin's scales as shipped, and by what the finger is calibrated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..core.compiled import FORCE_GAINS, Settings, on_board_q4
from ..core.population import in_force
from ..wire import messages_gen as wire
from ..wire.batches import Batch
from ..wire.frames import FORCE_LSB_PER_N, to_units


@dataclass(frozen=True)
class Answers:
    """Force (n, 3) in N of each frame: by Lin's scales as the firmware has them, and as the finger is calibrated."""

    lin_n: NDArray[np.float64]
    calibrated_by: str
    calibrated_n: NDArray[np.float64]


def answers_to(batch: Batch, settings: Settings) -> Answers:
    """By the board's own code, over the counts and tares that it sent."""
    untared = (batch.wire["flags"] & wire.FrameFlags.UNTARED) != 0

    def force_n(its: Settings) -> NDArray[np.float64]:
        force = to_units(on_board_q4(batch.wire["counts"], batch.wire["tare_q4"], its)[1], FORCE_LSB_PER_N)
        force[untared] = np.nan
        return force

    firmware = {gain: wire.SETTINGS[gain].default for gain in FORCE_GAINS}
    by_default = settings | {wire.Setting.FORCE_MODEL: wire.ForceModel.POPULATION}
    by = "population map of real fingers" if in_force(by_default) else "scales fitted to this finger"
    return Answers(force_n(settings | firmware), by, force_n(by_default))
