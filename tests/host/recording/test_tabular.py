"""Parts of a recording as DataFrames, Datasets and means, and beside another signal, against the rows themselves."""

import sys
import tracemalloc
import warnings
from pathlib import Path

import numpy as np
import pytest
from record_all import record_all

import biotac
from biotac.kernels.geometry import ELECTRODE_MM
from biotac.wire.fields import FRAME_FIELDS


@pytest.fixture(scope="module")
def recording(tmp_path_factory) -> biotac.Recording:
    path = record_all("sim:faults.toml?fingers=2&clock_s=3000", tmp_path_factory.mktemp("tabular") / "a.mcap")
    recording = biotac.Recording(path)
    assert np.isnan(recording.frames["poc_mm"]).any() and (recording.frames["counts"] == 65535).any()
    return recording


@pytest.fixture(scope="module")
def long(tmp_path_factory) -> Path:
    return record_all("sim:press.toml?fingers=5&seconds=60", tmp_path_factory.mktemp("long") / "a.mcap")


def test_a_data_frame_has_every_number(recording) -> None:
    table = recording.to_pandas()
    assert list(table.columns) == [*(name for field in FRAME_FIELDS for name in field.flat_names()), "gap_s", "label"]
    for field in FRAME_FIELDS:
        rows = recording.frames[field.name].reshape(len(table), -1)
        for k, name in enumerate(field.flat_names()):
            missing = rows[:, k] == field.invalid if field.invalid is not None else np.isnan(rows[:, k])
            assert (table[name].isna() == missing).all(), name
            assert (table[name].dropna().to_numpy() == rows[~missing, k]).all(), name
    since_us = recording.frames["t_us"] - recording.frames["t_us"].min()
    assert np.round((table.index - table.index[0]).total_seconds() * 1e6).tolist() == since_us.tolist()
    assert table.index[0].value == recording.begin_ns
    assert table.attrs["units"]["force_x_n"] == "N" and table.attrs["units"]["counts_E7"] == "count"


