"""biotac bench kernels: every variant in every column, errors within their bounds, counts merged or refused.

Times are not looked at.
"""

from __future__ import annotations

import copy
import json
from itertools import product

import numpy as np
import pytest

from biotac.cli.main import main
from biotac.core.compiled import default_settings, on_board, reference
from biotac.lab.bench import front, kernels, limit, scenes
from biotac.wire.messages_gen import PocWeights

EFFORT = kernels.Effort(frames=300, restarts=2, steps=200)
#: um; what tools/bench/variants says of each (tests/bench/test_variants.c derives them)
POC_BOUNDS_UM = {
    "double": 1e-9,
    "float": 0.17,
    "float folded": 0.17,
    "gold int64": 0.002,
    "shipped": 1.1,
    "int + FPU": 0.12,
}


@pytest.fixture(scope="module")
def outcome() -> kernels.Outcome:
    return kernels.measure(EFFORT)


@pytest.fixture
def counts() -> front.Facts:
    """Of two made-up cores, distinct everywhere."""
    serial = iter(range(1, 10**6))

    def row() -> dict[str, int]:
        return {word: next(serial) for word in front.COUNTED}

    weights = list(kernels.WEIGHT_NAMES.values())
    cores = {
        key: {
            "title": key.upper(),
            "cycles_by": "counting",
            "kernels": {name: {front.EVERYTHING: [row() for _ in weights]} for name in kernels.names()},
        }
        for key in ("m0plus", "m4f")
    }
    return {"format": front.FORMAT, "frames": 12, "weights": weights, "cores": cores}


def test_the_json_has_every_variant_and_column(outcome, counts) -> None:
    facts = json.loads(json.dumps(front.facts(outcome, counts), allow_nan=False))
    assert list(facts["variants"]) == kernels.names()
    assert set(POC_BOUNDS_UM) | {"Q15"} == set(kernels.names())
    serial = iter(range(1, 10**6))
    expected = {
        (key, name, weights): {word: next(serial) for word in front.COUNTED}
        for key, name, weights in product(counts["cores"], kernels.names(), kernels.WEIGHT_NAMES.values())
    }
    for name, weights in product(kernels.names(), kernels.WEIGHT_NAMES.values()):
        one = facts["variants"][name][weights]
        assert one["host_times_shipped"] > 0
        assert set(one["errors"]) == set(kernels.QUANTITIES)
        for error in one["errors"].values():
            assert set(error) == {"at_1n", "rms", "max", "max_in", "adversarial", "unanswered", "classes"}
            assert set(error["classes"]) == set(scenes.CLASSES)
            assert error["max"] >= error["rms"] >= 0
        for key in counts["cores"]:
            assert one["counts"][key][front.EVERYTHING] == expected[key, name, weights]
    text = front.table(facts)
    for name in kernels.names():
        assert text.count(f"| {name} |") == len(kernels.WEIGHT_NAMES)


@pytest.mark.parametrize("name", POC_BOUNDS_UM)
def test_a_variant_is_within_its_bound(outcome, name) -> None:
    for measured in outcome.variants[name].values():
        error = measured.errors["PoC"]
        assert error.worst <= POC_BOUNDS_UM[name]
        assert error.unanswered == 0


def test_the_errors_of_the_shipped_kernel_are_those_of_the_package() -> None:
    """The judge and the adapters against biotac.core.compiled's own path to the board's kernel and the double."""
    e_q4 = np.ascontiguousarray(limit.frames_q4()[::7])
    tare_q4 = 2000 * 16 - e_q4 % 16
    count = (tare_q4 + e_q4) // 16
    for weights in PocWeights:
        settings = default_settings() | {next(iter(default_settings())): int(weights)}
        board, double = (f(count, tare_q4 / 16, settings).poc_mm for f in (on_board, reference))
        expected = np.linalg.norm(board - double, axis=1) * 1e3
        errors = kernels._errors(kernels.names().index("shipped"), kernels._case(weights), e_q4)
        assert np.allclose(errors[:, 0], expected, atol=1e-6)


def test_hill_climbing_finds_more_than_chance_and_the_same_again(outcome) -> None:
    again = kernels.measure(EFFORT)
    for name, weights, quantity in product(kernels.names(), kernels.WEIGHT_NAMES.values(), kernels.QUANTITIES):
        one, other = (o.variants[name][weights].errors[quantity] for o in (outcome, again))
        assert one == other
        assert name == "Q15" or one.adversarial > one.rms  # its errors are no slope to climb


def test_what_breaks_the_budget_is_named(outcome) -> None:
    text = "\n".join(front.exceptions(outcome))
    assert "Q15, abs n=2: PoC" in text
    assert "Q15, abs n=2: gives no point in" in text
    assert "PoC" not in "\n".join(line for line in text.splitlines() if not line.startswith("Q15"))


