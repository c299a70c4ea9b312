"""Training beside force: torsion, contacts as groups, the finger in air and in warmth."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import wrench_run

from biotac.calibrate.wrench import contact, figures, models, moments
from biotac.calibrate.wrench.crossvalidation import AIR_SHARES, validate
from biotac.calibrate.wrench.plate_recording import Run, load_run
from biotac.calibrate.wrench.splits import BLOCKS, Blocks
from biotac.core import geometry as surface
from biotac.errors import RecordingError
from biotac.map import columns
from biotac.map.columns import Signals
from biotac.sim.physics import SimFinger
from biotac.sim.random_loads import plate_recording, random_loads

FRAMES = 4000


@pytest.fixture(scope="module")
def arrays() -> dict[str, Any]:
    """A calibration recording of random loads."""
    return plate_recording(SimFinger(2), *random_loads(FRAMES, 2), 2)


@pytest.fixture(scope="module")
def run(arrays: dict[str, Any], tmp_path_factory: pytest.TempPathFactory) -> Run:
    return load_run(wrench_run.save(tmp_path_factory.mktemp("loads") / "loads.npz", arrays))


def loaded(folder: Path, arrays: dict[str, Any]) -> Run:
    return load_run(wrench_run.save(folder / "run.npz", arrays))


# ---- contacts ----------------------------------------------------------------------------------


def test_a_contact_is_held_out_whole(run: Run) -> None:
    assert run.contact is not None
    blocks = Blocks(run.rest, run.contact)
    every = np.concatenate([blocks.rows(k) for k in range(BLOCKS)])
    assert np.array_equal(np.sort(every), np.arange(FRAMES))
    of_strip = np.empty(FRAMES, dtype=int)
    for k, strip in enumerate(blocks.strips):
        of_strip[strip] = k
    for block in range(BLOCKS):
        own = set(run.contact[blocks.rows(block)].tolist())
        trained = blocks.training_strips([block])[of_strip]
        assert own and not own & set(run.contact[trained].tolist())
        # nothing else is left out: contacts need no guard
        assert trained.sum() == FRAMES - len(blocks.rows(block))


def test_blocks_are_not_regions_of_the_finger(run: Run, arrays: dict[str, Any]) -> None:
    along = random_loads(FRAMES, 2)[0].contact_mm[:, 0]
    blocks = Blocks(run.rest, run.contact)
    middles = [along[blocks.rows(k)].mean() for k in range(BLOCKS)]
    # a cut by place alone would spread them over the pad's 16 mm
    assert np.ptp(along) > 15.0
    assert np.std(middles) < 3.0


@pytest.mark.parametrize(
    ("field", "message"),
    [
        (np.arange(FRAMES) % 19, r"field contact names 19 contacts: expected at least 20"),
        (np.arange(FRAMES) / 2.0, r"field contact is float64 \(4000,\): expected \(4000,\) integers"),
    ],
)
def test_contacts_that_cannot_be_cut_by_are_refused(
    field: np.ndarray, message: str, arrays: dict[str, Any], tmp_path: Path
) -> None:
    with pytest.raises(RecordingError, match=message):
        loaded(tmp_path, arrays | {"contact": field})


# ---- torsion -----------------------------------------------------------------------------------


def test_torsion_follows_from_force_and_moment(arrays: dict[str, Any], tmp_path: Path) -> None:
    given = arrays["torsion"]
    without = {name: array for name, array in arrays.items() if name != "torsion"}
    run = loaded(tmp_path, without)
    assert run.axes[-1] == "torsion"
    np.testing.assert_allclose(run.truth[:, 6], given, atol=1e-6)
    assert any("misses the finger in 0 rows" in note for note in run.notes)


def test_a_line_of_action_beside_the_finger_takes_the_nearest_place(arrays: dict[str, Any], tmp_path: Path) -> None:
    moment = arrays["M"].copy()
    force = np.linalg.norm(arrays["F"], axis=1)
    # Mx in Lin's frame is Y recorded: a fifth more than any lever on the cylinder gives
    moment[:20, 1] = 1.2 * surface.RADIUS_MM * force[:20]
    run = loaded(tmp_path, {k: v for k, v in arrays.items() if k != "torsion"} | {"M": moment})
    assert contact.locate(run.truth[:20, :3], run.truth[:20, 3:6]).missed.any()
    assert np.isfinite(run.truth).all()
    note = next(note for note in run.notes if note.startswith("torsion"))
    assert "misses the finger in 0 rows" not in note


def test_wrenches_that_press_nowhere_leave_torsion_out(arrays: dict[str, Any], tmp_path: Path) -> None:
    # pulled, not pressed: no point of the ventral surface has the force going in
    pulled = arrays["F"].copy()
    pulled[: FRAMES // 10] *= -1.0
    run = loaded(tmp_path, {k: v for k, v in arrays.items() if k != "torsion"} | {"F": pulled})
    assert run.axes == ("Fx", "Fy", "Fz", "Mx", "My", "Mz")
    assert any("torsion is left out" in note for note in run.notes)


@pytest.mark.parametrize("bad", [np.full(FRAMES, np.nan), np.zeros((FRAMES, 1))])
def test_torsion_that_is_no_number_a_row_is_refused(bad: np.ndarray, arrays: dict[str, Any], tmp_path: Path) -> None:
    with pytest.raises(RecordingError, match=r"field torsion is .* finite numbers in N mm about the outward normal"):
        loaded(tmp_path, arrays | {"torsion": bad})


# ---- air ---------------------------------------------------------------------------------------


@pytest.mark.nightly
def test_the_finger_in_air_is_trained_in_where_contact_does_not_pay_for_it(tmp_path: Path) -> None:
    run = loaded(tmp_path, wrench_run.fields(4000, rests=False))
    assert run.air is not None
    with_air = validate(run, windows=(1,))
    without = validate(replace(run, air=None), windows=(1,))
    assert with_air.final.air_share in AIR_SHARES
    assert without.final.air_share == 0.0
    rest, bare = figures.rest_n(with_air), figures.rest_n(without)
    assert max(rest) < 0.9 * max(bare), (rest, bare)
    errors = [figures.rmse(v.predicted[0], run.truth) for v in (with_air, without)]
    # the smallest weight is taken whatever it costs: without it a real finger is off by 0.36 N in air, with it by 0.2
    assert (errors[0] < 1.05 * errors[1]).all() or with_air.final.air_share == AIR_SHARES[-1], errors


def test_air_weighs_as_much_as_the_run_before_its_share(run: Run) -> None:
    sums = moments.air_sums(run, 1)
    assert sums is not None
    assert sums.rows == pytest.approx(FRAMES)
    assert not sums.cross.any()  # the truth is 0
    assert not sums.square.any()


# ---- ridge, with torque and pressure -----------------------------------------------------------


def sums_of(run: Run) -> moments.WeightedSums:
    """Of all rows."""
    return moments.strip_sums(moments.smoothed(run, 1), run.truth, run.drift)


@pytest.mark.parametrize("model", models.MODELS, ids=lambda model: model.name)
def test_ridge_shrinks_toward_lins_geometry(model: models.Model, run: Run) -> None:
    sums = sums_of(run)
    found = models.lin(sums)
    signals = moments.smoothed(run, 1)
    as_lin = columns.with_one(columns.columns(signals)) @ found  # is fitted so, whatever the ridge costs
    for one in models.pulled(moments.strip_sums(signals, as_lin, run.drift, nodes=moments.NO_DRIFT), [model])[0]:
        np.testing.assert_allclose(one, found, atol=1e-6)
    small = Signals(np.vstack([np.zeros(19), np.eye(19)]), run.tare, np.zeros(20))
    response = columns.with_one(columns.columns(small)) @ found
    slope = response[1:] - response[0]
    arms = np.cross(surface.ELECTRODE_MM, surface.ELECTRODE_NORMAL)
    # about the middle of the pad, where the outward normal is -z
    turn = -np.cross(surface.ELECTRODE_MM - surface.ELECTRODE_MM.mean(axis=0), surface.ELECTRODE_NORMAL)[:, 2]
    for axis, lin in enumerate([*surface.ELECTRODE_NORMAL.T, *arms.T, turn]):
        likeness = slope[:, axis] @ lin / np.linalg.norm(slope[:, axis]) / np.linalg.norm(lin)
        assert (likeness if axis < 3 else abs(likeness)) > 0.9999, f"axis {axis}"
    # pressure says nothing until a run says so
    pressed = Signals(np.zeros((2, 19)), run.tare, np.array([0.0, 100.0]))
    wrenches = columns.with_one(columns.columns(pressed)) @ found
    np.testing.assert_allclose(wrenches[1], wrenches[0], atol=1e-6)


def test_pressure_that_never_moved_in_training_goes_nowhere_when_it_does(
    run: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    still = replace(run, pdc=np.full(FRAMES, 1e-9))
    found = models.pulled(sums_of(still), [models.JOINED])[0][0]
    pressed = Signals(np.zeros((2, 19)), run.tare, np.array([0.0, 500.0]))
    wrenches = columns.with_one(columns.columns(pressed)) @ found
    assert np.abs(wrenches[1] - wrenches[0]).max() < 1e-3


# ---- blocks of columns -------------------------------------------------------------------------
