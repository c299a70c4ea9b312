"""What the benchmark of recordings counts with."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

from biotac.lab.bench import recording
from biotac.lab.bench.columns import entropy_bits


def test_entropy_is_shannons() -> None:
    """Against the definition, in plain Python."""
    values = np.random.default_rng(1).integers(0, 20, 1000) ** 2
    counts = Counter(values.tolist())
    bits = -sum(n * math.log2(n / 1000) for n in counts.values())
    assert entropy_bits(values) == pytest.approx(bits)
    assert entropy_bits(np.zeros(9)) == 0
    assert entropy_bits(np.array([0, 1] * 8)) == pytest.approx(16)


def test_both_contestants_give_back_every_integer() -> None:
    """measure() checks it and raises; sizes are ordered as what they hold is."""
    outcome = recording.measure("press.toml", fingers=2, seconds=2.0)
    assert outcome.frames == 400
    assert 0 < outcome.floor_bytes < outcome.wire_bytes
    assert sum(outcome.mcap_parts.values()) == outcome.mcap_bytes > outcome.mcap_parts["wire"] > 0
    assert outcome.protobuf_bytes > outcome.floor_bytes
    assert set(outcome.load_s) == {"MCAP wire", "protobuf", recording.ALL, recording.FORCE}
