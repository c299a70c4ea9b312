"""biotac.compute: the float64 reference for any counts and memory layout; tests/crosscheck judges the formulas."""

import numpy as np
import pytest
from core_in_units import on_board, reference
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import biotac
from biotac import FRAME_DTYPE, RESULT_DTYPE, PocWeights, Setting
from biotac.core.compute import per_frame
from biotac.kernels.compiled import default_settings
from biotac.map import population, published_parts
from biotac.recording.crosscheck import FORCE_BOUND_MN, POC_BOUND_UM
from biotac.wire import messages_gen as wire

MISSING = 0xFFFF
WEIGHTS = list(PocWeights)
LIN = {Setting.FORCE_MODEL: wire.ForceModel.LIN}  # whom the reference knows; test_population_force has the default
GAIN_MAX = 100_000_000  # nN/count, the largest setting


def with_weights(weights: PocWeights, gain_nn: int | None = None) -> dict[Setting, int]:
    chosen = default_settings() | LIN | {Setting.POC_WEIGHTS: int(weights)}
    if gain_nn is not None:
        chosen |= {s: gain_nn for s in Setting if "GAIN" in s.name}
    return chosen


def agrees(counts, tare, chosen=None, **given) -> np.ndarray:
    got = biotac.compute(counts, tare, LIN if chosen is None else chosen, **given)
    want = reference(counts, tare, chosen)
    assert got.dtype == RESULT_DTYPE
    assert got.shape == np.shape(counts)[:-1]
    for name in want._fields:
        np.testing.assert_array_equal(got[name], getattr(want, name).reshape(got[name].shape))
    parts = published_parts(want.force_n, want.poc_mm).reshape(*got.shape, 2)
    for name, part in zip(("normal_n", "shear_n"), np.moveaxis(parts, -1, 0), strict=True):
        np.testing.assert_allclose(got[name], part, rtol=1e-9, atol=1e-9 * (1 + np.abs(want.force_n).max(initial=0)))
    return got


def random_counts(n: int, seed: int = 1, missing: float = 0.0) -> np.ndarray:
    random = np.random.default_rng(seed)
    counts = random.integers(0, 4096, (n, 19)).astype(np.uint16)
    counts[random.random((n, 19)) < missing] = MISSING
    return counts


TARE = np.random.default_rng(7).uniform(0, 4095, 19)


@pytest.mark.parametrize("weights", WEIGHTS)
@pytest.mark.parametrize(("missing", "gain_nn"), [(0.0, None), (0.001, GAIN_MAX), (0.3, -GAIN_MAX)])
def test_random_recordings_agree_with_the_reference(weights, missing, gain_nn) -> None:
    agrees(random_counts(3000, missing=missing), TARE, with_weights(weights, gain_nn))


@pytest.mark.parametrize("weights", WEIGHTS)
def test_no_weight_is_no_point_of_contact(weights) -> None:
    got = agrees(np.full((2, 19), 2000), np.full(19, 2000.0), with_weights(weights))
    assert np.isnan(got["poc_mm"]).all()
    assert np.isnan(got["torque_nmm"][:, 0]).all()
    assert not got["torque_nmm"][:, 1:].any()
    assert not got["force_n"].any()


@settings(max_examples=100, deadline=None)
@given(
    counts=arrays(
        np.uint16, st.tuples(st.integers(0, 40), st.just(19)), elements=st.integers(0, 4095) | st.just(MISSING)
    ),
    tare=arrays(np.float64, 19, elements=st.floats(0, 4095)),
    weights=st.sampled_from(WEIGHTS),
    gain_nn=st.integers(-GAIN_MAX, GAIN_MAX),
)
def test_any_counts_and_any_tare(counts, tare, weights, gain_nn) -> None:
    agrees(counts, tare, with_weights(weights, gain_nn))


@pytest.mark.parametrize("n", [0, 1, 17])
def test_a_frame_does_not_depend_on_its_neighbours(n) -> None:
    counts = random_counts(n, seed=n, missing=0.01)
    tares = np.random.default_rng(n).uniform(0, 4095, (n, 19))
    for tare in (TARE, tares):
        for chosen in (LIN, None):
            together = biotac.compute(counts, tare, chosen)
            for k in range(n):
                alone = biotac.compute(counts[k], tare if tare is TARE else tare[k], chosen)
                assert alone.tobytes() == together[k].tobytes()
        agrees(counts, tare)


