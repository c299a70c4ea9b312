"""The table of fields against the true parts of the rows."""

import dataclasses
import json

import numpy as np
import pytest

import biotac
from biotac.wire import messages_gen as wire
from biotac.wire.dtypes_gen import DTYPES
from biotac.wire.fields import FRAME_FIELDS, IDLE_FIELDS, as_json


@pytest.fixture(scope="module")
def rows() -> np.ndarray:
    with biotac.open("sim:fingers.toml?fingers=2&pace=fast") as hand:
        hand.board.set_setting(wire.Setting.FORCE_MODEL, wire.ForceModel.LIN)
        return hand.read(seconds=3.0)


def test_every_field_of_a_frame_message_is_in_a_row() -> None:
    assert {f.sent for f in FRAME_FIELDS if f.sent} | {"finger", "seq", "t_us"} == set(
        DTYPES[wire.FrameMessage.ID].names or ()
    )
    assert {f.name for f in IDLE_FIELDS} == set(DTYPES[wire.Idle.ID].names or ())


def test_rows_frames_and_json_have_the_same_fields(rows) -> None:
    names = [f.name for f in FRAME_FIELDS]
    assert list(biotac.FRAME_DTYPE.names or ()) == names == list(as_json(rows[0]))
    assert sorted(field.name for field in dataclasses.fields(biotac.Frame)) == sorted(names)


def test_json_says_null_where_there_is_no_value(rows) -> None:
    invalid = np.isnan(rows["poc_mm"]).any(axis=1)
    missing = rows[~invalid][:1].copy()
    missing["counts"][0, 3] = 65535
    for row in (rows[invalid][0], missing[0], rows[~invalid][0]):
        text = json.loads(json.dumps(as_json(row), allow_nan=False))
        assert text == json.loads(json.dumps(as_json(biotac.Frame.from_row(row)), allow_nan=False))
        for name in ("poc_mm", "force_n", "tare", "counts"):
            absent = row[name] == 65535 if name == "counts" else np.isnan(row[name])
            assert text[name] == [
                None if g else expected for expected, g in zip(row[name].tolist(), absent, strict=True)
            ], name


def test_compute_takes_rows(rows) -> None:
    """The result equals the board's, to the wire's rounding: half a step of each."""
    lin = {wire.Setting.FORCE_MODEL: wire.ForceModel.LIN}  # the board's arithmetic is as fine as the wire
    expected = biotac.compute(rows, settings=lin)
    for name, step in (("poc_mm", 1e-3), ("force_n", 1e-4), ("torque_nmm", 1e-3)):
        good = ~np.isnan(rows[name]).any(axis=1) & ~np.isnan(expected[name]).any(axis=1)
        assert good.sum() > 100
        assert np.abs(expected[name] - rows[name])[good].max() <= 1.5 * step, (
            name
        )  # the board's own error and half a step
    with pytest.raises(ValueError, match="expected compute"):
        biotac.compute(rows["counts"])
