"""All sensors at once are changed for others while the board streams: who they are, however their properties come."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from rig import Rig

from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire

FINGERS, BEGIN, END = 5, 30, 40
#: Rounds that a finger may lose until it is known: one that it is asked in, and one in which it came.
MAY_LOSE = {"": 2, "/words": 2, "/held": 10, "/bytes": 10}


@pytest.mark.parametrize("kind", MAY_LOSE)
def test_five_serials_are_read_within_3_s_whatever_way_they_come(rig: Rig, kind: str) -> None:
    if not rig.can("properties"):
        pytest.skip("a sensor board's sensors give their properties in one way only")
    source = load_source("press.toml", fingers=FINGERS, seconds=4)
    samples = source.samples.copy()
    samples[BEGIN:END] = wire.EmuFault.SWAPPED
    own = [f"BTEMU0000000020{f}" for f in range(FINGERS)]
    hand = rig.open_with(replace(source, samples=samples, serials=tuple(serial + kind for serial in own)))
    assert [bytes(hand.sensor_info(f).serial).decode() for f in range(FINGERS)] == own
    frames = hand.read_batch(4).frames
    for finger in range(FINGERS):
        assert bytes(hand.sensor_info(finger).serial).decode() == own[finger][:-1] + "X"
        rows = frames[frames["finger"] == finger]
        rounds = rows["seq"].astype(int) - rows["seq"][0]
        sure = rounds[(rounds >= END) & (rows["flags"] & wire.FrameFlags.SENSOR_UNSURE == 0)][0]
        lost = sure - END - np.sum((rounds >= END) & (rounds < sure))
        assert sure - END <= 300 and lost <= MAY_LOSE[kind], (finger, sure, lost)