def test_a_tare_is_rounded_as_on_the_board() -> None:
    """Halfway between two sixteenths goes up, and never to another result than the board's."""
    counts = random_counts(500)
    halfway = np.floor(TARE * 16) / 16 + 1 / 32
    assert np.array_equal(biotac.compute(counts, halfway), biotac.compute(counts, np.floor(TARE * 16 + 1) / 16))
    for tare in (TARE, halfway):
        got, board = biotac.compute(counts, tare, LIN), on_board(counts, tare, LIN)
        assert np.linalg.norm(got["poc_mm"] - board.poc_mm, axis=1).max() * 1e3 <= POC_BOUND_UM
        assert np.abs(got["force_n"] - board.force_n).max() * 1e3 <= FORCE_BOUND_MN


def test_no_frames_and_no_tare() -> None:
    """Nothing is read of an array without rows, whatever the strides are."""
    nothing = np.lib.stride_tricks.as_strided(np.full(19, -1.0), shape=(0, 19), strides=(0, 8))
    assert biotac.compute(np.zeros((0, 19), np.uint16), nothing).shape == (0,)


def test_memory_in_any_order() -> None:
    counts = random_counts(50)
    want = biotac.compute(counts, TARE)
    frames = np.zeros(50, FRAME_DTYPE)  # rows at odd addresses
    frames["counts"] = counts
    wide = np.zeros((100, 40), np.uint16)
    wide[::2, 1:39:2] = counts
    for same in (frames["counts"], wide[::2, 1:39:2], np.asfortranarray(counts), counts.astype(">u2"), counts.tolist()):
        assert np.array_equal(biotac.compute(same, TARE), want, equal_nan=False)
    assert np.array_equal(biotac.compute(counts[::-1], TARE), want[::-1])
    assert np.array_equal(biotac.compute(frames["counts"][3], TARE.tolist()), want[3])
    counts.flags.writeable = False
    assert np.array_equal(biotac.compute(counts, np.broadcast_to(TARE, (50, 19))), want)
    assert np.array_equal(biotac.compute(counts, np.tile(TARE, (50, 2))[:, :19]), want)
    assert np.array_equal(biotac.compute(counts, np.repeat(TARE, 2)[::2]), want)
    one = np.broadcast_to(counts[0], (20, 19))
    assert np.array_equal(biotac.compute(one, TARE), np.repeat(want[:1], 20))


def test_tares_of_other_types() -> None:
    counts = random_counts(20)
    for tare in (TARE.astype(np.float32), TARE.astype(np.int64), np.floor(TARE).astype(np.uint8), TARE.astype(">f8")):
        agrees(counts, tare)


def test_out_is_filled_and_returned() -> None:
    for n in (1, 3):
        counts = random_counts(n)
        out = np.zeros(n, RESULT_DTYPE)
        assert biotac.compute(counts, TARE, out=out) is out
        assert out.tobytes() == biotac.compute(counts, TARE).tobytes()
        assert biotac.compute(counts[::-1], TARE, out=out) is out
        assert np.array_equal(out, biotac.compute(counts[::-1], TARE))
    single = np.zeros((), RESULT_DTYPE)
    assert biotac.compute(counts[0], TARE, out=single) is single
    assert single.tobytes() == biotac.compute(counts[:1], TARE).tobytes()


def test_an_out_that_does_not_fit_is_refused() -> None:
    read_only = np.zeros(3, RESULT_DTYPE)
    read_only.flags.writeable = False
    for out in (np.zeros(2, RESULT_DTYPE), np.zeros((), RESULT_DTYPE), np.zeros((3, 9)), read_only):
        with pytest.raises(ValueError, match=r"expected a contiguous, writeable RESULT_DTYPE of shape \(3,\)"):
            biotac.compute(random_counts(3), TARE, out=out)
    with pytest.raises(ValueError, match="contiguous"):
        biotac.compute(random_counts(3), TARE, out=np.zeros(6, RESULT_DTYPE)[::2])
    frozen = np.zeros((), RESULT_DTYPE)
    frozen.flags.writeable = False
    for out in (frozen, np.zeros(1, RESULT_DTYPE)):
        with pytest.raises(ValueError, match="writeable"):
            biotac.compute(random_counts(1)[0], TARE, out=out)


