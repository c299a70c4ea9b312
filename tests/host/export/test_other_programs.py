"""One recording, as other people's programs read the exports: the same rows and the same largest force."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from record_all import record_all

import biotac
from biotac.cli.main import main

WHAT = "SELECT count(*), max(force_z_n), count(force_z_n) FROM '{}' WHERE NOT isnan(force_z_n)"


def by_duckdb(path: Path) -> tuple[float, ...]:
    duckdb = pytest.importorskip("duckdb")
    return tuple(duckdb.connect().execute(WHAT.format(path)).fetchone())[1:]


def by_pandas(path: Path) -> tuple[float, ...]:
    pandas = pytest.importorskip("pandas")
    column = (pandas.read_csv if path.suffix == ".csv" else pandas.read_parquet)(path)["force_z_n"]
    return column.max(), column.count()


def by_polars(path: Path) -> tuple[float, ...]:
    polars = pytest.importorskip("polars", reason="needs polars: pip install polars")
    column = (polars.read_csv if path.suffix == ".csv" else polars.read_parquet)(path)["force_z_n"]
    assert column.dtype.is_float()
    known = column.filter(column.is_not_nan() & column.is_not_null())
    return known.max(), len(known)


def by_dask(path: Path) -> tuple[float, ...]:
    dask = pytest.importorskip("dask.dataframe", reason="needs Dask: pip install dask[dataframe]")
    column = (dask.read_csv if path.suffix == ".csv" else dask.read_parquet)(path)["force_z_n"]
    return column.max().compute(), column.count().compute()


def by_octave(path: Path) -> tuple[float, ...]:
    if shutil.which("octave-cli") is None or path.suffix != ".csv":
        pytest.skip("reads CSV, and needs octave-cli (Debian: octave)")
    number = path.read_text().partition("\n")[0].split(",").index("force_z_n") + 1
    script = f"z = dlmread('{path}', ',', 1, 0)(:, {number}); printf('%.9g %d', max(z), sum(!isnan(z)))"
    output = subprocess.run(["octave-cli", "--eval", script], capture_output=True, text=True, check=True).stdout
    return tuple(map(float, output.split()))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("others")
    path = record_all("sim:press.toml?fingers=2&seconds=3", folder / "a.mcap")
    for suffix in ("csv", "parquet"):
        assert main(["export", str(path), str(folder / f"a.{suffix}")]) == 0
    return folder


@pytest.mark.filterwarnings("ignore:The inplace keyword")  # of pandas, used by Dask
@pytest.mark.parametrize("suffix", ["csv", "parquet"])
@pytest.mark.parametrize(
    "read",
    [
        by_duckdb,
        by_pandas,
        *(pytest.param(read, marks=pytest.mark.nightly) for read in (by_polars, by_dask, by_octave)),
    ],
)
def test_they_read_what_was_recorded(folder: Path, suffix: str, read: Callable[[Path], tuple[float, ...]]) -> None:
    z_n = biotac.load(folder / "a.mcap")["force_n"][:, 2]
    largest, known = read(folder / f"a.{suffix}")
    assert known == np.isfinite(z_n).sum()
    assert largest == pytest.approx(np.nanmax(z_n), rel=1e-6)
