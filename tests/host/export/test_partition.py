"""Many recordings as Parquet by day and finger: the recordings' own numbers, once each, whoever wrote them."""

import hashlib
import io
import json
import os
import random
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from maps import make_map
from record_all import blocks_of, record_all, written

import biotac
from biotac.cli.main import main
from biotac.export.partition import partition, recording_id
from biotac.recording.layout import CHECKSUM
from biotac.recording.mcap_file import RecordingFile
from biotac.wire.decoder import packed, pairs

PAGE = Path(__file__).parents[3] / "host/docs/guides/many_recordings.md"
OLD = Path(__file__).parent / "old_lake"


def copies(recording: biotac.Recording, folder: Path, count: int, apart_s: float) -> list[Path]:
    """``count`` recordings in ``folder``, the k-th ``k * apart_s`` later than ``recording``."""
    metadata = {key: value for key, value in recording.metadata.items() if key != CHECKSUM}
    paths = [folder / f"{k:05}.mcap" for k in range(count)]
    for k, path in enumerate(paths):
        later_ns = round(k * apart_s * 1e9)
        file = RecordingFile(path.open("xb"), metadata)
        for block, arrived_ns, here_ns in zip(
            blocks_of(recording), recording.arrived_ns, recording.all_here_ns, strict=True
        ):
            file.add(block, arrived_ns + later_ns, None if here_ns is None else here_ns + later_ns)
        file.close()
    return paths


