"""tools/bench/front: every variant in every column, errors within their bounds. Times are not looked at."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from core_in_units import on_board, reference

from accuracy import front, limit, measure, signals
from biotac.core.compiled import default_settings
from biotac.wire.messages_gen import PocWeights

COUNTED = ("cycles", "cycles_max", "instructions")
ROOT = Path(__file__).resolve().parents[2]
EFFORT = measure.Effort(frames=300, restarts=2, steps=200)
#: um; what tools/bench/variants says of each (tests/bench/test_variants.c derives them)
POC_BOUNDS_UM = {
    "double": 1e-9,
    "float": 0.17,
    "float mirrored": 0.17,
    "gold int64": 0.002,
    "shipped": 1.1,
    "int + FPU": 0.12,
}


@pytest.fixture(scope="module")
def outcome() -> measure.Facts:
    return measure.measure(EFFORT)


@pytest.fixture
def cores() -> front.Facts:
    """Of two made-up cores, distinct everywhere."""
    serial = iter(range(1, 10**6))

    def row() -> dict[str, int]:
        return {word: next(serial) for word in COUNTED}

    return {
        key: {
            "title": key.upper(),
            "cycles_by": "counting",
            "kernels": {name: {front.EVERYTHING: [row() for _ in measure.WEIGHT_NAMES]} for name in measure.names()},
        }
        for key in ("m0plus", "m0plus_divider", "m4f")
    }


def test_the_json_has_every_variant_and_column(outcome, cores) -> None:
    facts = json.loads(json.dumps(front.facts(outcome, cores), allow_nan=False))
    assert list(facts["variants"]) == measure.names()
    assert set(POC_BOUNDS_UM) | {"Q15"} == set(measure.names())
    serial = iter(range(1, 10**6))
    expected = {
        (key, name, weights): {word: next(serial) for word in COUNTED}
        for key, name, weights in product(cores, measure.names(), measure.WEIGHT_NAMES.values())
    }
    for name, weights in product(measure.names(), measure.WEIGHT_NAMES.values()):
        one = facts["variants"][name][weights]
        assert one["host_times_shipped"] > 0
        assert set(one["errors"]) == set(limit.QUANTITIES)
        for error in one["errors"].values():
            assert set(error) == {"at_1n", "rms", "max", "max_in", "adversarial", "unanswered", "classes"}
            assert set(error["classes"]) == set(signals.CLASSES)
            assert error["max"] >= error["rms"] >= 0
        for key in cores:
            assert one["counts"][key][front.EVERYTHING] == expected[key, name, weights]
    text = front.page(facts)
    for name in measure.names():
        assert text.count(f"| {name} |") == len(measure.WEIGHT_NAMES)


@pytest.mark.parametrize("name", POC_BOUNDS_UM)
def test_a_variant_is_within_its_bound(outcome, name) -> None:
    for measured in outcome["variants"][name].values():
        error = measured["errors"]["PoC"]
        assert max(error["max"], error["adversarial"]) <= POC_BOUNDS_UM[name]
        assert error["unanswered"] == 0


def test_the_errors_of_the_shipped_kernel_are_those_of_the_package() -> None:
    """The judge and the adapters against biotac.core.compiled's own path to the board's kernel and the double."""
    e_q4 = np.ascontiguousarray(limit.frames_q4()[::7])
    tare_q4 = 2000 * 16 - e_q4 % 16
    count = (tare_q4 + e_q4) // 16
    for weights in PocWeights:
        settings = default_settings() | {next(iter(default_settings())): int(weights)}
        board, double = (f(count, tare_q4 / 16, settings).poc_mm for f in (on_board, reference))
        expected = np.linalg.norm(board - double, axis=1) * 1e3
        errors = measure._errors(measure.names().index("shipped"), measure._case(weights), e_q4)
        assert np.allclose(errors[:, 0], expected, atol=1e-6)


def test_hill_climbing_finds_more_than_chance_and_the_same_again(outcome) -> None:
    again = measure.measure(EFFORT)
    for name, weights, quantity in product(measure.names(), measure.WEIGHT_NAMES.values(), limit.QUANTITIES):
        one, other = (o["variants"][name][weights]["errors"][quantity] for o in (outcome, again))
        assert one == other
        assert name == "Q15" or one["adversarial"] > one["rms"]  # its errors are no slope to climb


def test_what_breaks_the_budget_is_named(outcome) -> None:
    text = "\n".join(front.exceptions(outcome))
    assert "Q15, abs n=2: PoC" in text
    assert "Q15, abs n=2: gives no point in" in text
    assert "PoC" not in "\n".join(line for line in text.splitlines() if not line.startswith("Q15"))


@pytest.mark.parametrize("weights", list(PocWeights))
def test_the_limit_is_what_rounding_does(weights) -> None:
    """The force's limit from theory: each electrode's rounding is uniform, so the sum's variance is known."""
    normals = np.array(limit.surface.ELECTRODE_NORMAL)
    gains = np.array([default_settings()[s] for s in measure.FORCE_GAINS]) * 1e-6
    expected = np.sqrt(((normals * gains) ** 2).sum() / 12)
    assert limit.one_step(weights)["force"] == pytest.approx(expected, rel=0.1)
    assert 20 < limit.one_step(weights)["PoC"] < 200


@pytest.mark.parametrize("name", signals.CLASSES)
@pytest.mark.parametrize("weights", list(PocWeights))
def test_frames_are_in_range(name, weights) -> None:
    e_q4 = signals.CLASSES[name](np.random.default_rng(1), 500, weights)
    assert e_q4.shape == (500, 19) and e_q4.dtype == np.int32
    assert np.abs(e_q4).max() <= signals.E_MAX_Q4
    if name == "seams":
        w = np.where(e_q4 < 0, -e_q4.astype(np.float64), 0) ** (1 if weights == PocWeights.COMPRESS_N1 else 2)
        x_mm = w @ surface_x() / w.sum(axis=1)
        assert np.median(np.abs(x_mm)) < 0.01


def surface_x() -> np.ndarray:
    return limit.surface.ELECTRODE_MM[:, 0]


def test_the_picture_is_a_png(outcome, cores, tmp_path) -> None:
    front.draw(front.facts(outcome, cores), tmp_path / "front.png")
    assert (tmp_path / "front.png").read_bytes().startswith(b"\x89PNG")


def test_whole_rounds_have_a_table_of_their_own(outcome, cores) -> None:
    for core in cores.values():
        core["kernels"]["whole frame"] = {"at rest": [{w: 7 + k for w in COUNTED} for k in range(3)]}
    lines = front.page(front.facts(outcome, cores)).splitlines()
    assert "| whole frame, at rest |" + " 7, 7 | 8, 8 | 9, 9 |" * 3 in lines


def test_errors_alone_need_no_board(tmp_path) -> None:
    words = ["--errors", "--frames", "100", "--steps", "20", "--restarts", "1", "--out", str(tmp_path)]
    done = subprocess.run(
        [sys.executable, "-m", "accuracy", *words],
        env=os.environ | {"PYTHONPATH": str(ROOT / "tools/bench")},
        capture_output=True,
        text=True,
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert done.stdout == (tmp_path / "front.md").read_text()
    facts = json.loads((tmp_path / "front.json").read_text())
    assert facts["effort"] == {"frames": 100, "restarts": 1, "steps": 20}
    assert all(not one["counts"] for by_weights in facts["variants"].values() for one in by_weights.values())
    assert not (tmp_path / "front.png").exists()