@pytest.mark.parametrize("n", [1, 3])
@pytest.mark.parametrize("value", [4096, 0xFFFE])
def test_a_count_out_of_range_is_named_with_its_row(n, value) -> None:
    for row in range(n):
        counts = random_counts(n, missing=0.02)
        counts[row, 6] = value
        counts[row + 1 :, 3] = 5000
        with pytest.raises(ValueError, match=rf"counts of row {row} have E7 = {value}, expected 0\.\.4095, or 65535"):
            biotac.compute(counts, TARE)
    with pytest.raises(ValueError, match=rf"the counts have E7 = {value}, expected"):
        biotac.compute(counts[n - 1], TARE)


@pytest.mark.parametrize("value", [-1, 70000])
def test_wide_integers_are_not_wrapped(value) -> None:
    counts = random_counts(20).astype(np.int64)
    counts[17, 18] = value
    with pytest.raises(ValueError, match=rf"counts of row 17 have E19 = {value}, expected"):
        biotac.compute(counts, TARE)
    with pytest.raises(ValueError, match=rf"the counts have E19 = {value}, expected"):
        biotac.compute(counts[17].tolist(), TARE)


@pytest.mark.parametrize("value", [-0.001, 4095.001, np.nan])
def test_a_tare_out_of_range_is_named_with_its_row(value) -> None:
    counts = random_counts(40)
    for row in (0, 39):
        tares = np.tile(TARE, (40, 1))
        tares[row, 4] = value
        with pytest.raises(ValueError, match=rf"tare of row {row} has E5 = {value}, expected 0\.\.4095"):
            biotac.compute(counts, tares)
    for some in (counts, counts[:0], counts[0]):
        with pytest.raises(ValueError, match=rf"the tare has E5 = {value}, expected 0\.\.4095"):
            biotac.compute(some, tares[row])
    with pytest.raises(ValueError, match=rf"the tare has E5 = {value}, expected"):
        per_frame(tares[row])


@pytest.mark.parametrize(
    ("counts", "tare", "message"),
    [
        (np.zeros((2, 18), np.uint16), TARE, r"counts have shape \(2, 18\), expected \(n, 19\) or \(19,\)"),
        ([], TARE, "counts have shape"),
        (np.zeros((2, 19)), TARE, "counts are float64, expected integers"),
        (np.zeros((2, 19), bool), TARE, "counts are bool"),
        (np.zeros((2, 19), np.uint16), 2000.0, r"tare has shape \(\), expected \(19,\) or \(2, 19\)"),
        (np.zeros((2, 19), np.uint16), np.zeros((3, 19)), "tare has shape"),
        (np.zeros(19, np.uint16), np.zeros((1, 19)), "tare has shape"),
        (np.zeros(19, np.uint16), np.zeros(19, complex), "tare is complex128, expected numbers"),
        (np.zeros(19, np.uint16), [None] * 19, "tare is object"),
    ],
)
def test_wrong_shapes_and_types_are_refused(counts, tare, message) -> None:
    with pytest.raises(ValueError, match=message):
        biotac.compute(counts, tare)


def test_settings() -> None:
    counts = random_counts(20)
    doubled = {Setting.FORCE_GAIN_Z_NN: 2 * default_settings()[Setting.FORCE_GAIN_Z_NN]}
    plain, changed = biotac.compute(counts, TARE, LIN), biotac.compute(counts, TARE, doubled)
    assert np.array_equal(changed["force_n"][:, 2], 2 * plain["force_n"][:, 2])
    assert np.array_equal(changed["poc_mm"], plain["poc_mm"])
    for setting, value in ((Setting.POC_WEIGHTS, 3), (Setting.FORCE_GAIN_X_NN, GAIN_MAX + 1)):
        with pytest.raises(ValueError, match=f"{setting.name} is {value}, expected"):
            biotac.compute(counts, TARE, {setting: value})


def test_one_frame_per_call() -> None:
    counts = random_counts(30, missing=0.05)
    chosen = with_weights(PocWeights.ABS_N2)
    want = biotac.compute(counts, TARE, chosen)
    results = per_frame(TARE, chosen)
    for row, expected in zip(counts, want, strict=True):
        assert results(row).tobytes() == expected.tobytes()
    assert results(counts[0]) is results(counts[1])
    for wrong in (counts[:1], counts[0].astype(int), counts[0, :18], counts[0].tolist()):
        with pytest.raises(ValueError, match=r"expected uint16 of shape \(19,\)"):
            results(wrong)
    counts[0, 0] = 4096
    with pytest.raises(ValueError, match="E1 = 4096"):
        results(counts[0])


