"""A wrench map on the board: bytes, arithmetic against float64, and the frames made with it."""

import dataclasses
import json
import struct
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
import wrench_run

import biotac
from biotac.calibrate.wrench import models
from biotac.calibrate.wrench.plate_recording import Run, load_run
from biotac.errors import InputError
from biotac.kernels.compiled import default_settings, on_board_q4, pressure_force_100un
from biotac.map import board_map, bound, columns, file
from biotac.map.board_map import BoardBlock, BoardMap, from_blob
from biotac.map.fitted import WrenchMap
from biotac.map.float64 import exact, result_units
from biotac.map.margin import Margin
from biotac.recording.crosscheck import CrossCheck
from biotac.recording.rounds import FingerRounds, frames_and_tares
from biotac.wire import map_gen as _map
from biotac.wire import messages_gen as wire
from biotac.wire.frames import tare_to_q4
from biotac.wire.map_gen import Gate, Kind
from biotac.wire.sensor_gen import ELECTRODE_UM

UNKNOWN_BYTES = bytes([0xFF, 0xFF, 0, 0] * 2)  # a margin
FORCE_MN, TORQUE_NMM = 10.0, 0.1  # RMS: the limit asked for, and the same at the finger's 10 mm
TARE = np.array([2955.0 + 31 * k for k in range(19)])


def random_map(seed: int, axes: int = 3, *, pdc: bool = True, unused: tuple[Kind, ...] = ()) -> WrenchMap:
    """Coefficients as large as in fits on real fingers, and of every size below that."""
    rng = np.random.default_rng([seed, 9])
    blocks = columns.blocks(with_pdc=pdc)
    parts = [
        rng.normal(0.0, 4.0, (_map.KINDS[kind].columns, axes)) * 10.0 ** rng.uniform(-3.0, 0.0) * (kind not in unused)
        for kind, _ in blocks
    ]
    names = ("Fx", "Fy", "Fz", "Mx", "My", "Mz", "torsion")[:axes]
    coefficients = np.concatenate([*parts, rng.normal(0.0, 2.0, (1, axes))])
    return WrenchMap("random", names, TARE, 1, (0,) * len(names), coefficients)


