"""A map's lesson: the record, the same verdicts by boards and NumPy, and the results of a touch unlike it."""

from dataclasses import replace

import numpy as np
import pytest
from maps import make_map

from biotac import compute
from biotac.errors import InputError
from biotac.kernels.compiled import BoardResults, default_settings, on_board_q4
from biotac.kernels.geometry import ELECTRODE_MM
from biotac.map import board_map
from biotac.map.bound import error_bound
from biotac.map.lesson import ALL, BYTES, FACTORS, Lesson, fit_lesson
from biotac.map.margin import Margin
from biotac.map.published import published
from biotac.wire import messages_gen as wire
from biotac.wire.frames import FORCE_LSB_PER_N

TARE = np.full(19, 2900.0)
TARE_Q4 = np.full((1, 19), 16 * 2900, np.uint16)
MARGIN = Margin((300, 400), (20, 40))


def frames_of(rows: int, size: float, seed: int = 3) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Counts, tare and pressure as FRAMEs have them: one pattern of some strength, and noise of ``size``."""
    rng = np.random.default_rng(seed)
    e = -np.linspace(0, 60, 19) * rng.uniform(1, 6, (rows, 1)) + rng.normal(0, size, (rows, 19))
    counts = np.clip(np.rint(TARE + e), 1, 4089).astype(np.uint16)
    return counts, np.repeat(TARE_Q4, rows, axis=0), np.zeros(rows, np.int32)


def on_board(frames: tuple[np.ndarray, np.ndarray, np.ndarray], used: board_map.BoardMap) -> BoardResults:
    counts, tare_q4, pdc_q4 = frames
    return on_board_q4(counts, tare_q4, default_settings(), used.handle, pdc_q4)


@pytest.fixture(scope="module")
def taught() -> board_map.BoardMap:
    """A map of pairs, signals and an offset, with a lesson fitted to frames_of() as the map sees them."""
    plain = board_map.from_blob(make_map(5, blocks=12, axes=3))
    shear_n = np.full(3000, 0.5)
    shear_n[7] = np.nan  # a touch without a point of contact
    lesson = fit_lesson(plain.seen(*frames_of(3000, 4.0)), np.full(3000, 2.0), 1.25, MARGIN, shear_n)
    return board_map.from_blob(replace(plain, lesson=replace(lesson, counts_per_n=97)).blob)


def test_a_lesson_is_kept_in_the_blob(taught: board_map.BoardMap) -> None:
    lesson = taught.lesson
    assert lesson is not None and len(lesson.packed()) == BYTES
    assert Lesson.unpacked(lesson.packed()) == lesson and lesson.margin == MARGIN and lesson.scale_q8 == 320
    assert lesson.shear_max == 8 and lesson.counts_per_n == 97  # at least 0.5 N in 64 mN
    assert board_map.from_blob(make_map(5, blocks=12, axes=3)).lesson is None
    assert len(taught.blob) == len(make_map(5, blocks=12, axes=3)) + BYTES


def test_an_older_lesson_is_skipped_and_the_board_says_teach_it_again(taught: board_map.BoardMap) -> None:
    older = bytearray(taught.blob)
    older[3] = 1
    found = board_map.from_blob(bytes(older))
    assert found.blob == replace(taught, lesson=None).blob
    assert (on_board(frames_of(9, 4.0), found)[4] & wire.FrameFlags.OUTSIDE).all()
    assert Lesson.from_dict(None) is None and Lesson.from_dict("0" * 2 * BYTES) is None  # of an older map's file
    assert taught.lesson is not None and Lesson.from_dict(taught.lesson.to_dict()) == taught.lesson
    older[3] = 3  # of a board to come
    with pytest.raises(InputError, match="refuse"):
        board_map.from_blob(bytes(older))


def test_the_places_of_compression_are_its_centroid_and_how_far_it_extends_along(taught: board_map.BoardMap) -> None:
    counts, tare_q4, pdc_q4 = frames_of(400, 40.0)
    factors = taught.seen(counts, tare_q4, pdc_q4).factors
    place = ELECTRODE_MM[:, :2] / (8.0, 4.0)
    weight = np.maximum(tare_q4 / 16 - counts, 0) + 5.0
    weight /= weight.sum(axis=1, keepdims=True)
    x, y = (weight @ place).T
    wanted = np.column_stack([x, y**2, weight @ place[:, 0] ** 2 - x**2 / 2])
    np.testing.assert_allclose(factors[:, 1:4] / factors[:, :1], wanted, atol=0.001)


def test_a_lesson_that_could_overflow_is_refused(taught: board_map.BoardMap) -> None:
    assert taught.lesson is not None
    last = (32767, 32767, 5) + (0,) * (FACTORS - 3)
    wide = replace(taught.lesson, weights=(*taught.lesson.weights[:-1], last))
    small = replace(taught.lesson, size_max=0)
    for wrong in (wide, small, replace(taught.lesson, scale_q8=1025), replace(taught.lesson, exponent=21)):
        with pytest.raises(InputError, match="refuse"):
            _ = replace(taught, lesson=wrong).blob


def test_nearly_all_of_a_lesson_is_like_it_and_what_is_not_goes_to_the_default_map(taught: board_map.BoardMap) -> None:
    lesson = taught.lesson
    assert lesson is not None
    like = lesson.unlike_q8(taught.seen(*frames_of(3000, 4.0, seed=4)))
    assert 0.9 < (like < ALL).mean() < 0.99
    other = frames_of(500, 60.0)
    match = lesson.match(taught.seen(*other))
    assert (match.share == 0).mean() > 0.9 and (match.apart == ALL).mean() > 0.9
    found = compute(other[0], TARE, wrench_map=taught)
    default = compute(other[0], TARE)
    np.testing.assert_allclose(
        found["force_n"][match.share == 0], 1.25 * default["force_n"][match.share == 0], atol=0.01
    )
    assert (found["normal_half_n"] >= 0.3).all()


@pytest.mark.parametrize("z_least_q8", [0, 200])
@pytest.mark.parametrize("size", [4.0, 12.0, 25.0, 60.0])
def test_boards_judge_and_mix_as_numpy_does(taught: board_map.BoardMap, size: float, z_least_q8: int) -> None:
    assert taught.lesson is not None
    frames, before = frames_of(1000, size), taught.lesson
    taught = replace(taught, lesson=replace(before, z_least_q8=z_least_q8))
    assert taught.lesson is not None
    seen = taught.seen(*frames)
    z_share = seen.force_100un[:, 2] / seen.size_100un
    unlike = taught.lesson.unlike_q8(seen) > replace(before, z_least_q8=0).unlike_q8(seen)
    assert unlike[z_share < (z_least_q8 - 4) / ALL].all() and not unlike[z_share > z_least_q8 / ALL].any()
    _, force, _, _, flags = on_board(frames, taught)
    wrench, verdict = published(taught, *frames)
    own = wire.FrameFlags.POPULATION | wire.FrameFlags.OUTSIDE
    np.testing.assert_array_equal(flags & own, verdict.flags)
    off = np.abs(force / FORCE_LSB_PER_N - wrench[:, :3])
    assert (off <= verdict.bound(error_bound(taught, None, *frames))[:, :3] + 1e-9).all()


def test_a_shear_beyond_the_lesson_widens_both_intervals(taught: board_map.BoardMap) -> None:
    assert taught.lesson is not None
    match = taught.lesson.match(taught.seen(*frames_of(2, 4.0)))
    parts, guess = np.array([[2.5, 0.5], [2.0, 1.0]]), np.zeros((2, 2))
    np.testing.assert_allclose(np.diff(match.half_n(parts, guess), axis=0), 2 * (1.0 - 8 * 0.064), atol=0.01)


def test_a_map_without_a_lesson_is_never_sure_of_a_touch() -> None:
    plain, frames = board_map.from_blob(make_map(5, blocks=12, axes=3)), frames_of(100, 4.0)
    flags = on_board(frames, plain)[4]
    assert (flags & wire.FrameFlags.OUTSIDE).all() and not (flags & wire.FrameFlags.POPULATION).any()