def test_a_dataset_has_every_number_by_time_and_finger(recording, tmp_path) -> None:
    import xarray  # half a second to import

    data = recording.to_xarray()
    data.to_netcdf(tmp_path / "a.nc", engine="scipy")  # the extra brings scipy
    with xarray.open_dataset(tmp_path / "a.nc", engine="scipy") as read:
        assert all(
            (data[name].values == read[name].values).all() for name in ("time", "t_us", "flags", "finger", "seq")
        )
        assert recording.end_us > 2**31 and data["flags"].values.max() >= 2**31
    assert data.sizes["finger"] == 2 and data["force_n"].dims == ("time", "finger", "axis")
    for name, finger in (("index", 0), ("middle", 1)):
        rows = recording[name]
        part = data.sel(finger=name)
        present = np.isin(data["t_us"], rows["t_us"])
        for field in FRAME_FIELDS[3:]:
            values = part[field.name].values
            missing = np.isnan(values[present]) if values.dtype.kind == "f" else np.zeros(values[present].shape, bool)
            was_missing = rows[field.name] == field.invalid if field.invalid is not None else np.isnan(rows[field.name])
            assert (missing == was_missing).all(), field.name
            assert (values[present][~missing] == rows[field.name][~missing]).all(), field.name
        absent = part.isel(time=~present)
        assert (absent["flags"].values & int(biotac.FrameFlags.POC_INVALID) != 0).all() and finger in recording.fingers
        assert np.isnan(absent["force_n"]).all()
    assert data["flags"].dtype == np.uint32 and data["torque_nmm"].attrs["units"] == "N*mm"
    positions = [data["counts"][f"electrode_{axis}_mm"] for axis in "xyz"]
    np.testing.assert_array_equal(np.column_stack(positions), ELECTRODE_MM)
    at = data["time"][:: max(1, len(data["time"]) // 5)]
    np.testing.assert_array_equal(data.sel(time=at)["force_n"], data["force_n"][:: max(1, len(data["time"]) // 5)])


def test_a_part_is_what_the_whole_has_there_and_costs_no_more(long: Path) -> None:
    whole = biotac.Recording(long).frames

    def peak(**part: object) -> int:
        tracemalloc.start()
        biotac.Recording(long).select(**part) if part else biotac.Recording(long).frames  # type: ignore[arg-type]
        most = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return most

    assert peak(fingers="ring", fields="force_n", start_s=20, stop_s=21) <= 0.1 * peak()
    since_s = (whole["t_us"] - whole["t_us"].min()) / 1e6
    for start_s, stop_s in ((0, 0.5), (20, 21), (59.5, None), (30.005, 30.02), (70, 80)):
        part = biotac.Recording(long).select(fingers="ring", fields="force_n", start_s=start_s, stop_s=stop_s)
        wanted = whole[(whole["finger"] == 2) & (since_s >= start_s) & (since_s < (stop_s or 1e9))]
        assert part.to_numpy().dtype.names == ("finger", "seq", "t_us", "force_n")
        for name in part.to_numpy().dtype.names or ():
            np.testing.assert_array_equal(part.to_numpy()[name], wanted[name])
    stamps = biotac.Recording(long).select(fields="pdc", start_s=20, stop_s=21).to_pandas().index
    assert (stamps == biotac.Recording(long).to_pandas().loc[stamps[0] : stamps[-1]].index).all()


def test_a_file_that_was_written_again_is_not_mixed_with_the_old_one(long: Path, tmp_path: Path) -> None:
    path = tmp_path / "again.mcap"
    path.write_bytes(long.read_bytes())
    before = biotac.Recording(path)
    path.unlink()
    record_all("sim:press.toml?seconds=1", path)
    with pytest.raises(biotac.RecordingError, match="changed or gone"):
        before.select(fields="pdc")
    with pytest.raises(biotac.RecordingError, match="changed or gone"):
        _ = before.frames


def test_means_over_steps(recording) -> None:
    part = recording.select(fields=["pdc", "force_n", "counts", "flags"])
    slow = part.resample(10)
    rows = part.to_numpy()
    for out in slow.to_numpy()[:: max(1, len(slow) // 40)]:
        own = rows[(rows["finger"] == out["finger"]) & (rows["t_us"] // 100_000 == out["t_us"] // 100_000)]
        assert out["flags"] == np.bitwise_or.reduce(own["flags"]) and out["seq"] == own["seq"][0]
        with warnings.catch_warnings():
            warnings.filterwarnings("ignore", "Mean of empty slice")
            counts = np.where(own["counts"] == 65535, np.nan, own["counts"])
            np.testing.assert_allclose(out["counts"], np.nanmean(counts, axis=0))
            np.testing.assert_allclose(out["force_n"], np.nanmean(own["force_n"], axis=0), atol=1e-9)
    assert slow.to_pandas()["pdc"].dtype == np.float64 and slow.to_xarray().sizes["finger"] == 2
    with pytest.raises(biotac.InputError, match="at most 100"):
        part.resample(1000)


@pytest.fixture(scope="module")
def irregular(tmp_path_factory) -> Path:
    """Twenty presses, no two alike."""
    folder, draw = tmp_path_factory.mktemp("irregular"), np.random.default_rng(7)
    steps = ['name = "irregular"', "seed = 1", "[[step]]", 'do = "rest"', "seconds = 1.5"]
    for force_n, ramp_s, hold_s in draw.uniform((2, 0.2, 0.2), (6, 0.6, 1.5), (20, 3)):
        for do, seconds, to_n in (("press", ramp_s, force_n), ("hold", hold_s, None), ("press", 0.3, 0.0),
                                  ("rest", hold_s, None)):  # fmt: skip
            steps += ["[[step]]", f'do = "{do}"', f"seconds = {seconds:.2f}"]
            steps += ['at = "E17"'] if to_n else []
            steps += [f"force_n = {to_n:.2f}"] if to_n is not None else []
    (folder / "irregular.toml").write_text("\n".join(steps))
    return record_all(f"sim:{folder / 'irregular.toml'}", folder / "a.mcap")


@pytest.mark.parametrize("source", ["pdc", "counts"])
@pytest.mark.parametrize("lag_s", [-1.234, 0.0, 37.5])
def test_another_sensors_signal_is_aligned_within_its_uncertainty(irregular: Path, lag_s: float, source: str) -> None:
    part = biotac.Recording(irregular).select(fingers=0, fields=[source, "force_n"])
    rows = part.to_numpy()
    draw = np.random.default_rng(5)
    measured_s = biotac.clock.electrode_t_us(rows["t_us"]).mean(axis=1) / 1e6
    t_s = np.arange(measured_s[0], measured_s[-1], 0.001)
    force = np.interp(t_s, measured_s, np.nan_to_num(rows["force_n"][:, 2])) + draw.normal(0, 0.05, len(t_s))
    beside, found = part.align(np.column_stack([force, -force]), t_s + lag_s)
    assert abs(found.offset_s - lag_s) < 3 * found.sigma_s < 0.03 and beside.shape == (len(rows), 2)
    inside = np.isfinite(beside[:, 0]) & np.isfinite(rows["force_n"][:, 2])
    assert inside.mean() > 0.9
    assert np.sqrt(np.mean((beside[inside, 0] - rows["force_n"][inside, 2]) ** 2)) < 0.3
    with pytest.raises(biotac.RecordingError, match="not aligned"):
        part.align(draw.normal(size=len(t_s)), t_s)


def test_without_the_extra_it_is_named(recording, monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(biotac.InputError, match=r"pip install 'biotac-gateway\[export\]'"):
        recording.to_pandas()
