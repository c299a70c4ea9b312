"""The population map end to end: the board's core beside float64, and which map takes precedence."""

from dataclasses import replace

import numpy as np
from courses import Pose, script

import biotac
from biotac.calibrate import population as population_map
from biotac.core.finger import Finger
from biotac.kernels.compiled import c_pointers, on_board_q4
from biotac.map import population
from biotac.map.board_map import BoardMap
from biotac.map.bound import error_bound
from biotac.map.float64 import replace_gains
from biotac.map.published import published
from biotac.recording.crosscheck import CrossCheck
from biotac.wire import messages_gen as wire
from biotac.wire.native import ffi, lib

POPULATION = {wire.Setting.FORCE_MODEL: int(wire.ForceModel.POPULATION)}
LIN = {wire.Setting.FORCE_MODEL: int(wire.ForceModel.LIN)}
TARE = np.linspace(2500.0, 3200.0, 19).round()


#: A flat plate on the middle of the pad: the pad under it is compressed, the sides bulge.
PLATE = [300, 0, 100, 300, 100, 300, -100, -200, -200, -400, 300, 0, 100, 300, 100, 300, -800, 0, 100]


def pressed(n: int, seed: int) -> np.ndarray:
    """Counts (n, 19): from a breath to a slam, over one electrode to all of them; every other one by a plate."""
    rng = np.random.default_rng(seed)
    size = 10 ** rng.uniform(0.5, 3.2, (n, 1))
    width = rng.uniform(0.3, 12.0, (n, 1))
    along = np.abs(np.arange(19) - rng.integers(0, 19, (n, 1)))
    e = -size * np.exp(-((along / width) ** 2)) * rng.uniform(-0.3, 1.0, (n, 19))
    e[::2] = rng.uniform(0.1, 1.3, (len(e[::2]), 1)) * PLATE + rng.normal(0.0, 10.0, e[::2].shape)
    return np.clip(TARE + e, 0, 4095).astype(np.uint16)


def judged(counts: np.ndarray, own: BoardMap | None = None) -> population.Likeness:
    tare_q4 = np.broadcast_to((16 * TARE).astype(np.uint16), counts.shape)
    return population.likeness(counts - TARE, population.board_force_100un(counts, tare_q4, own))


def rows_of(settings: dict, counts: np.ndarray, wrench_map: BoardMap | None = None) -> np.ndarray:
    finger = Finger(settings, quantities=wire.QuantityFlags(0x7F), wrench_map=wrench_map)
    rest = np.tile(TARE.astype(int), (50, 1))
    finger.feed(rest)
    finger.set_tare(TARE)
    finger.feed(rest)  # with which the board compares it
    finger.hold()
    return finger.feed(counts)


def test_it_is_the_trained_map_to_what_16_bits_leave_and_along_the_normals() -> None:
    counts = pressed(4000, 1)
    judgement = judged(counts)
    assert (judgement.share == population.ALL).sum() > 20
    assert ((judgement.share > 0) & (judgement.share < population.ALL)).sum() > 20
    got = biotac.compute(counts, TARE, POPULATION)["force_n"]
    trained = population_map.load(None).population
    # shares differ by a step where the board's map is rounded over it
    step = np.abs(trained.force(counts, TARE) - judgement.otherwise_n) / population.ALL
    step[(judgement.share == 0) | (judgement.share == population.ALL)] = 0.0
    assert (np.abs(got - trained.published(counts, TARE)) <= step + 1e-9).all()


def test_where_no_rounding_decides_the_share_is_a_boards() -> None:
    """compute() equals the board's map within the roundings, which are bounded frame by frame."""
    rng, columns, force = np.random.default_rng(9), population.compiled_coefficients(), ffi.new("double[3]")
    counts = np.concatenate([pressed(8000, 8), pressed(8000, 9)])
    counts[8000:][rng.random((8000, 19)) < 0.3] = 4095
    counts[8000:][rng.random((8000, 19)) < 0.3] = 0
    judgement, tare_q4 = judged(counts), np.broadcast_to((16 * TARE).astype(np.uint16), counts.shape)
    rounded = [
        lib.bt_map_force(columns, *c_pointers(e_q4), strength, force)
        for e_q4, strength in zip(
            16 * counts.astype(np.int32) - tare_q4, judgement.strength_100un.tolist(), strict=True
        )
    ]
    nothing, trained = np.zeros(len(counts), np.int32), population.unrounded(population.blocks())
    bound = 1e4 * error_bound(population.on_board(), trained, counts, tare_q4, nothing).max(axis=1)
    assert (bound <= rounded)[judgement.share > 0].all()
    got, margin = biotac.compute(counts, TARE), population.margin()
    parts = np.column_stack([got["normal_n"], got["shear_n"]])
    wanted = judgement.guess_n + margin.half_n(parts) + population.unfelt_n(parts, got["poc_mm"])
    np.testing.assert_allclose(np.column_stack([got["normal_half_n"], got["shear_half_n"]]), wanted, rtol=1e-12)


