"""DataFrames and Datasets against the rows that they are made of."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from record_all import record_all

import biotac
from biotac.wire.fields import FRAME_FIELDS


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> biotac.Recording:
    path = record_all("sim:faults.toml?fingers=2", tmp_path_factory.mktemp("tabular") / "a.mcap")
    its = biotac.Recording(path)
    assert np.isnan(its.frames["poc_mm"]).any() and (its.frames["counts"] == 65535).any()
    return its


def test_a_data_frame_has_every_number(recording) -> None:
    table = recording.to_pandas()
    assert list(table.columns) == [name for field in FRAME_FIELDS for name in field.flat_names()]
    for field in FRAME_FIELDS:
        rows = recording.frames[field.name].reshape(len(table), -1)
        for k, name in enumerate(field.flat_names()):
            missing = rows[:, k] == field.invalid if field.invalid is not None else np.isnan(rows[:, k])
            assert (table[name].isna() == missing).all(), name
            assert (table[name].dropna().to_numpy() == rows[~missing, k]).all(), name
    since_us = recording.frames["t_us"] - recording.frames["t_us"].min()
    assert ((table.index - table.index[0]).total_seconds() * 1e6).round().tolist() == since_us.tolist()
    assert table.index[0].value == recording.begin_ns


def test_a_dataset_has_units_and_axes(recording) -> None:
    data = recording.to_xarray()
    np.testing.assert_array_equal(data["force_n"].sel(axis="z"), recording.frames["force_n"][:, 2])
    assert data["torque_nmm"].attrs["units"] == "N*mm"
    missing = recording.frames["counts"] == 65535
    np.testing.assert_array_equal(np.isnan(data["counts"]), missing)
    np.testing.assert_array_equal(data["counts"].values[~missing], recording.frames["counts"][~missing])


def test_without_the_extra_it_is_named(recording, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(biotac.InputError, match=r"pip install 'biotac-gateway\[export\]'"):
        recording.to_pandas()