@pytest.fixture(scope="module")
def sources(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    """Recordings with faults, for missing words; with heartbeats, a calibration and a map; one a day later."""
    folder = tmp_path_factory.mktemp("sources")
    faults = record_all("sim:faults.toml?fingers=2&seconds=1", folder / "faults.mcap")
    with biotac.open("sim:press.toml?fingers=2&seconds=2") as hand:
        hand.board.set_calibration(0, biotac.Calibration(force_gain_nn=(1_000_000, 900_000, 800_000)))
        hand.board.set_map(1, make_map(1))
        hand.record(folder / "own.mcap")
        hand.stream("force", "pac", rest=False)
        hand.read_batch(100)
    return [faults, folder / "own.mcap", *copies(biotac.Recording(faults), folder, 2, 86_400.0)[1:]]


@pytest.fixture(scope="module")
def trials(sources, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("partition") / "trials"
    assert export(sources, folder) == 0
    return folder


def export(sources: list[Path], folder: Path, *options: str) -> int:
    return main(["export", *map(str, sources), str(folder), "--partition", *options])


def hashes(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*")
        if path.is_file()
    }


def test_every_row_is_there_once_with_its_ids(sources, trials) -> None:
    duckdb = pytest.importorskip("duckdb")
    for kind in ("frames", "pac"):
        rows = duckdb.sql(
            f"SELECT recording, finger, count(*), any_value(sensor), count(DISTINCT calibration) "
            f"FROM read_parquet('{trials}/{kind}/**/*.parquet') GROUP BY recording, finger"
        ).fetchall()
        found = {(name, finger): rest for name, finger, *rest in rows}
        for path in sources:
            recording, name = biotac.Recording(path), recording_id(path)[0]
            for finger in recording.fingers:
                count, sensor, calibrations = found.pop((name, finger))
                assert count == (getattr(recording, kind)["finger"] == finger).sum()
                assert sensor and calibrations == (path == sources[1])
        assert not found


def test_columns_and_values_are_those_of_the_parquet_export(sources, trials, tmp_path) -> None:
    assert main(["export", str(sources[0]), str(tmp_path / "a.parquet")]) == 0
    name, day = recording_id(sources[0])
    alone = pq.read_table(tmp_path / "a.parquet", partitioning=None)
    alone = alone.drop([f"applied_{axis}_n" for axis in "xyz"])  # known of simulated fingers only
    for finger in (0, 1):
        path = trials / f"frames/date={day}/finger={finger}/{name}.parquet"
        stored = pq.read_table(path, partitioning=None)
        own = alone.filter(pa.compute.equal(alone["finger"], finger)).drop(["finger"])
        assert set(stored.column_names) - set(own.column_names) == {
            "recording", "source", "board", "sensor", "calibration"
        }  # fmt: skip
        assert stored["frame_id"].to_pylist() == own["frame_id"].to_pylist()
        own = own.drop(["frame_id"])  # the dictionaries differ
        assert stored.select(own.column_names).equals(own)  # nulls, stamps and all
    assert alone["counts_E1"].null_count + alone["force_z_n"].null_count > 0


def test_each_recording_is_in_the_folder_of_its_day(sources, trials) -> None:
    days = {path.name for path in trials.glob("frames/*")}
    assert days == {f"date={recording_id(path)[1]}" for path in sources} and len(days) == 2
    assert {path.name for path in trials.glob("*/*/*")} == {"finger=0", "finger=1"}


def test_two_processes_write_the_same_bytes_as_one(sources, trials, tmp_path) -> None:
    assert export(sources, tmp_path / "two", "-j", "2") == 0
    assert hashes(tmp_path / "two") == hashes(trials)


def test_again_does_nothing_and_grown_files_replace(sources, tmp_path, capsys) -> None:
    folder, cut, grown = tmp_path / "out", tmp_path / "cut.mcap", tmp_path / "grown.mcap"
    recording = biotac.Recording(sources[1])
    messages = pairs(b"".join(blocks_of(recording)))
    first, second = packed(messages[: len(messages) // 2]), packed(messages[len(messages) // 2 :])
    for path, blocks in ((cut, [first]), (grown, [first, second])):
        written(path, recording.metadata, ((block, recording.begin_ns + k) for k, block in enumerate(blocks)))
    assert recording_id(cut) == recording_id(grown) != recording_id(sources[1])
    assert export([cut], folder) == 0
    assert 0 < rows_of(folder, "pac") < len(biotac.Recording(grown).pac)
    assert export([grown], folder) == 0
    before, stamps = hashes(folder), {path: path.stat().st_mtime_ns for path in folder.rglob("*.parquet")}
    assert rows_of(folder, "pac") == len(biotac.Recording(grown).pac)
    capsys.readouterr()
    assert export([cut, grown], folder, "--json") == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["exported"], facts["already_there"]) == (0, 2)
    assert hashes(folder) == before and stamps == {path: path.stat().st_mtime_ns for path in stamps}


def rows_of(folder: Path, kind: str) -> int:
    return sum(pq.read_metadata(path).num_rows for path in folder.glob(f"{kind}/*/*/*.parquet"))


@pytest.mark.parametrize("at", range(4))
def test_killed_between_any_two_files_the_same_command_completes_it(sources, trials, tmp_path, monkeypatch, at) -> None:
    """From this rename of an export on, as kill -9 leaves it; a recording has four files."""
    real, renames = os.replace, []

    def counted(source: Any, target: Any) -> None:
        if len(renames) == at:
            raise SystemExit
        renames.append(target)
        real(source, target)

    folder = tmp_path / "out"
    monkeypatch.setattr(os, "replace", counted)
    with pytest.raises(SystemExit):
        export(sources[:1], folder)
    monkeypatch.undo()
    assert len(list(folder.rglob("*.parquet"))) == at
    (folder / ".left.part").mkdir()
    (folder / ".left.part/frames.0").write_bytes(b"PAR1")
    assert export(sources, folder) == 0
    (folder / ".left.part/frames.0").unlink()
    assert hashes(folder) == hashes(trials)


def test_a_file_that_fails_is_named_and_the_rest_is_done(sources, trials, tmp_path, capsys) -> None:
    bad = tmp_path / "bad.mcap"
    bad.write_bytes(b"no recording")
    assert export([bad, *sources, tmp_path / "no.mcap"], tmp_path / "out") == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2 and "bad.mcap" in lines[0] and "no.mcap" in lines[1]
    assert hashes(tmp_path / "out") == hashes(trials)


def test_what_it_cannot_do_is_told(sources, tmp_path, capsys) -> None:
    for words, told in (
        ([str(tmp_path / "out"), "--partition"], "name the folder"),
        ([str(sources[0]), str(sources[1]), "--partition"], "is a file"),
        ([str(sources[0]), str(tmp_path / "out"), "--partition", "--recompute"], "as they are"),
        ([str(sources[0]), "--lake", "trials.lake"], "`biotac export RECS... DIR --partition`"),
    ):
        assert main(["export", *words]) == 2
        assert told in capsys.readouterr().err
    assert main(["lake", "sql", "SELECT 1", "trials.lake"]) == 2
    assert "`biotac export RECS... DIR --partition`" in capsys.readouterr().err


def test_pages_have_checksums_for_readers_that_ask(trials) -> None:
    """A flip at the end of a column lies in the body of its last page. Parquet's checksums leave page headers out."""
    good = next((trials / "frames").rglob("*.parquet")).read_bytes()
    row_group, draw = pq.ParquetFile(io.BytesIO(good)).metadata.row_group(0), random.Random(1)
    for column in map(row_group.column, range(row_group.num_columns)):
        first = column.dictionary_page_offset or column.data_page_offset
        flipped = bytearray(good)
        flipped[first + column.total_compressed_size - 1 - draw.randrange(8)] ^= 1 << draw.randrange(8)
        with pytest.raises((OSError, pa.ArrowException)):
            pq.read_table(io.BytesIO(flipped), page_checksum_verification=True)


LARGEST = (0.0, 200)  # force_z_n of the stored lake, with a second of rest, and the rows


def test_a_lake_of_before_is_read_by_duckdb() -> None:
    duckdb = pytest.importorskip("duckdb")
    found = duckdb.sql(
        f"SELECT board, max(force_z_n), count(*) FROM read_parquet('{OLD}/frames/**/*.parquet') GROUP BY 1"
    )
    assert found.fetchall() == [("posix-sim", *LARGEST)]
    sums = (OLD / "SHA256SUMS").read_text().splitlines()
    kept = {line.split()[1]: line.split()[0] for line in sums if (OLD / line.split()[1]).exists()}
    assert len(kept) == 2 and all(
        hashlib.sha256((OLD / path).read_bytes()).hexdigest() == digest for path, digest in kept.items()
    )


@pytest.mark.nightly  # the nightly set of packages has Polars and Dask
@pytest.mark.filterwarnings("ignore:The inplace keyword:DeprecationWarning")  # Dask's own use of pandas
def test_a_lake_of_before_is_read_by_polars_and_dask() -> None:
    import dask.dataframe as dd
    import polars as pl

    column = pl.scan_parquet(OLD / "frames", hive_partitioning=True).select("board", "date", "force_z_n").collect()
    assert (column["force_z_n"].max(), len(column)) == LARGEST and set(column["board"]) == {"posix-sim"}
    frames = dd.read_parquet(OLD / "frames", columns=["board", "force_z_n"])
    assert (frames["force_z_n"].max().compute(), len(frames)) == LARGEST


PROGRAMS = re.findall(r"```py\n(.*?)```", PAGE.read_text(encoding="utf-8"), flags=re.DOTALL)


@pytest.mark.parametrize(
    "library", ["duckdb", *(pytest.param(n, marks=pytest.mark.nightly) for n in ("polars", "dask"))]
)
def test_the_pages_programs_find_the_same_largest_presses(sources, trials, tmp_path, library: str) -> None:
    pytest.importorskip(library)
    (program,) = [text for text in PROGRAMS if f"import {library}" in text]
    (tmp_path / "recordings").mkdir()
    for path in sources:
        (tmp_path / "recordings" / path.name).symlink_to(path)
    if library != "dask":
        (tmp_path / "trials").symlink_to(trials)
    (tmp_path / "program.py").write_text(program)
    done = subprocess.run([sys.executable, "program.py"], cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    if library == "dask":
        assert hashes(tmp_path / "trials") == hashes(trials)
    largest_n = np.nanmax(np.abs(biotac.Recording(sources[1]).frames["force_n"][:, 2]))
    assert largest_n > 1 and f"{largest_n:.3f}"[:-1] in done.stdout, done.stdout


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:The inplace keyword:DeprecationWarning")  # Dask's own use of pandas
def test_dask_writes_and_reads_ten_thousand(sources, tmp_path) -> None:
    import dask.dataframe as dd
    import distributed
    import pandas as pd

    many, out = tmp_path / "many", tmp_path / "out"
    many.mkdir()
    made = copies(biotac.Recording(sources[0]), many, 10_000, 600.0)
    with (
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster,
        distributed.Client(cluster) as client,
    ):
        results = client.gather(client.map(partition, made, folder=out, pure=False))
        assert sum(result.rows for result in results) == sum(rows_of(out, kind) for kind in ("frames", "pac", "bands"))
        # By day, as on the page: of a task for each file Dask warns that the graph is large.
        days = sorted((out / "frames").glob("date=*"))
        frames = dd.from_map(pd.read_parquet, days, columns=["recording", "finger", "force_z_n"])
        largest = frames["force_z_n"].max().compute()
        assert len(frames) == 10_000 * len(biotac.Recording(sources[0]).frames)
    assert largest == np.nanmax(biotac.Recording(sources[0]).frames["force_n"][:, 2])
    assert export(made[::1000], tmp_path / "some") == 0  # by the command: the same bytes
    everything = hashes(out)
    assert hashes(tmp_path / "some").items() <= everything.items()