def test_the_board_keeps_the_bound_and_says_what_it_did() -> None:
    outcome = CrossCheck()
    for seed in range(5):
        rows = rows_of(POPULATION, pressed(4000, seed))
        assert (rows["flags"] & wire.FrameFlags.POPULATION).all()
        outcome.add(rows, population_settings())
    assert outcome.violations == 0, outcome.findings
    assert outcome.force_mn_max > 0.1
    facts = outcome.as_dict()
    assert facts["force_mn_max"] <= facts["force_mn_bound"]


def test_a_fingers_own_map_of_its_blocks_is_judged_alike() -> None:
    """By the integers, by float64 and by `biotac check`; corrections by presses stay."""
    trained, counts = population_map.load(None).population, pressed(4000, 2)
    own = replace(trained, coefficients=1.2 * trained.coefficients).wrench_map(TARE).on_board()
    rows, plain = rows_of({}, counts, own), rows_of(POPULATION, counts)
    outcome = CrossCheck()
    outcome.add(rows, population_settings(), maps={0: own})
    assert outcome.violations == 0 and outcome.mapped == len(counts), outcome.findings
    by_map, outside = (rows["flags"] & flag != 0 for flag in (wire.FrameFlags.MAPPED, wire.FrameFlags.OUTSIDE))
    assert by_map.all() and 400 < outside.sum() < 3900
    firm = (judged(counts).share == population.ALL) & (judged(counts, own).share == population.ALL)
    np.testing.assert_allclose(rows["force_100un"][firm], 1.2 * plain["force_100un"][firm], rtol=0.02, atol=100)
    far = (np.abs(rows["force_100un"]).max(axis=1) > 3 * np.abs(plain["force_100un"]).max(axis=1)) & ~firm
    assert not far.any()
    got = biotac.compute(counts, TARE, wrench_map=own)
    whole = rows["electrodes_out"] == 0
    known = whole & ~np.isnan(got["normal_half_n"]) & (rows["normal_half_mn"] != wire.INVALID_COUNT)
    np.testing.assert_allclose(got["force_n"][whole], rows["force_100un"][whole] / 1e4, atol=0.02)
    assert np.median(np.abs(got["normal_half_n"] - rows["normal_half_mn"] / 1e3)[known]) < 0.01
    rows["flags"][np.flatnonzero(outside)[0]] &= ~np.uint32(wire.FrameFlags.OUTSIDE)
    outcome.add(rows, population_settings(), maps={0: own})
    assert outcome.violations == 1


def population_settings() -> dict:
    return {s: spec.default for s, spec in wire.SETTINGS.items()} | POPULATION


def test_a_wrong_flag_and_a_wrong_force_are_found() -> None:
    rows = rows_of(POPULATION, pressed(100, 3))
    rows["flags"][5] ^= wire.FrameFlags.OUTSIDE
    rows["force_100un"][7, 2] += 30000
    outcome = CrossCheck()
    outcome.add(rows, population_settings())
    assert outcome.violations == 2, outcome.findings


def test_own_gains_take_precedence() -> None:
    counts = pressed(200, 4)
    own = {wire.Setting.FORCE_GAIN_Z_NN: 2_000_000}
    rows = rows_of(POPULATION | own, counts)
    assert not (rows["flags"] & (wire.FrameFlags.POPULATION | wire.FrameFlags.OUTSIDE)).any()
    assert not population.in_force(POPULATION | own)
    np.testing.assert_array_equal(
        biotac.compute(counts, TARE, POPULATION | own)["force_n"], biotac.compute(counts, TARE, own)["force_n"]
    )


def test_the_interval_is_the_maps_margin_and_grows_away_from_the_training() -> None:
    counts = pressed(4000, 6)
    rows, judgement = rows_of(POPULATION, counts), judged(counts)
    np.testing.assert_array_equal(rows["flags"] & wire.FrameFlags.OUTSIDE != 0, judgement.outside)
    known = rows["normal_mn"] != wire.INVALID_COUNT
    parts = np.column_stack([rows["normal_mn"], rows["shear_mn"]])[known] / 1e3
    half = np.column_stack([rows["normal_half_mn"], rows["shear_half_mn"]])[known] / 1e3
    strength_n = judgement.strength_100un[:, None] / 1e4
    away_n = strength_n * (1 - judgement.share / population.ALL)[:, None]
    guess = np.where(judgement.outside[:, None], strength_n, away_n * [179 / 256, 0.3])
    base, share = (np.array(one) for one in (population.margin().base_mn, population.margin().share_q8))
    out = np.array([mask.bit_count() for mask in rows["electrodes_out"][known].tolist()])[:, None]  # such jumps condemn
    wanted = base / 1e3 + parts.sum(axis=1, keepdims=True) * (share / 256 + out / 16) + guess[known]
    pull, x_mm = (parts[:, 1] - parts[:, 0] / 5).clip(0.0) * 5 / 8, rows["poc_um"][known, 0].clip(0) / 1e3
    light = (1.5 - parts.sum(axis=1)).clip(0.0)
    wanted[:, 0] += pull * x_mm / 4.096 + 51 / 256 * parts[:, 0] * x_mm.clip(max=2.048) / 2.048 + light / 2
    wanted[:, 1] += pull * x_mm / 4.096 + pull
    assert (pull[x_mm > 0] > 0).any() and (light > 0).any() and (pull == 0).any()
    assert (judgement.share == population.ALL).any() and judgement.outside.any()
    # The share is that of a board, with a rounded map and so a rounded reading of an electrode that is out: three
    # steps of it are 3/256 of 0.7 of the strength. Each of the five terms is cut to a mN.
    assert (np.abs(half - wanted) <= 5e-3 + 2e-3 * wanted + 2.1 * strength_n[known] / population.ALL).all()


