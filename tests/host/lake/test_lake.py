"""A lake: the recordings' own numbers, once each, whoever wrote it and however often it was interrupted."""

from __future__ import annotations

import contextlib
import csv
import hashlib
import io
import json
import os
import random
import shutil
import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.dataset as ds
import pyarrow.parquet as pq
import pytest
from maps import make_map
from record_all import blocks_of, record_all, written

import biotac
from biotac.cli.main import main
from biotac.errors import InputError
from biotac.export.messages import message_tables
from biotac.lake import checking, ids
from biotac.lake import folder as lake_folder
from biotac.recording.layout import CHECKSUM
from biotac.recording.mcap_file import RecordingFile
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode


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
    """With faults, so that there are missing words; with heartbeats, a calibration and a map."""
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
def lake(sources, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("lake") / "lake"
    assert export(sources, folder) == 0
    return folder


def export(sources: list[Path], folder: Path, *options: str) -> int:
    return main(["export", *map(str, sources), "--lake", str(folder), *options])


def sql(capsys: pytest.CaptureFixture[str], lake: Path, query: str) -> list[dict[str, Any]]:
    capsys.readouterr()
    assert main(["lake", "sql", query, str(lake), "--json"]) == 0
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def hashes(folder: Path) -> dict[str, str]:
    """Of all files; those of the list of checksums are the same."""
    found = {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in folder.rglob("*.parquet")
    }
    lake = lake_folder.opened(folder)
    assert lake.sums == found and not lake.unlisted
    return found


def file_of(folder: Path, topic: str, recording: str) -> Path:
    (path,) = folder.glob(f"{topic}/*/*/{recording}.parquet")
    return path


def test_frames_become_the_wire_again_to_the_bit(sources, lake) -> None:
    """In their order by time and finger, as a lake has them."""
    for source in sources:
        sent = biotac.Recording(source).wire
        table = pq.read_table(file_of(lake, "frames", ids.recording_id(source)[0]), partitioning=None)
        order = np.lexsort((sent["finger"], biotac.Recording(source).t_us))
        assert checking.messages_of(table).tobytes() == sent[order].tobytes()


def test_every_row_of_every_topic_is_there_with_its_ids(sources, lake, capsys) -> None:
    by_id = {ids.recording_id(path)[0]: biotac.Recording(path) for path in sources}
    assert len(by_id) == len(sources)
    assert {row["recording"] for row in sql(capsys, lake, "SELECT recording FROM recordings")} == set(by_id)
    for topic, rows_of in {
        "frames": lambda rec: rec.frames,
        "pac": lambda rec: rec.pac,
        "bands": lambda rec: rec.bands,
        "idle": lambda rec: rec.idle,
        "tare": lambda rec: [m for m in rec.messages if isinstance(m, wire.Tare)],
        "status": lambda rec: [m for m in rec.messages if isinstance(m, wire.Status)],
    }.items():
        rows = sql(capsys, lake, f"SELECT recording, count(*) AS n FROM {topic} GROUP BY recording")
        assert {row["recording"]: row["n"] for row in rows} == {
            name: len(rows_of(rec)) for name, rec in by_id.items() if len(rows_of(rec))
        }
    name, own = next((name, rec) for name, rec in by_id.items() if rec.calibrations)
    rows = sql(capsys, lake, f"SELECT DISTINCT finger, sensor, calibration FROM frames WHERE recording = '{name}'")
    assert {row["finger"]: row["sensor"] for row in rows} == ids.sensors(own)
    assert {row["finger"]: row["calibration"] for row in rows} == ids.calibrations(own)
    assert len({row["calibration"] for row in rows}) == 2  # and without one it is null
    assert sql(capsys, lake, "SELECT count(*) AS n FROM frames WHERE calibration IS NULL")[0]["n"] == sum(
        len(rec.frames) for rec in by_id.values() if rec is not own
    )


def test_columns_are_those_of_the_parquet_export(sources, lake, tmp_path) -> None:
    assert main(["export", str(sources[0]), str(tmp_path / "a.parquet")]) == 0
    stored = file_of(lake, "frames", ids.recording_id(sources[0])[0])
    alone, in_lake = (pq.read_table(path, partitioning=None) for path in (tmp_path / "a.parquet", stored))
    assert set(in_lake.column_names) - set(alone.column_names) == {"recording", "sensor", "calibration"}
    alone = alone.drop([f"applied_{axis}_n" for axis in "xyz"])  # known of simulated fingers only
    assert in_lake.select(alone.column_names).equals(alone)  # nulls, stamps and all
    assert in_lake["counts_E1"].null_count + in_lake["force_z_n"].null_count > 0


def test_other_programs_read_it_as_it_is(sources, lake) -> None:
    data = ds.dataset(lake / "frames", partitioning="hive")
    assert {"board", "date", "recording", "force_z_n"} <= set(data.schema.names)
    assert data.count_rows() == sum(len(biotac.Recording(path).frames) for path in sources)
    days = data.to_table(columns=["date"])["date"].to_pylist()
    assert len(set(days)) == 2  # one of them is a day later


def test_times_of_messages_are_unwrapped(sources) -> None:
    """Of a board that has run for three and a half hours: 32 bits of us are 71.6 min."""
    status = next(m for m in biotac.Recording(sources[0]).messages if isinstance(m, wire.Status))
    t_us = [3 * 2**32 - 900_000, 3 * 2**32 + 100_000]
    recording = SimpleNamespace(
        messages=[replace(status, t_us=at % 2**32) for at in t_us],
        begin_us=3 * 2**32 - 1_000_000,
        stamp_ns=lambda t_us: t_us * 1000,
    )
    (table,) = message_tables(recording)
    assert table.kind == "status" and table.finger is None
    assert table.arrays["t_us"].tolist() == t_us


def test_again_does_nothing_and_grown_files_replace(sources, tmp_path, capsys) -> None:
    folder, cut, grown = tmp_path / "lake", tmp_path / "cut.mcap", tmp_path / "grown.mcap"
    recording = biotac.Recording(sources[1])
    data = b"".join(blocks_of(recording))
    middle = data.index(b"\0", len(data) // 2) + 1
    for path, blocks in ((cut, [data[:middle]]), (grown, [data[:middle], data[middle:]])):
        written(path, recording.metadata, ((block, recording.begin_ns + k) for k, block in enumerate(blocks)))
    whole = biotac.Recording(grown)
    assert ids.recording_id(cut) == ids.recording_id(grown) != ids.recording_id(sources[1])
    assert export([cut], folder) == 0
    some = sql(capsys, folder, "SELECT count(*) AS n FROM pac")[0]["n"]
    assert 0 < some < len(whole.pac)
    assert export([grown, cut, grown], folder) == 0
    assert export([grown, cut], tmp_path / "at_once") == 0
    assert hashes(tmp_path / "at_once") == hashes(folder)
    before = hashes(folder)
    stamps = {path: path.stat().st_mtime_ns for path in folder.rglob("*.parquet")}
    assert sql(capsys, folder, "SELECT count(*) AS n FROM pac")[0]["n"] == len(whole.pac)
    assert export([cut, grown], folder, "--json") == 0
    assert json.loads(capsys.readouterr().out)["exported"] == 0
    assert hashes(folder) == before and stamps == {path: path.stat().st_mtime_ns for path in stamps}


def test_two_processes_write_the_same_bytes_as_one(sources, lake, tmp_path) -> None:
    assert export(sources, tmp_path / "two", "-j", "2") == 0
    assert hashes(tmp_path / "two") == hashes(lake)


@pytest.mark.nightly  # whose set of packages has Dask
def test_dask_writes_the_same_bytes(sources, lake, tmp_path, capsys) -> None:
    import distributed

    with distributed.LocalCluster(
        n_workers=2, processes=False, protocol="tcp", dashboard_address=None, threads_per_worker=1
    ) as cluster:
        address = cluster.scheduler_address
        assert export([*sources, tmp_path / "no.mcap"], tmp_path / "dask", "--dask", address) == 2
        assert "no.mcap cannot be read" in capsys.readouterr().err
        assert main(["lake", "check", str(tmp_path / "dask"), "--dask", address]) == 0
    assert hashes(tmp_path / "dask") == hashes(lake)


def kill_at(monkeypatch: pytest.MonkeyPatch, rename: int) -> None:
    """From this rename of an export on, as kill -9 leaves it: no handler runs between two."""
    real, renames = os.replace, []

    def counted(source: Any, target: Any) -> None:
        if len(renames) == rename:
            raise SystemExit
        renames.append(target)
        real(source, target)

    monkeypatch.setattr("biotac.lake.writing.os.replace", counted)


@pytest.mark.parametrize("at", [0, 3, 7, *(pytest.param(k, marks=pytest.mark.nightly) for k in (1, 2, 4, 5, 6))])
def test_killed_at_any_rename_nothing_is_twice_or_missing(
    sources, lake, tmp_path, capsys, monkeypatch, at: int
) -> None:
    folder = tmp_path / "lake"
    assert export(sources[1:2], folder) == 0
    kill_at(monkeypatch, at)
    monkeypatch.setattr("biotac.lake.folder.whole", nothing_written)
    with pytest.raises(SystemExit):
        export(sources, folder)
    monkeypatch.undo()
    (folder / lake_folder.PARTIAL / "left").mkdir(parents=True)
    assert len(lake_folder.opened(folder).unlisted) == at % 7
    assert sql(capsys, folder, "SELECT count(*) AS n FROM frames")[0]["n"] in {
        sum(len(biotac.Recording(path).frames) for path in some) for some in (sources[1:2], sources[:2])
    }
    assert export(sources, folder) == 0
    assert hashes(folder) == hashes(lake)
    assert not (folder / lake_folder.PARTIAL).exists()


def nothing_written(path: Path, *, overwrite: bool) -> Any:
    return contextlib.nullcontext(path.with_name(".unfinished"))


def test_what_was_written_but_not_listed_is_written_again(sources, lake, tmp_path, capsys) -> None:
    """As after a kill between the last rename and the list, which may end in half a line."""
    folder = tmp_path / "lake"
    shutil.copytree(lake, folder)
    sums = folder / lake_folder.SUMS
    lines = sums.read_text().splitlines(keepends=True)
    sums.write_text("".join(lines[: len(lines) // 2]) + lines[-1][:20])
    assert main(["lake", "check", str(folder)]) == 1
    assert "is not in the list of checksums" in capsys.readouterr().out
    assert export(sources, folder) == 0
    assert hashes(folder) == hashes(lake)


def test_a_recording_killed_while_it_is_replaced_is_in_no_answer(sources, tmp_path, capsys, monkeypatch) -> None:
    """New files beside the old facts would be rows that these do not describe."""
    folder = tmp_path / "lake"
    assert export(sources[:2], folder) == 0
    whole = hashes(folder)
    kill_at(monkeypatch, 2)
    with pytest.raises(SystemExit):
        export(sources[1:2], folder, "--force")
    monkeypatch.undo()
    rows = sql(capsys, folder, "SELECT count(*) AS n FROM frames")[0]["n"]
    assert rows == len(biotac.Recording(sources[0]).frames)
    assert export(sources[1:2], folder) == 0 and hashes(folder) == whole


def test_a_file_that_fails_is_named_and_the_rest_is_done(sources, lake, tmp_path, capsys) -> None:
    bad = tmp_path / "bad.mcap"
    bad.write_bytes(b"no recording")
    assert export([bad, *sources, tmp_path / "no.mcap"], tmp_path / "lake") == 2
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 2 and "bad.mcap" in lines[0] and "no.mcap" in lines[1]
    assert hashes(tmp_path / "lake") == hashes(lake)


def test_check_runs_the_crosscheck_over_all_of_it(sources, lake, capsys) -> None:
    assert main(["lake", "check", str(lake), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert facts["good"] and facts["recordings"] == len(sources) and facts["violations"] == 0
    one_by_one = []
    for source in sources:
        assert main(["check", str(source), "--json"]) == 0
        one_by_one.append(json.loads(capsys.readouterr().out)["crosscheck"])
    for name in ("poc_um_max", "force_mn_max", "torque_nmm_max"):
        assert facts[name] == max(part[name] for part in one_by_one)
    assert facts["frames"] == sum(part["frames"] for part in one_by_one)


def test_what_threads_of_arrow_read_is_in_memory_of_arrow(lake, monkeypatch) -> None:
    # A thread that drops a Python object when the program ends aborts it: check did in 5 of 104 runs, four at a time.
    read, used = pq.read_table, []

    def counted(source: Any) -> pa.Table:
        used.append(pa.total_allocated_bytes() - before)
        return read(source)

    monkeypatch.setattr(checking.pq, "read_table", counted)
    recording, sums = next(iter(lake_folder.opened(lake).recordings.items()))
    frames = next(path for path in sums if path.startswith("frames/"))
    before = pa.total_allocated_bytes()
    checking.check(str(lake), (recording, {frames: sums[frames]}))
    assert used[0] >= (lake / frames).stat().st_size


def test_check_finds_what_is_wrong(sources, lake, tmp_path, capsys) -> None:
    folder = tmp_path / "lake"
    shutil.copytree(lake, folder)
    first, second, *_ = sorted(lake_folder.opened(folder).recordings)
    flipped = bytearray(file_of(folder, "frames", first).read_bytes())
    flipped[len(flipped) // 2] ^= 1
    file_of(folder, "frames", first).write_bytes(flipped)
    file_of(folder, "pac", second).unlink()
    assert main(["lake", "check", str(folder)]) == 1
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) == 3
    assert any("differs from what was exported" in line and first in line for line in lines)
    assert any("is missing" in line and second in line for line in lines)
    assert export(sources, folder, "--force") == 0
    assert hashes(folder) == hashes(lake)


def test_a_flip_anywhere_is_found_and_nothing_damaged_is_parsed(lake, tmp_path, capsys) -> None:
    """In any file or name, and in the list: pyarrow aborts the process on some damaged footers."""
    folder = tmp_path / "lake"
    shutil.copytree(lake, folder)
    draw = random.Random(1)
    files = sorted(path for path in folder.rglob("*") if path.is_file() and not path.name.startswith("."))
    for _ in range(50):
        path = draw.choice([*files, folder / lake_folder.SUMS])
        good = path.read_bytes()
        flipped = bytearray(good)
        flipped[draw.randrange(len(good))] ^= 1 << draw.randrange(8)
        path.write_bytes(flipped)
        assert main(["lake", "check", str(folder)]) in (1, 2), path
        path.write_bytes(good)
    capsys.readouterr()
    assert main(["lake", "check", str(folder)]) == 0


def test_pages_have_checksums_for_readers_that_ask(lake, tmp_path) -> None:
    """A flip in a page's header may change nothing; what is read is never something else."""
    good = next((lake / "frames").rglob("*.parquet")).read_bytes()
    pages, draw, refused = len(good) - 8 - int.from_bytes(good[-8:-4], "little"), random.Random(1), 0
    for _ in range(40):
        flipped = bytearray(good)
        flipped[draw.randrange(4, pages)] ^= 1 << draw.randrange(8)
        try:
            read = pq.read_table(io.BytesIO(flipped), page_checksum_verification=True)
            assert read.equals(pq.read_table(io.BytesIO(good)))
        except (OSError, pa.ArrowException):
            refused += 1
    assert refused > 20


@pytest.mark.parametrize("change", ["board", "date", "no list", "empty list", "fifo", "foreign"])
def test_what_the_checksums_do_not_cover_is_found(lake, tmp_path, capsys, change: str) -> None:
    folder = tmp_path / "lake"
    shutil.copytree(lake, folder)
    first = next(iter(lake_folder.opened(folder).recordings))
    file = file_of(folder, "frames", first)
    if change == "board":
        file.parent.parent.rename(file.parent.parent.with_name("board=another"))
    elif change == "date":
        file.parent.rename(file.parent.with_name("date=2001-01-01"))
    elif change == "no list":
        (folder / lake_folder.SUMS).unlink()
    elif change == "empty list":
        (folder / lake_folder.SUMS).write_text("")
    elif change == "fifo":
        file.unlink()
        os.mkfifo(file)
    else:
        (folder / "frames" / "other.parquet").write_bytes(b"PAR1")
    assert main(["lake", "check", str(folder)]) in (1, 2)
    if change != "foreign":
        assert main(["lake", "sql", "SELECT count(*) FROM frames", str(folder)]) == 2
    elif change == "foreign":
        assert "not in the list of checksums" in capsys.readouterr().out


def test_folders_above_and_links_change_no_answer(lake, tmp_path, capsys) -> None:
    """finger=3/ above the lake is no column, and a partition may be elsewhere."""
    count = "SELECT finger, board, count(*) AS n FROM frames GROUP BY ALL ORDER BY ALL"
    expected = sql(capsys, lake, count)
    folder = tmp_path / "finger=3" / "board=x" / "date=2001-01-01" / "lake"
    shutil.copytree(lake, folder)
    assert sql(capsys, folder, count) == expected
    partition = next((folder / "frames").iterdir())
    shutil.move(partition, tmp_path / "elsewhere")
    partition.symlink_to(tmp_path / "elsewhere")
    assert sql(capsys, folder, count) == expected
    assert main(["lake", "check", str(folder)]) == 0
    assert sql(capsys, folder, "SELECT DISTINCT strftime(date, '%Y') AS year FROM frames")[0]["year"] != "2001"


def test_a_wrong_result_is_found(sources, tmp_path, capsys) -> None:
    """A board that is wrong by 1 mN, once."""
    real = biotac.Recording(sources[0])
    sent = real.wire.copy()
    at = int(np.flatnonzero(sent["force_100un"][:, 2] != wire.INVALID_I32)[-1])
    sent["force_100un"][at, 2] += 10
    block = b"".join(encode(wire.Frame.ID, row.tobytes()) for row in sent)
    written(tmp_path / "wrong.mcap", real.metadata, [(block, real.begin_ns)])
    assert export([tmp_path / "wrong.mcap"], tmp_path / "lake") == 0
    assert main(["lake", "check", str(tmp_path / "lake")]) == 1
    assert f"frame {sent['seq'][at]} " in capsys.readouterr().out


def test_a_folder_with_other_files_is_not_made_a_lake(sources, tmp_path, capsys) -> None:
    (tmp_path / "mine.txt").write_text("mine")
    assert export(sources[:1], tmp_path) == 2
    assert "is not a lake" in capsys.readouterr().err


def test_two_exports_at_once_are_refused_in_words(sources, lake) -> None:
    with (
        lake_folder.writing(lake),
        pytest.raises(InputError, match="another export is writing"),
        lake_folder.writing(lake),
    ):
        pass


def test_sql_prints_csv_and_says_what_is_wrong(lake, capsys) -> None:
    assert main(["lake", "sql", "SELECT count(*) AS n, NULL AS nothing FROM recordings", str(lake)]) == 0
    assert list(csv.reader(io.StringIO(capsys.readouterr().out))) == [["n", "nothing"], ["3", ""]]
    for query, columns in (
        ("SELECT force_z FROM frames", '; Candidate bindings: "'),
        ("SELECT f.force_z FROM frames f", "; the query 'DESCRIBE TOPIC' lists columns"),  # DuckDB names none
    ):
        assert main(["lake", "sql", query, str(lake)]) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert columns in line and "; topics are bands, frames" in line
        assert "!" not in line and "LINE" not in line
    assert "force_z_n" in {row["column_name"] for row in sql(capsys, lake, "DESCRIBE frames")}


@pytest.mark.nightly
def test_five_hundred_killed_half_way(sources, tmp_path) -> None:
    """kill -9 of the command with its workers, at ten moments, then once to the end."""
    many = tmp_path / "many"
    many.mkdir()
    made = copies(biotac.Recording(sources[0]), many, 500, 600.0)
    command = [sys.executable, "-m", "biotac", "export", *map(str, made), "--lake", str(tmp_path / "lake"), "-j", "2"]

    def complete() -> int:
        return len(list((tmp_path / "lake" / lake_folder.RECORDINGS).rglob("*.parquet")))

    killed = 0
    for _ in range(10):
        running = subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL)
        target = complete() + 30
        while running.poll() is None and complete() < target:
            os.sched_yield()
        if running.poll() is None:
            os.killpg(running.pid, signal.SIGKILL)
            killed += 1
        running.wait()
    assert killed == 10
    assert subprocess.run(command, stdout=subprocess.DEVNULL, check=False).returncode == 0
    assert export(made, tmp_path / "once") == 0
    assert hashes(tmp_path / "lake") == hashes(tmp_path / "once")
    assert len(lake_folder.opened(tmp_path / "lake").recordings) == 500