def frames_of(seed: int, rows: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Counts and tares over the whole range, at the ends and near each other, with words missing."""
    rng = np.random.default_rng([seed, 10])
    counts = rng.integers(0, 4096, (rows, 19))
    tare_q4 = rng.integers(0, 65521, (rows, 19))
    near = rng.random((rows, 1)) < 0.5
    counts = np.where(near, np.clip(tare_q4 // 16 + rng.integers(-300, 200, (rows, 19)), 0, 4095), counts)
    ends = rng.random((rows, 1)) < 0.1
    counts = np.where(ends, rng.choice([0, 1, 4090, 4095], (rows, 19)), counts)
    counts[rng.random((rows, 19)) < 0.01] = wire.INVALID_COUNT
    tare_q4[rng.random((rows, 19)) < 0.01] = wire.INVALID_COUNT
    return counts.astype(np.uint16), tare_q4.astype(np.uint16), rng.integers(-65520, 65521, rows).astype(np.int32)


def got(stored: BoardMap, *frames: np.ndarray) -> np.ndarray:
    force, torque, torsion = stored.results(*frames)
    return np.column_stack([force, torque, torsion])[:, : stored.axes] / result_units(stored.axes)


# ---- bytes -------------------------------------------------------------------------------------


def test_a_blob_comes_back_to_the_bit() -> None:
    for axes in (3, 6, 7):
        stored = random_map(1, axes).on_board(serial="BTEMU00000000042", made_s=1763731310)
        back = from_blob(stored.blob)
        assert (back.axes, back.serial, back.made_s) == (axes, "BTEMU00000000042", 1763731310)
        assert [(b.kind, b.gate, b.exponent) for b in back.blocks] == [
            (b.kind, b.gate, b.exponent) for b in stored.blocks
        ]
        for one, other in zip(back.blocks, stored.blocks, strict=True):
            np.testing.assert_array_equal(one.coefficients, other.coefficients)
        assert back.blob == stored.blob and back.margin == stored.margin


def test_the_layout_is_what_the_specification_says() -> None:
    coefficients = np.array([[1, -1, 0x7FFF, -0x7FFF, 0x1234, -0x1234]])
    stored = BoardMap(
        6,
        (BoardBlock(Kind.PRESSURE, Gate.YY, (1, 2, 3, 4, 5, 30), coefficients),),
        "A",
        7,
        Margin((300, 0xFFFF), (24, 0)),
    )
    halves = [1, -1, 0x7FFF, 0, 0, 0, -0x7FFF, 0x1234, -0x1234, 0, 0, 0]
    assert stored.blob == (
        bytes([3, 6, 1, 0])
        + b"A"
        + bytes(15)
        + struct.pack("<I4H", 7, 300, 24, 0xFFFF, 0)
        + bytes([7, 5, 1, 2, 3, 4, 5, 30, 0, 0, 0, 0])
    ) + struct.pack("<12h", *halves)


def test_torque_and_torsion_stand_behind_the_force_of_their_block() -> None:
    coefficients = np.arange(1, 134).reshape(19, 7)
    one = BoardBlock(Kind.BULGE, Gate.X, (1, 2, 3, 4, 5, 6, 7), coefficients)
    stored = BoardMap(7, (one, BoardBlock(Kind.OFFSET, Gate.ONE, (9,) * 7, np.arange(200, 207)[None])))
    halves = [*coefficients[:, :3].ravel(), 0, 0, 0, *coefficients[:, 3:].ravel(), 0, 0, 0, 0]
    halves += [200, 201, 202, 0, 0, 0, 203, 204, 205, 206, 0, 0, 0, 0]
    heads = bytes([3, 1, 1, 2, 3, 4, 5, 6, 7, 0, 0, 0]) + bytes([0, 0, *(9,) * 7, 0, 0, 0])
    assert stored.blob == bytes([3, 7, 2]) + bytes(21) + UNKNOWN_BYTES + heads + struct.pack(
        f"<{len(halves)}h", *halves
    )
    np.testing.assert_array_equal(from_blob(stored.blob).blocks[0].coefficients, coefficients)


def test_pairs_go_round_a_ring() -> None:
    first, second = np.triu_indices(19)
    coefficients = np.stack([19 * first + second] * 3, axis=1)
    stored = BoardMap(3, (BoardBlock(Kind.SIGNAL_PAIRS, Gate.ONE, (1, 1, 1), coefficients),))
    laid = np.frombuffer(stored.blob, "<i2", offset=44)[::3].reshape(19, 10)
    for i, row in enumerate(laid):
        pairs = [sorted((i, (i + k) % 19)) for k in range(10)]
        assert row.tolist() == [19 * a + b for a, b in pairs]
    np.testing.assert_array_equal(from_blob(stored.blob).blocks[0].coefficients, coefficients)


def test_what_a_board_would_refuse_is_refused_in_words() -> None:
    blob = random_map(2).on_board().blob
    for bad in (b"", blob[:-1], blob + b"\0", b"\2" + blob[1:], blob[:32] + b"\xff" + blob[33:]):
        with pytest.raises(InputError, match=rf"refuse this wrench map of {len(bad)} bytes .* make the map again"):
            from_blob(bad)
    with pytest.raises(InputError, match="OUT_OF_RANGE"):
        biotac.Finger(wrench_map=b"\2" + blob[1:])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"coefficients": [[2**15] * 3]}, "coefficients of OFFSET hold 32768, expected integers -32768 to 32767"),
        ({"coefficients": [[1.5] * 3]}, "coefficients of OFFSET are float64, expected integers"),
        ({"coefficients": [[1] * 4]}, r"coefficients of OFFSET have shape \(1, 4\), expected \(1, 3\)"),
        ({"exponent": (300, 0, 0)}, "cannot be stored"),
    ],
)
def test_what_would_wrap_in_a_blob_is_refused(change: dict, message: str) -> None:
    block = BoardBlock(Kind.OFFSET, Gate.ONE, (1, 1, 1), np.ones((1, 3), np.int64))
    assert BoardMap(3, (block,)).blob
    change = {name: np.array(stored) if name == "coefficients" else stored for name, stored in change.items()}
    with pytest.raises(InputError, match=message):
        _ = BoardMap(3, (dataclasses.replace(block, **change),)).blob
    for odd in ({"serial": "BT" * 9}, {"serial": "\xfc"}, {"made_s": -1}, {"made_s": 2**32}):
        with pytest.raises(InputError, match="cannot be stored"):
            _ = BoardMap(3, (block,), **odd).blob


def test_c_is_given_what_it_expects_or_nothing() -> None:
    stored = random_map(4).on_board()
    good = frames_of(1, 5)
    for k, bad in [
        (0, good[0][:, :18]), (0, good[0][0]), (1, good[1][:4]), (2, good[2][:4]), (2, good[2][:, None]),
        (0, good[0].astype(float)), (0, good[0].astype(np.int64) - 5000), (2, good[2].astype(np.int64) + 2**32),
    ]:  # fmt: skip
        spoilt = list(good)
        spoilt[k] = bad
        with pytest.raises(ValueError, match="expected"):
            stored.results(*spoilt)
        if k < 2:
            with pytest.raises(ValueError, match="expected"):
                on_board_q4(spoilt[0], spoilt[1], default_settings())
    q4 = np.full(5, 16_000, np.uint16)
    for one, other, gain_nn in [(q4, q4[:3], 1), (q4[:, None], q4, 1), (q4 / 2, q4, 1), (q4, q4, -1), (q4, q4, 2**31)]:
        with pytest.raises((ValueError, OverflowError)):
            pressure_force_100un(one, other, gain_nn)


def test_a_map_beyond_the_formats_is_refused_by_name() -> None:
    stored = random_map(3)
    huge = stored.coefficients.copy()
    huge[19:209, 1] = 1e6  # N for each pair of 500 counts
    with pytest.raises(InputError, match=r"coefficients of SIGNAL_PAIRS x ONE for Fy add up to .* larger lambda"):
        dataclasses.replace(stored, coefficients=huge).on_board()
    with pytest.raises(InputError, match="every coefficient of the map is 0"):
        dataclasses.replace(stored, coefficients=0.0 * stored.coefficients).on_board()


# ---- arithmetic --------------------------------------------------------------------------------


def test_blocks_that_are_all_zero_are_left_away_and_signals_go_into_the_split() -> None:
    whole = random_map(4, pdc=False).on_board()
    assert (Kind.SIGNAL, Gate.ONE) not in [(b.kind, b.gate) for b in whole.blocks]
    split = (Kind.COMPRESSION, Kind.BULGE, Kind.SIGNAL_PAIRS, Kind.CONDUCTANCE, Kind.CONDUCTANCE_PAIRS)
    affine = random_map(4, pdc=False, unused=split).on_board()
    assert [(b.kind, b.gate) for b in affine.blocks] == [(Kind.SIGNAL, Gate.ONE), (Kind.OFFSET, Gate.ONE)]
    assert len(affine.blob) == 32 + 2 * 12 + 2 * 3 * (20 + 2)


@pytest.mark.parametrize("axes", [3, 6, 7])
@pytest.mark.parametrize("seed", range(2))
def test_any_frame_is_within_the_proved_bound_of_float64(seed: int, axes: int) -> None:
    model = random_map(seed, axes)
    stored = model.on_board()
    frames = frames_of(seed, 3000)
    meant, off = exact(stored, *frames), bound.error_bound(stored, None, *frames)
    error = np.abs(got(stored, *frames) - meant)
    assert (error <= off).all()
    assert error.max() > 0.02 * off.max()  # the bound is about something


def test_the_integers_mean_the_fitted_map() -> None:
    model = random_map(5, 7)
    stored = model.on_board()
    counts, _, pdc_q4 = frames_of(5, 2000)
    counts = np.minimum(counts, 4095).astype(np.uint16)
    tare_q4 = tare_to_q4(np.broadcast_to(TARE, counts.shape))
    truth = model.predict(counts.astype(float), pdc_q4 / 16)
    limit = bound.error_bound(stored, model.blocks(), counts, tare_q4, pdc_q4)
    assert (np.abs(got(stored, counts, tare_q4, pdc_q4) - truth) <= limit).all()
    assert np.abs(exact(stored, counts, tare_q4, pdc_q4) - truth).max() < 1e-3 * np.abs(truth).max()


def spec_round(value: int, bits: int) -> int:
    """Half up, as SPEC.md has every cut; Python's >> is floor."""
    return (value + (1 << bits - 1)) >> bits


def spec_gates(e: list[int]) -> dict[Gate, int]:
    places = [(r[0] / 8000, r[1] / 4000) for r in ELECTRODE_UM]
    weights = [20 - min(x, 0) for x in e]
    x, y = (
        (-1 if moment < 0 else 1) * ((2 * abs(moment) + sum(weights) // 2) // sum(weights))
        for moment in (sum(w * round(4096 * p[d]) for w, p in zip(weights, places, strict=True)) for d in range(2))
    )
    both = {Gate.XX: x * x, Gate.XY: x * y, Gate.YY: y * y}
    return {Gate.X: x, Gate.Y: y, **{gate: spec_round(value, 13) for gate, value in both.items()}}


def test_the_specification_written_once_more_gives_the_same_bits() -> None:
    rng = np.random.default_rng(6)
    kinds = (Kind.OFFSET, Kind.SIGNAL, Kind.COMPRESSION, Kind.BULGE, Kind.SIGNAL_PAIRS, Kind.PRESSURE)
    blocks = tuple(
        BoardBlock(k, gate, (9, 7, 9, 8, 10, 12, 11), rng.integers(-2400, 2400, (_map.KINDS[k].columns, 7)))
        for gate in list(Gate)[1:]
        for k in kinds
    )
    stored = BoardMap(7, blocks)
    counts, tare_q4, pdc_q4 = frames_of(6, 60)
    force, torque, torsion = stored.results(counts, tare_q4, pdc_q4)
    got_q = np.column_stack([force, torque, torsion])
    place = {pair: k for k, pair in enumerate(zip(*(i.tolist() for i in np.triu_indices(19)), strict=True))}
    for row in range(60):
        e = [
            0 if wire.INVALID_COUNT in (c, t) else spec_round(16 * c - t, 2)
            for c, t in zip(counts[row].tolist(), tare_q4[row].tolist(), strict=True)
        ]
        gate = spec_gates(e)
        factors = {
            Kind.OFFSET: [2**13],
            Kind.PRESSURE: [int(pdc_q4[row]) >> 1],
            Kind.SIGNAL: e,
            Kind.COMPRESSION: [min(x, 0) for x in e],
            Kind.BULGE: [max(x, 0) for x in e],
        }
        for axis in range(7):
            total = 0
            for block in blocks:
                c = block.coefficients[:, axis].tolist()
                if block.kind == Kind.SIGNAL_PAIRS:
                    rings = [[(i + k) % 19 for k in range(10)] for i in range(19)]
                    rows = [sum(e[j] * c[place[min(i, j), max(i, j)]] for j in ring) for i, ring in enumerate(rings)]
                    value = sum(its_row * x >> 16 for its_row, x in zip(rows, e, strict=True))
                else:
                    value = sum(f * x for f, x in zip(factors[block.kind], c, strict=True))
                if block.gate != Gate.ONE:
                    value = spec_round(value, 15) * gate[block.gate]
                total += spec_round(value, block.exponent[axis])
            assert got_q[row, axis] == max(-_map.RESULT_MAX, min(_map.RESULT_MAX, total))


def test_pressure_that_is_missing_makes_results_nan_only_where_it_is_needed() -> None:
    counts, tare_q4, pdc_q4 = frames_of(7, 4)
    pdc_q4[1] = wire.INVALID_I32
    force, torque, torsion = random_map(7, 7).on_board().results(counts, tare_q4, pdc_q4)
    np.testing.assert_array_equal(torsion == wire.INVALID_I32, [False, True, False, False])
    assert (force[1] == wire.INVALID_I32).all() and (torque[1] == wire.INVALID_I32).all()
    assert (force[[0, 2, 3]] != wire.INVALID_I32).all() and (torque[[0, 2, 3]] != wire.INVALID_I32).all()
    without, torque, torsion = random_map(7, pdc=False).on_board().results(counts, tare_q4, pdc_q4)
    assert (without != wire.INVALID_I32).all() and (torque == wire.INVALID_I32).all()
    assert (torsion == wire.INVALID_I32).all()


# ---- on real and emulated fingers --------------------------------------------------------------


def fit(run: Run, lam: float) -> WrenchMap:
    """Ridge as the models have it on all columns at once; coefficients of the size that data make, held out or not."""
    signals = columns.Signals(run.counts - run.tare, run.tare, run.pdc)
    z = np.column_stack([columns.columns(signals), np.ones(len(run.counts))])
    variance = z.var(axis=0)
    penalty = lam * len(z) * np.maximum(variance, models.COLUMN_FLOOR * np.median(variance[:-1]))
    penalty[-1] = 0.0
    coefficients = np.linalg.solve(z.T @ z + np.diag(penalty), z.T @ run.truth)
    return WrenchMap("all", run.axes, run.tare, 1, (0,) * len(run.axes), coefficients)


# Less ridge than 1e-4 makes coefficients there that no board holds at full scale: refused in words, see below.
@pytest.mark.parametrize("lam", [1e-4, pytest.param(1e-2, marks=pytest.mark.nightly)])
def test_on_the_emulated_sensor_every_row_is_right_force_and_torque(tmp_path: Path, lam: float) -> None:
    path = wrench_run.save(tmp_path / "run.npz", wrench_run.fields(6000, 3, moment=True, pdc=True))
    run = load_run(path)
    facts = bound.summary(fit(run, lam), run.counts, run.pdc)
    assert facts["rows"] == 6000 and facts["outside"] == 0
    assert facts["force_mn_max"] <= facts["force_mn_bound"] and facts["force_mn_rms"] <= FORCE_MN
    assert facts["torque_nmm_max"] <= facts["torque_nmm_bound"] and facts["torque_nmm_rms"] <= TORQUE_NMM
    assert "on all 6000 rows" in bound.summary_text(facts)


@pytest.mark.parametrize("lam", [1e-5, pytest.param(1e-2, marks=pytest.mark.nightly)])
def test_on_a_real_finger_every_row_is_right(lam: float, shared_data: Path) -> None:
    run = load_run(shared_data / "syntouchcontact" / "F1.npz")
    facts = bound.summary(fit(run, lam), run.counts, run.pdc)
    assert facts["rows"] == len(run.counts) and facts["outside"] == 0
    assert facts["force_mn_max"] <= facts["force_mn_bound"] and facts["force_mn_rms"] <= FORCE_MN


def test_a_map_that_no_board_can_hold_is_told_and_not_raised(tmp_path: Path) -> None:
    run = load_run(wrench_run.save(tmp_path / "run.npz", wrench_run.fields(4000, 4)))
    model = fit(run, 1e-3)
    facts = bound.summary(dataclasses.replace(model, coefficients=1e9 * model.coefficients), run.counts)
    assert "add up to" in facts["refused"] and facts["refused"] in bound.summary_text(facts)
    json.dumps(facts)


# ---- frames ------------------------------------------------------------------------------------


def mapped_frames(stored: BoardMap | None, *, pdc: int = 2000) -> np.ndarray:
    rng = np.random.default_rng(8)
    counts = np.rint(TARE + np.concatenate([np.zeros((60, 19)), rng.normal(-150.0, 90.0, (200, 19))])).astype(np.uint16)
    slow = np.full(len(counts), 2000, np.uint16)
    slow_pdc = np.where(np.arange(len(counts)) < 60, 2000, pdc).astype(np.uint16)
    pac, t_us = np.repeat(slow[:, None], 22, axis=1), np.arange(len(counts)) * 10_000
    rounds = FingerRounds(3, counts, slow_pdc, slow, slow, pac, t_us, wrench_map=stored)
    return frames_and_tares(rounds, default_settings())[0]


def checked(frames: np.ndarray, maps: Mapping[int, bytes | BoardMap]) -> CrossCheck:
    outcome = CrossCheck()
    outcome.add(frames, default_settings(), maps=maps)
    return outcome


@pytest.mark.parametrize("axes", [3, 6, 7])
def test_a_finger_with_a_map_publishes_it_and_the_check_agrees(axes: int) -> None:
    stored = random_map(11, axes).on_board()
    frames = mapped_frames(stored, pdc=2120)
    plain = mapped_frames(None, pdc=2120)
    tared = (frames["flags"] & wire.FrameFlags.UNTARED) == 0
    mapped = (frames["flags"] & wire.FrameFlags.MAPPED) != 0
    np.testing.assert_array_equal(mapped, tared)
    assert not (plain["flags"] & wire.FrameFlags.MAPPED).any() and tared.sum() > 200
    pressure = board_map.pdc_above_rest_q4(frames)
    force, torque, torsion = stored.results(frames["counts"], frames["tare_q4"], pressure)
    np.testing.assert_array_equal(frames["force_100un"][mapped], force[mapped])
    published = torque if axes > 3 else plain["torque_mnmm"]
    np.testing.assert_array_equal(frames["torsion_mnmm"][mapped], torsion[mapped])
    np.testing.assert_array_equal(frames["torsion_mnmm"] != wire.INVALID_I32, mapped & (axes == 7))
    np.testing.assert_array_equal(frames["torque_mnmm"][mapped, 1:], published[mapped, 1:])
    np.testing.assert_array_equal(frames["poc_um"], plain["poc_um"])
    outcome = checked(frames, {3: stored.blob})
    assert outcome.violations == 0 and outcome.mapped == mapped.sum() and outcome.frames == len(frames)
    assert 0.0 < outcome.force_mn_max <= outcome.mapped_force_mn_bound
    assert outcome.as_dict()["force_mn_bound"] == outcome.mapped_force_mn_bound


def test_the_check_finds_a_wrong_force_another_map_and_no_map() -> None:
    stored = random_map(12).on_board()
    frames = mapped_frames(stored)
    wrong = frames.copy()
    wrong["force_100un"][100, 1] += 4000  # 0.4 N
    outcome = checked(wrong, {3: stored})
    assert outcome.violations >= 1 and "finger 3 frame" in outcome.findings[0] and "force y" in outcome.findings[0]
    assert checked(frames, {3: random_map(13).on_board()}).violations > 200
    none = checked(frames, {2: stored})
    assert none.violations == (frames["flags"] & wire.FrameFlags.MAPPED).astype(bool).sum()
    assert "map is unknown" in none.findings[0]


def test_the_check_finds_a_wrong_torsion_and_one_that_no_map_gives() -> None:
    stored = random_map(17, 7).on_board()
    frames = mapped_frames(stored)
    for value, seen in (
        (frames["torsion_mnmm"][100] + 900, "torsion off by 0."),
        (wire.INVALID_I32, "torsion is valid"),
    ):
        wrong = frames.copy()
        wrong["torsion_mnmm"][100] = value
        outcome = checked(wrong, {3: stored})
        assert outcome.violations == 1 and seen in outcome.findings[0]
    plain = mapped_frames(None)
    plain["torsion_mnmm"][100] = 0
    outcome = checked(plain, {})
    assert outcome.violations == 1 and "torsion is valid on one side only" in outcome.findings[0]


@pytest.mark.parametrize("axes", [3, 6, 7])
def test_kernels_over_recorded_frames_give_the_same_frames(axes: int) -> None:
    stored = random_map(14, axes).on_board()
    frames = mapped_frames(stored)
    frames = frames[(frames["flags"] & wire.FrameFlags.MAPPED) != 0]
    poc, force, torque, torsion, flags = board_map.on_board_q4(frames, default_settings(), stored)
    np.testing.assert_array_equal(poc, frames["poc_um"])
    np.testing.assert_array_equal(force, frames["force_100un"])
    np.testing.assert_array_equal(torque, frames["torque_mnmm"])
    np.testing.assert_array_equal(torsion, frames["torsion_mnmm"])
    np.testing.assert_array_equal(flags, frames["flags"] & (wire.FrameFlags.POC_INVALID | wire.FrameFlags.OUTSIDE))


def test_a_fitted_maps_file_makes_the_same_blob(tmp_path: Path) -> None:
    model = random_map(15)
    path = tmp_path / "thumb.wrench.json"
    path.write_text(file.dumps_fitted(model, serial="BT1", made_s=7), encoding="utf-8")
    fitted = file.load_fitted(path)
    np.testing.assert_array_equal(fitted.coefficients, model.coefficients)
    assert file.load(path) == fitted.on_board(serial="BT1", made_s=7).blob


@pytest.mark.parametrize("axes", [3, 6, 7])
def test_compute_agrees_with_the_boards_frames(axes: int) -> None:
    stored = random_map(16, axes).on_board()
    frames = mapped_frames(stored, pdc=2100)
    frames = frames[(frames["flags"] & wire.FrameFlags.MAPPED) != 0][50:]
    pressure = board_map.pdc_above_rest_q4(frames) / 16
    tare = frames["tare_q4"] / 16
    results = biotac.compute(frames["counts"], tare, wrench_map=stored.blob, pdc_above_rest=pressure)
    np.testing.assert_allclose(results["force_n"], frames["force_100un"] / 1e4, atol=3e-2)
    np.testing.assert_allclose(results["torque_nmm"], frames["torque_mnmm"] / 1e3, atol=0.3)
    assert results.dtype == biotac.MAPPED_RESULT_DTYPE and np.isnan(results["torsion_nmm"]).all() == (axes < 7)
    if axes == 7:
        np.testing.assert_allclose(results["torsion_nmm"], frames["torsion_mnmm"] / 1e3, atol=3e-2)
    for name in ("normal_n", "normal_half_n", "shear_n", "shear_half_n"):
        sent = np.where(frames[name[:-1] + "mn"] == 0xFFFF, np.nan, frames[name[:-1] + "mn"] / 1e3)
        np.testing.assert_allclose(results[name], sent, atol=5e-2)
    plain = biotac.compute(frames["counts"], tare)
    np.testing.assert_array_equal(results["poc_mm"], plain["poc_mm"])
    if axes == 3:
        np.testing.assert_array_equal(results["torque_nmm"][:, 1:], plain["torque_nmm"][:, 1:])
    one = biotac.compute(frames["counts"][7], tare[7], wrench_map=stored, pdc_above_rest=pressure[7])
    assert one.shape == ()
    np.testing.assert_allclose(one["force_n"], results["force_n"][7], rtol=1e-12)  # NumPy sums in another order
    again = np.zeros(len(frames), biotac.MAPPED_RESULT_DTYPE)
    assert biotac.compute(frames["counts"], tare, out=again, wrench_map=stored, pdc_above_rest=pressure) is again
    assert again.tobytes() == results.tobytes()
    with pytest.raises(ValueError, match="expected a contiguous, writeable MAPPED_RESULT_DTYPE of shape"):
        biotac.compute(frames["counts"], tare, out=plain, wrench_map=stored, pdc_above_rest=pressure)
    missing = biotac.compute(frames["counts"], tare, wrench_map=stored)
    assert np.isnan(missing["force_n"]).all() and not np.isnan(missing["poc_mm"]).any()
    with pytest.raises(ValueError, match=r"pdc_above_rest has shape \(3,\), expected"):
        biotac.compute(frames["counts"], tare, wrench_map=stored, pdc_above_rest=pressure[:3])