def read_from(*changes: tuple[Setting, int]) -> tuple[np.ndarray, dict[Setting, int]]:
    with biotac.open("sim:press.toml") as hand:
        for setting, value in changes:
            hand.board.set_setting(setting, value)
        return hand.read(seconds=2), hand.board.settings()


@pytest.mark.parametrize(
    ("change", "field"),
    [
        ((Setting.FORCE_MODEL, int(wire.ForceModel.LIN)), "force_n"),
        ((Setting.FORCE_GAIN_Z_NN, 9_000_000), "force_n"),
        ((Setting.POC_WEIGHTS, int(PocWeights.ABS_N2)), "poc_mm"),
        ((Setting.TORQUE_GAIN_Y_NN, 90_000_000), "torque_nmm"),
    ],
)
def test_rows_of_a_board_with_other_settings_are_refused_until_they_are_given(change, field) -> None:
    rows, board = read_from(change)
    tare = np.nan_to_num(rows["tare"])
    for without in (
        lambda: biotac.compute(rows),
        lambda: biotac.compute(rows[3::2]["counts"], tare[3::2]),
        lambda: biotac.Finger().feed(rows["counts"], rows["pdc"]),
        lambda: biotac.Finger().events(rows["counts"][10:], rows["pdc"][10:]),
    ):
        with pytest.raises(ValueError, match=rf"{field} . is .* in row seq \d+ of finger 0, but default settings give"):
            without()
    got = biotac.compute(rows, settings=board)
    for name, within in (("force_n", 0.01), ("poc_mm", 0.01), ("torque_nmm", 0.1)):
        sent = np.isfinite(rows[name])
        assert sent.sum() > 300
        np.testing.assert_allclose(got[name][sent], rows[name][sent], atol=within)
    biotac.Finger(board).feed(rows["counts"], rows["pdc"])
    biotac.compute(rows, settings={})  # the defaults, said so


def test_rows_of_a_board_with_default_settings_need_none() -> None:
    rows, board = read_from()
    assert biotac.compute(rows).tobytes() == biotac.compute(rows, settings=board).tobytes()
    biotac.Finger().feed(rows["counts"], rows["pdc"])


def test_the_rows_behind_a_strided_field_are_the_ones_compared() -> None:
    """One bad row of three: only a caller who takes that one is refused."""
    rows, _ = read_from()
    rows = rows[np.isfinite(rows["force_n"]).all(axis=1)]
    rows["force_n"][4] += 1.0
    biotac.Finger().feed(rows["counts"][::3])
    with pytest.raises(ValueError, match=f"row seq {rows['seq'][4]} "):
        biotac.Finger().feed(rows["counts"][1::3])


@pytest.mark.parametrize("wanted", range(1, 8))
def test_what_is_not_wanted_is_nan_and_the_rest_is_the_same(wanted) -> None:
    quantities = biotac.QuantityFlags(wanted)
    counts = random_counts(50)
    want, got = biotac.compute(counts, TARE), biotac.compute(counts, TARE, quantities=quantities)
    live = biotac.per_frame(TARE, quantities=quantities)
    both = biotac.QuantityFlags.POC | biotac.QuantityFlags.FORCE
    needed = [*(biotac.QuantityFlags(1 << bit) for bit in range(3)), *[both] * 4]
    for name, quantity in zip(RESULT_DTYPE.names, needed, strict=True):
        asked = want[name] if quantities & quantity == quantity else np.full(want[name].shape, np.nan)
        np.testing.assert_array_equal(got[name], asked)
        np.testing.assert_array_equal(live(counts[7])[name], asked[7])


@pytest.mark.parametrize("wanted", [0, 8, 15])
def test_quantities_without_a_result_are_refused(wanted) -> None:
    for own in (None, population.on_board()):
        with pytest.raises(ValueError, match="expected some of POC, FORCE and TORQUE"):
            biotac.compute(random_counts(2), TARE, wrench_map=own, quantities=biotac.QuantityFlags(wanted))