@pytest.mark.parametrize("weights", list(PocWeights))
def test_the_limit_is_what_rounding_does(weights) -> None:
    """The force's limit from theory: each electrode's rounding is uniform, so the sum's variance is known."""
    normals = np.array(limit.surface.ELECTRODE_NORMAL)
    gains = np.array([default_settings()[s] for s in kernels.FORCE_GAINS]) * 1e-6
    expected = np.sqrt(((normals * gains) ** 2).sum() / 12)
    assert limit.one_step(weights).force_mn == pytest.approx(expected, rel=0.1)
    assert 20 < limit.one_step(weights).poc_um < 200


@pytest.mark.parametrize("name", scenes.CLASSES)
@pytest.mark.parametrize("weights", list(PocWeights))
def test_frames_are_in_range(name, weights) -> None:
    e_q4 = scenes.CLASSES[name](np.random.default_rng(1), 500, weights)
    assert e_q4.shape == (500, 19) and e_q4.dtype == np.int32
    assert np.abs(e_q4).max() <= scenes.E_MAX_Q4
    if name == "seams":
        w = np.where(e_q4 < 0, -e_q4.astype(np.float64), 0) ** (1 if weights == PocWeights.COMPRESS_N1 else 2)
        x_mm = w @ surface_x() / w.sum(axis=1)
        assert np.median(np.abs(x_mm)) < 0.01


def surface_x() -> np.ndarray:
    return limit.surface.ELECTRODE_MM[:, 0]


def test_the_command_writes_table_json_and_picture(tmp_path, counts, capsys) -> None:
    path = tmp_path / "counts.json"
    path.write_text(json.dumps(counts))
    words = ["--frames", "100", "--steps", "50", "--restarts", "1", "--out", str(tmp_path / "out")]
    assert main(["bench", "kernels", *words, "--counts", str(path)]) == 0
    assert capsys.readouterr().out == (tmp_path / "out/front.md").read_text()
    assert json.loads((tmp_path / "out/front.json").read_text())["cores"]["m4f"]["title"] == "M4F"
    assert (tmp_path / "out/front.png").read_bytes().startswith(b"\x89PNG")


def test_whole_rounds_have_a_table_of_their_own(tmp_path, counts, capsys) -> None:
    for core in counts["cores"].values():
        core["kernels"]["whole frame"] = {"at rest": [{w: 7 + k for w in front.COUNTED} for k in range(3)]}
    path = tmp_path / "counts.json"
    path.write_text(json.dumps(counts))
    assert main(["bench", "kernels", "--frames", "100", "--steps", "20", "--restarts", "1", "--counts", str(path)]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert "| whole frame, at rest | 7, 7 | 8, 8 | 9, 9 | 7, 7 | 8, 8 | 9, 9 |" in lines


def test_bench_alone_is_kernels(capsys) -> None:
    assert main(["bench", "--json", "--frames", "100", "--steps", "20", "--restarts", "1"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["effort"] == {"frames": 100, "restarts": 1, "steps": 20}
    assert all(not one["counts"] for by_weights in facts["variants"].values() for one in by_weights.values())


def without(counts: front.Facts, *keys: str) -> front.Facts:
    changed = copy.deepcopy(counts)
    inner = changed
    for key in keys[:-1]:
        inner = inner[key]
    del inner[keys[-1]]
    return changed


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        (("format",), "no 'biotac bench counts 1'"),
        (("weights",), "other weights than abs n=2"),
        (("cores",), "no cores"),
        (("cores", "m4f", "title"), "no title for m4f"),
        (("cores", "m4f", "kernels"), "no kernels for m4f"),
        (("cores", "m0plus", "kernels", "shipped"), "no counts of shipped on m0plus"),
        (("cores", "m0plus", "kernels", "Q15", "everything"), "no counts of Q15 on m0plus"),
    ],
)
def test_counts_of_another_shape_are_refused(tmp_path, counts, capsys, keys, words) -> None:
    path = tmp_path / "counts.json"
    path.write_text(json.dumps(without(counts, *keys)))
    assert main(["bench", "kernels", "--counts", str(path)]) == 2
    error = capsys.readouterr().err
    assert words in error and "tools/bench/run --json" in error and error.count("\n") == 1


@pytest.mark.parametrize("text", [None, "{", "[]", "3", '{"format": "biotac bench counts 1", "weights": 3}'])
def test_files_that_are_no_counts_are_refused(tmp_path, text, capsys) -> None:
    path = tmp_path / "counts.json"
    if text is not None:
        path.write_text(text)
    assert main(["bench", "kernels", "--counts", str(path)]) == 2
    error = capsys.readouterr().err
    assert str(path) in error and error.count("\n") == 1


def test_an_unwritable_directory_is_named(tmp_path, capsys) -> None:
    (tmp_path / "file").write_text("")
    words = ["--frames", "100", "--steps", "1", "--restarts", "1", "--out", str(tmp_path / "file")]
    assert main(["bench", "kernels", *words]) == 2
    assert "choose another --out" in capsys.readouterr().err
