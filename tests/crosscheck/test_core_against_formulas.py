"""Core and reference against the papers' formulas written once more, in NumPy, from sensor.toml."""

import json
from pathlib import Path

import numpy as np
import pytest
from core_in_units import on_board, reference
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from biotac import PocWeights, Setting
from biotac.kernels.compiled import default_settings, on_board_q4, reference_q4
from biotac.recording.crosscheck import FORCE_BOUND_MN, POC_BOUND_UM

try:
    import tomllib
except ModuleNotFoundError:  # Python 3.10
    import tomli as tomllib

SENSOR = tomllib.loads((Path(__file__).parents[2] / "protocol" / "sensor.toml").read_text())
TABLE_1 = np.array([row[1:] for row in SENSOR["geometry"]["electrodes"]]) / 1000.0
R_MM, N = TABLE_1[:, :3], TABLE_1[:, 3:]
RADIUS_MM = 5.08
GAINS = {"force": np.array([1.2e-3, 3e-4, 5e-4]), "torque": np.array([7e-4, 9e-4])}


def settings_with(weights: PocWeights) -> dict[Setting, int]:
    chosen = default_settings() | {Setting.POC_WEIGHTS: int(weights)}
    for axis, gain in zip("XYZ", GAINS["force"], strict=True):
        chosen[Setting[f"FORCE_GAIN_{axis}_NN"]] = round(gain * 1e9)
    for axis, gain in zip("YZ", GAINS["torque"], strict=True):
        chosen[Setting[f"TORQUE_GAIN_{axis}_NN"]] = round(gain * 1e9)
    return chosen


def lin(e: np.ndarray, weights: PocWeights) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lin 2013 Eq 1-4 for signals (n, 19) in counts, with r in Eq 2's cylinder and M_x from the lever."""
    w = {
        PocWeights.ABS_N2: np.abs(e) ** 2,
        PocWeights.COMPRESS_N1: np.maximum(-e, 0),
        PocWeights.COMPRESS_N2: np.minimum(e, 0) ** 2,
    }[weights]
    with np.errstate(invalid="ignore", divide="ignore"):
        c = w @ R_MM / w.sum(axis=1, keepdims=True)
        sphere = c * RADIUS_MM / np.linalg.norm(c, axis=1, keepdims=True)
        around = RADIUS_MM / np.hypot(c[:, 1], c[:, 2])
        cylinder = np.column_stack([c[:, 0], c[:, 1] * around, c[:, 2] * around])
    poc = np.where(c[:, :1] > 0, sphere, cylinder)
    force = GAINS["force"] * (e @ N)
    torque = e @ np.cross(R_MM, N)
    lever = poc[:, 1] * force[:, 2] - poc[:, 2] * force[:, 1]
    return poc, force, np.column_stack([lever, torque[:, 1:] * GAINS["torque"]])


def within(got: np.ndarray, want: np.ndarray, scale: float, bound: float, *, norm: bool) -> None:
    assert np.array_equal(np.isnan(got), np.isnan(want))
    error = np.nan_to_num(np.abs(got - want)) * scale
    worst = np.linalg.norm(error, axis=1).max() if norm else error.max()
    assert worst <= bound


@settings(max_examples=150, deadline=None)
@given(
    counts=arrays(np.uint16, (7, 19), elements=st.integers(0, 4095)),
    tare_q4=arrays(np.int64, 19, elements=st.integers(0, 4095 * 16)),
    weights=st.sampled_from(list(PocWeights)),
)
def test_core_and_reference_meet_the_formulas_on_any_counts(counts, tare_q4, weights) -> None:
    poc, force, torque = lin(counts - tare_q4 / 16, weights)
    exact = reference(counts, tare_q4 / 16, settings_with(weights))
    assert np.allclose(exact.poc_mm, poc, rtol=0, atol=1e-9, equal_nan=True)
    assert np.allclose(exact.force_n, force, rtol=1e-12, atol=1e-9)
    assert np.allclose(exact.torque_nmm, torque, rtol=1e-12, atol=1e-9, equal_nan=True)
    board = on_board(counts, tare_q4 / 16, settings_with(weights))
    within(board.poc_mm, poc, 1e3, POC_BOUND_UM, norm=True)
    within(board.force_n, force, 1e3, FORCE_BOUND_MN, norm=False)
    # Half a mN*mm, and arms known to 1/160 um on up to 19 x 4095 counts; x: the PoC's error times force.
    arms = 0.5 + GAINS["torque"].max() * (0.4 + 19 * 4095 / 160)
    lever = 1.6 + np.abs(force[:, 1:]).sum(axis=1).max() * 0.6
    within(board.torque_nmm, torque, 1, max(arms, lever) / 1000, norm=False)


@pytest.mark.parametrize(
    "counts",
    [np.zeros((2, 18), int), np.zeros(19, int), np.full((1, 19), -1), np.full((1, 19), 65536), np.zeros((1, 19))],
)
def test_bad_arrays_are_refused_at_the_door(counts) -> None:
    for kernel in (on_board_q4, reference_q4):
        with pytest.raises(ValueError, match="expected"):
            kernel(counts, np.zeros((len(counts), 19), np.uint16), default_settings())


@pytest.mark.parametrize(
    ("weights", "key"),
    [
        (PocWeights.ABS_N2, "poc_abs_n2"),
        (PocWeights.COMPRESS_N1, "poc_comp_n1"),
        (PocWeights.COMPRESS_N2, "poc_comp_n2"),
    ],
)
def test_the_eight_real_vectors(shared_data, weights, key) -> None:
    for vector in json.loads((shared_data / "test_vectors.json").read_text()):
        tare = np.array(vector["tare_q4"]) / 16
        unit = settings_with(weights) | {s: 10**8 for s in Setting if s.name.endswith("_NN")}  # 0.1 N/count
        exact = reference(vector["raw"], tare, unit)
        assert np.abs(exact.poc_mm[0] - vector[key]).max() <= 1e-9
        assert np.abs(exact.force_n[0] - 0.1 * np.array(vector["fsum"])).max() <= 1e-9
        assert np.abs(exact.torque_nmm[0, 1:] - 0.1 * np.array(vector["tsum"][1:])).max() <= 1e-9
        board = on_board(vector["raw"], tare, unit)
        within(board.poc_mm, exact.poc_mm, 1e3, 1.2, norm=True)
        within(board.force_n, exact.force_n, 1e3, 1.0, norm=False)
        within(board.torque_nmm, exact.torque_nmm, 1, 0.02, norm=False)
