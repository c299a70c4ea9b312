"""The forces that a demo compares: by the finger's own calibration, without one, and by Lin's scales as shipped."""

from __future__ import annotations

from dataclasses import replace
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
from numpy.typing import NDArray

from ..calibrate import population
from ..calibrate.reference.nano17 import Nano17Reader
from ..calibrate.wrench.crossvalidation import fit_alone
from ..calibrate.wrench.guided import WrenchProcedure, walk
from ..calibrate.wrench.sources import load, read_reference
from ..hand.opening import shake_hands
from ..kernels.compiled import FORCE_GAINS, Settings, on_board_q4
from ..map.board_map import BoardMap
from ..map.board_map import on_board_q4 as mapped_q4
from ..sim.board import SimBoard
from ..sim.loading import bundled_scenario
from ..sim.play import play
from ..sim.scenario import FingerSpec, parse_scenario
from ..wire import messages_gen as wire
from ..wire.frames import FORCE_LSB_PER_N, StructArray, to_units

LOADS = "calibrate.toml"
OWN, POPULATION, LIN = "own wrench map", "population map", "Lin's scales"
#: Names for people.
NAMES = {OWN: "calibrated", POPULATION: "not calibrated", LIN: "Lin 2013"}


def answers_to(sent: StructArray, settings: Settings, own: BoardMap | None) -> dict[str, NDArray[np.float64]]:
    """Force (n, 3) in N by name, computed by the board's own code from the counts and tares of FRAMEs that it sent.

    OWN is by the finger's ``own`` map, if there is one; POPULATION and LIN are a board's without calibration.
    """
    bare = settings | {gain: wire.SETTINGS[gain].default for gain in FORCE_GAINS}
    forces = {} if own is None else {OWN: mapped_q4(sent, settings, own)[1]}
    for name, model in ((POPULATION, wire.ForceModel.POPULATION), (LIN, wire.ForceModel.LIN)):
        forces[name] = on_board_q4(sent["counts"], sent["tare_q4"], bare | {wire.Setting.FORCE_MODEL: model})[1]
    answers = {name: to_units(force_100un, FORCE_LSB_PER_N) for name, force_100un in forces.items()}
    for force_n in answers.values():
        force_n[(sent["flags"] & wire.FrameFlags.UNTARED) != 0] = np.nan
    return answers


@cache
def own_map(finger: FingerSpec) -> BoardMap:
    """The map that `biotac calibrate wrench --live sim:LOADS --reference nano17` makes, without a margin."""
    source = play(replace(parse_scenario(bundled_scenario(LOADS), file=LOADS), fingers=(finger,)))
    nano17 = Nano17Reader(source, 0)
    with TemporaryDirectory(prefix="biotac-demo-") as folder:
        path = Path(folder) / f"{finger.serial}.mcap"
        with shake_hands(SimBoard(source, pace=0.0).link(f"sim:{LOADS}")) as hand:
            if not walk(hand, nano17, WrenchProcedure(0, nano17.nano17.mounting), path):
                raise KeyboardInterrupt  # an interrupted walk has only part of the data, and a demo needs all of it
        reference = path.with_suffix(".csv")
        loaded = load(path, (reference, read_reference(str(reference))))
        others, _ = population.load(None).others_than(loaded.files)
    return fit_alone(loaded.run, align=not loaded.run.by_clocks, others=others).on_board()
