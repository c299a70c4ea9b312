"""biotac-lab bench batch and recording: contestants agree, and file sizes are ordered as their contents are."""

import numpy as np
import pytest

from biotac_lab.bench import batch, recording


def test_the_contestants_of_batch_agree() -> None:
    times, ratios = batch.measure(batch.SINGLE_FRAMES, rounds=1)
    named = {name for fast, slow, _ in batch.ASKED for name in (fast, slow)}
    assert named <= {row[0] for row in times.rows}
    assert [row[:2] for row in ratios.rows] == [[fast, slow] for fast, slow, _ in batch.ASKED]


def test_a_contestant_of_batch_that_is_off_is_named() -> None:
    result = np.zeros(3, batch.RESULT_DTYPE)
    off = tuple(result[name] + (name == "force_n") * 1e-6 for name in result.dtype.names or ())
    with pytest.raises(RuntimeError, match="all frames: two contestants differ in force_n"):
        batch.check([result, off], "all frames")


def test_both_readers_give_back_every_integer() -> None:
    """measure() checks it and raises."""
    sizes, load = recording.measure(fingers=2, seconds=2.0, rounds=1)
    mcap, protobuf = (row[1] for row in sizes.rows)
    assert mcap > 0 and protobuf > 0
    assert [row[0] for row in load.rows[:4]] == [recording.OURS, recording.PROTOBUF, recording.ALL, recording.FORCE]
    rows = np.zeros(3, [("seq", np.uint16), ("pdc", np.uint16)])
    with pytest.raises(AssertionError, match="it: frames/pdc differs"):
        recording.check_same({"frames": {"seq": rows["seq"], "pdc": rows["pdc"] + 1}}, {"frames": rows}, "it")
