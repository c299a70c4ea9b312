"""The Pico's slots as its bus sees them, in emulated time: rate, jitter, and the sensor's 50 us and 5 us rules."""

from __future__ import annotations

import json
import subprocess
from pathlib import Path

import pytest
from rig import Rig

ROOT = Path(__file__).resolve().parents[2]
IMAGE = ROOT / "build/pico/biotac-pico.bin"
SECONDS = 2.0
SLOT_US = 1e6 / 4400


def test_slots_are_on_time_and_the_bus_rules_kept(rig: Rig) -> None:
    rig.need("flash")
    words = ["node", str(ROOT / "tools/emulator/timing.mjs"), str(IMAGE), str(SECONDS)]
    seen = json.loads(subprocess.run(words, check=True, capture_output=True, text=True).stdout)
    assert seen["slots"] > 0.85 * SECONDS * 4400  # after 0.1 s of power-up
    assert seen["hz"] == pytest.approx(4400, rel=1e-6)
    earliest, latest = seen["slot_deviation_us"]
    assert latest - earliest <= 2
    assert seen["settle_us"] >= 50  # product manual
    assert seen["gap_us"] >= 5
    assert seen["interrupt_us"] < SLOT_US / 2
    assert seen["awake"] < 0.6
