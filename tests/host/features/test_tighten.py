"""The example of a controller that tightens before what it holds slips (host/docs/guides/examples/tighten.py)."""

from __future__ import annotations

import runpy
from pathlib import Path

EXAMPLE = Path(__file__).resolve().parents[3] / "host/docs/guides/examples/tighten.py"


def test_what_is_held_is_lost_and_what_is_tightened_is_not() -> None:
    example = runpy.run_path(str(EXAMPLE))
    trained = example["learn"](range(3))
    held, tightened = example["Thing"](0.25, 2.0), example["Thing"](0.25, 2.0)
    example["grasp"](held, 100, None)
    example["grasp"](tightened, 100, trained)
    assert held.slid_mm >= example["LOST_MM"]
    assert tightened.slid_mm < 1.0
    assert tightened.rounds[-1][0] < example["MOST_N"]  # it does not squeeze for ever