def test_the_interval_holds_an_edge_that_pressure_feels_and_electrodes_hardly() -> None:
    course = script(7).load(4.0, 8.0, Pose(-8.0, 0.0, tip_mm=0.5)).hold(0.3).make()
    halved = {wire.Setting.PRESSURE_GAIN_NN: 5_000_000}  # half a force for a count of pressure
    rows = [course.run(), course.run(halved), course.run(pdc=False)]
    normal, half = (np.median([each[name][-20:] for each in rows], axis=1) for name in ("normal_mn", "normal_half_mn"))
    assert (normal < 100).all() and half[2] < 3000 and 4000 < half[0] < 10000
    assert half[1] - half[2] < (half[0] - half[2]) / 2


def test_torque_x_follows_the_force_and_the_rest_stays() -> None:
    counts = pressed(300, 7)
    lin, new = (biotac.compute(counts, TARE, {wire.Setting.FORCE_MODEL: model}) for model in (0, 1))
    c, f = new["poc_mm"], new["force_n"]
    np.testing.assert_array_equal(new["poc_mm"], lin["poc_mm"])
    np.testing.assert_array_equal(new["torque_nmm"][:, 1:], lin["torque_nmm"][:, 1:])
    np.testing.assert_allclose(new["torque_nmm"][:, 0], c[:, 1] * f[:, 2] - c[:, 2] * f[:, 1], atol=1e-9)


def test_one_frame_and_a_live_stream_are_as_many() -> None:
    counts = pressed(5, 8)
    every = biotac.compute(counts, TARE, POPULATION)
    live = biotac.per_frame(TARE, POPULATION)
    for k in range(5):
        for name in every.dtype.names:
            np.testing.assert_array_equal(biotac.compute(counts[k], TARE, POPULATION)[name], every[name][k])
            np.testing.assert_array_equal(live(counts[k])[name], every[name][k])


def test_it_is_what_nobody_chose_and_lins_of_gains_that_somebody_did() -> None:
    counts = pressed(50, 10)
    default, population_s = biotac.compute(counts, TARE), biotac.compute(counts, TARE, POPULATION)
    np.testing.assert_array_equal(default, population_s)
    assert np.abs(default["force_n"] - biotac.compute(counts, TARE, LIN)["force_n"]).max() > 0.5
    rows = rows_of({}, counts)
    assert (rows["flags"] & wire.FrameFlags.POPULATION).all()
    assert not (rows_of(LIN, counts)["flags"] & wire.FrameFlags.POPULATION).any()


def test_compute_is_the_float64_that_boards_are_held_against() -> None:
    """The formulas stand twice: in C for speed, and in NumPy as training makes the columns."""
    counts = np.vstack([pressed(3000, seed) for seed in (11, 12)])
    counts[np.random.default_rng(13).random(counts.shape) < 0.01] = wire.INVALID_COUNT
    tare_q4 = np.broadcast_to((16 * TARE).astype(np.uint16), counts.shape)
    lin = biotac.compute(counts, TARE, LIN)
    wanted = {name: lin[name].copy() for name in lin.dtype.names}
    trained, no_pdc = population.unrounded(population.blocks()), np.zeros(len(counts), np.int32)
    wrench, _ = published(population.on_board(), counts, tare_q4, no_pdc, trained)
    gains = (wanted[name] for name in ("poc_mm", "force_n", "torque_nmm"))
    replace_gains(population.on_board(), wrench, *gains, np.empty(len(counts)))
    got = biotac.compute(counts, TARE)
    for name in ("poc_mm", "force_n", "torque_nmm"):
        np.testing.assert_allclose(got[name], wanted[name], rtol=0, atol=1e-9)


def test_missing_electrodes_are_at_rest() -> None:
    counts = pressed(50, 9)
    counts[:, 4] = wire.INVALID_COUNT
    whole = counts.copy()
    whole[:, 4] = TARE[4]
    q4 = np.broadcast_to((16 * TARE).astype(np.uint16), counts.shape)
    for a, b in zip(
        on_board_q4(counts, q4, population_settings()), on_board_q4(whole, q4, population_settings()), strict=True
    ):
        np.testing.assert_array_equal(a, b)
    np.testing.assert_array_equal(
        biotac.compute(counts, TARE, POPULATION)["force_n"], biotac.compute(whole, TARE, POPULATION)["force_n"]
    )
