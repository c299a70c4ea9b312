"""Exports, read back by the formats' own libraries: the same numbers in SI units, NaN where invalid, or nothing."""

import csv
import json
import os
import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import scipy
from mcap.reader import make_reader
from record_all import blocks_of, record_all
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

import biotac
from biotac.board.gap import Gap
from biotac.cli.main import main
from biotac.core.bands import pac_bands
from biotac.export import BANDS_COLUMNS, COLUMNS, FORMATS, PAC_COLUMNS
from biotac.export.columns import APPLIED, GAP, STAMP
from biotac.recording.mcap_file import RecordingFile
from biotac.wire.batches import StreamDecoder
from biotac.wire.fields import BANDS_FIELDS, FRAME_FIELDS, IDLE_FIELDS, PAC_FIELDS

GAP_S = 2.5
SPAN_S = (1.0, 1.5)
FINGERS = 2


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> biotac.Recording:
    """A recording with faults, for missing words and invalid results."""
    folder = tmp_path_factory.mktemp("export")
    whole = biotac.Recording(record_all(f"sim:faults.toml?fingers={FINGERS}", folder / "whole.mcap"))
    recording = written_again(whole, folder / "a.mcap", {1: GAP_S})
    for text in ("held", "ü"):
        recording.mark(text, *SPAN_S, finger=1)
    assert np.isnan(recording.frames["poc_mm"]).any() and (recording.frames["counts"] == 65535).any()
    return recording


def written_again(whole: biotac.Recording, path: Path, gaps_s: dict[int, float], later_ns: int = 0) -> biotac.Recording:
    """``whole`` with gaps before blocks."""
    file = RecordingFile(path.open("xb"), whole.metadata)
    for k, block in enumerate(blocks_of(whole)):
        at_ns = whole.arrived_ns[k] + later_ns
        if k in gaps_s:
            file.add_gap(Gap("silence", None, first_us(whole, k), at_ns - round(gaps_s[k] * 1e9), at_ns, 7))
        file.add(block, at_ns, applied_n=lambda *_, k=k: whole.applied_in(k))
    file.close()
    return biotac.Recording(path)


def first_us(recording: biotac.Recording, block: int) -> int:
    first_us = StreamDecoder().feed_packets(blocks_of(recording)[block]).first_t_us()
    assert first_us is not None
    return first_us


def expected(recording: biotac.Recording, finger: int) -> dict[str, np.ndarray]:
    """The columns of biotac.load, from the wire's integers by MESSAGES.md's units; the stamps are the recording's."""
    own = recording.frames["finger"] == finger
    frames, sent = recording.frames[own], recording.wire[own]
    since_us = frames["t_us"] - recording.frames["t_us"].min()

    def scaled(name: str, per_unit: int, invalid: int) -> np.ndarray:
        return np.where(sent[name] == invalid, np.nan, sent[name] / per_unit)

    return {
        "seq": frames["seq"],
        "t_us": frames["t_us"],
        "stamp_ns": recording.arrived_ns[0] + since_us * 1000,
        "counts": sent["counts"],
        "pdc": sent["pdc"],
        "tac": sent["tac"],
        "tdc": sent["tdc"],
        "tare": scaled("tare_q4", 16, 65535),
        "pdc_tare": scaled("pdc_tare_q4", 16, 65535),
        "tare_state": sent["tare_state"],
        "poc_mm": scaled("poc_um", 1000, -(2**15)),
        "force_n": scaled("force_100un", 10_000, -(2**31)),
        "torque_nmm": scaled("torque_mnmm", 1000, -(2**31)),
        "pdc_filtered": scaled("pdc_filtered_q4", 16, 65535),
        "pressure_force_n": scaled("pressure_force_100un", 10_000, -(2**31)),
        "torsion_nmm": scaled("torsion_mnmm", 1000, -(2**31)),
        "wrench_age_ms": sent["wrench_age_ms"],
        "electrodes_out": sent["electrodes_out"],
        "normal_n": scaled("normal_mn", 1000, 65535),
        "normal_half_n": scaled("normal_half_mn", 1000, 65535),
        "shear_n": scaled("shear_mn", 1000, 65535),
        "shear_half_n": scaled("shear_half_mn", 1000, 65535),
        "flags": sent["flags"],
        "trust": sent["trust"],
        "slip_level": sent["slip_level"],
        "gap_s": GAP_S * (np.arange(len(frames)) == np.searchsorted(frames["t_us"], recording.gaps[0].next_t_us)),
        "applied_n": recording.applied_n[own],  # recording/test_applied.py
        "label": np.where((SPAN_S[0] * 1e6 <= since_us) & (since_us <= SPAN_S[1] * 1e6), "held; ü" * (finger == 1), ""),
    }


def expected_pac(recording: biotac.Recording, finger: int) -> dict[str, np.ndarray]:
    rows = recording.pac[recording.pac["finger"] == finger]
    stamp_ns = recording.arrived_ns[0] + (rows["t_us"] - recording.frames["t_us"].min()) * 1000
    return {"seq": rows["seq"], "t_us": rows["t_us"], "stamp_ns": stamp_ns, "pac": rows["pac"]}


def expected_bands(recording: biotac.Recording, finger: int) -> dict[str, np.ndarray]:
    pac = expected_pac(recording, finger)
    energy = pac_bands(pac.pop("pac"))  # no word is missing
    return {**pac, "good": np.full(len(energy), 22, np.uint8), "energy_count2": energy}


KINDS = (
    ("", (*COLUMNS, APPLIED), expected),
    (".pac", PAC_COLUMNS, expected_pac),
    (".bands", BANDS_COLUMNS, expected_bands),
)


def same(got: Any, wanted: np.ndarray) -> bool:
    """Equal to the bit, NaN at the same places."""
    return bool(np.array_equal(np.asarray(got), wanted, equal_nan=wanted.dtype.kind == "f"))


def export(recording: biotac.Recording, out: Path, *options: str) -> int:
    return main(["export", str(recording.path), str(out), *options])


def test_every_column_is_documented_and_has_a_unit() -> None:
    docs = Path(__file__).parents[3] / "host" / "docs"
    text = (docs / "guides" / "recording.md").read_text()
    assert all(f"`{suffix}`" in text for suffix in FORMATS)
    page = (docs / "reference" / "rows.md").read_text()
    assert re.findall(r"^\| `.*$", page, re.MULTILINE) == [
        f"| `{f.name}` | {f.unit} | {' to '.join(f.parts[:: len(f.parts) - 1]) if f.parts else ''} "
        f"| {np.dtype(f.dtype)} | {f.what} |"
        for f in (*FRAME_FIELDS, *PAC_FIELDS, *BANDS_FIELDS, *IDLE_FIELDS, STAMP, GAP, APPLIED)
    ]


def test_what_is_loaded_is_what_was_live_to_the_bit(tmp_path) -> None:
    """Also where words are missing and results invalid; the exports below are held to the loaded columns."""
    with biotac.open(f"sim:faults.toml?fingers={FINGERS}&seconds=6") as hand:
        hand.record(tmp_path / "a.mcap")
        live = hand.read_batch(100).frames
    with pytest.warns(biotac.RecordingWarning, match="gap"):
        loaded = biotac.load(tmp_path / "a.mcap")
    for rows in (loaded, biotac.Recording(tmp_path / "a.mcap").frames):
        assert (rows.dtype, rows.tobytes()) == (live.dtype, live.tobytes())


def test_csv_has_every_number_of_every_frame(recorded, tmp_path, capsys) -> None:
    assert export(recorded, tmp_path / "a.csv", "--json") == 0
    assert json.loads(capsys.readouterr().out)["written"] == [
        str(tmp_path / n) for n in ("a.csv", "a.pac.csv", "a.bands.csv")
    ]
    for kind, columns, wanted_of in KINDS:
        name = f"a{kind}.csv"
        with (tmp_path / name).open(newline="", encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
        # Polars reads a column with "nan" as text.
        assert not any("nan" in row.values() for row in rows) and (kind or any("NaN" in row.values() for row in rows))
        times = [int(row["t_us"]) for row in rows]
        assert times == sorted(times)
        for finger in range(FINGERS):
            own = [row for row in rows if row["frame_id"] == f"biotac_finger{finger}"]
            assert {row["finger"] for row in own} == {str(finger)}
            for column in columns:
                names = column.flat_names()
                wanted = wanted_of(recorded, finger)[column.name].reshape(len(own), -1)
                got = np.array([[row[n] for n in names] for row in own])
                kind_of = got.dtype if column.dtype == "U" else float
                assert same(got.astype(kind_of), wanted.astype(kind_of)), column.name


def test_parquet_says_units_and_frames(recorded, tmp_path) -> None:
    assert export(recorded, tmp_path / "a.parquet") == 0
    for kind, columns, wanted_of in KINDS:
        table = pq.read_table(tmp_path / f"a{kind}.parquet")
        for finger in range(FINGERS):
            own = table.filter([i.as_py() == f"biotac_finger{finger}" for i in table["frame_id"]])
            assert set(own["finger"].to_pylist()) == {finger}
            for column in columns:
                wanted = wanted_of(recorded, finger)[column.name].reshape(len(own), -1)
                for k, flat in enumerate(column.flat_names()):
                    missing = np.isnan(wanted[:, k]) if wanted.dtype.kind == "f" else wanted[:, k] == column.invalid
                    assert own[flat].is_null().to_numpy().tolist() == missing.tolist(), flat
                    assert same(own[flat].drop_null().to_numpy(), wanted[:, k][~missing]), flat
                    assert table.schema.field(flat).metadata[b"unit"].decode() == column.unit


def test_hdf5_has_a_dataset_a_column(recorded, tmp_path) -> None:
    import h5py

    assert export(recorded, tmp_path / "a.h5") == 0
    with h5py.File(tmp_path / "a.h5") as file:
        assert file.attrs["firmware"] == biotac.__version__
        for finger in range(FINGERS):
            for kind, columns, wanted_of in KINDS:
                group = file[f"finger{finger}/{kind[1:] or 'frames'}"]
                assert group.attrs["frame_id"] == f"biotac_finger{finger}"
                wanted = wanted_of(recorded, finger)
                assert set(group) == set(wanted)
                for column in columns:
                    data = group[column.name].asstr() if column.dtype == "U" else group[column.name]
                    assert same(data[:], wanted[column.name]), column.name
                    assert group[column.name].attrs["unit"] == column.unit


def test_npz_says_what_its_columns_are(recorded, tmp_path) -> None:
    assert export(recorded, tmp_path / "a.npz") == 0
    with np.load(tmp_path / "a.npz") as arrays:
        about = json.loads(str(arrays["columns"]))
        assert about["frame_id"]["finger1"] == "biotac_finger1"
        assert {c["name"]: c["unit"] for c in about["frames"]}["torque_nmm"] == "N*mm"
        for finger in range(FINGERS):
            for kind, _, wanted_of in KINDS:
                for name, values in wanted_of(recorded, finger).items():
                    assert same(arrays[f"finger{finger}/{kind[1:] or 'frames'}/{name}"], values), name


def test_matlab_has_a_struct_a_finger(recorded, tmp_path) -> None:
    assert export(recorded, tmp_path / "a.mat") == 0
    file = scipy.io.loadmat(tmp_path / "a.mat", simplify_cells=True)
    assert file["columns"]["frames"]["torque_nmm"]["unit"] == "N*mm" and file["finger1"]["frame_id"] == "biotac_finger1"
    for finger in range(FINGERS):
        for kind, _, wanted_of in KINDS:
            table = file[f"finger{finger}"][kind[1:] or "frames"]
            if not kind:  # an empty text is an empty matrix there
                table["label"] = [text if len(text) else "" for text in table["label"]]
            assert all(same(table[name], values) for name, values in wanted_of(recorded, finger).items())


def test_a_ros_bag_plays_with_standard_messages(recorded, tmp_path) -> None:
    assert export(recorded, tmp_path / "a.ros2") == 0
    got: dict[str, list[tuple[int, Any]]] = {}
    with AnyReader([tmp_path / "a.ros2"], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        for connection, stamp_ns, data in bag.messages():
            got.setdefault(connection.topic, []).append((stamp_ns, bag.deserialize(data, connection.msgtype)))
    for finger in range(FINGERS):
        wanted, pac = expected(recorded, finger), expected_pac(recorded, finger)
        names = ("wrench", "poc", "flags", "trust", "slip", "counts", "pac", "bands")
        topics = {name: got[f"/biotac/finger{finger}/{name}"] for name in names}
        for name, vectors in (
            ("force_n", [m.wrench.force for _, m in topics["wrench"]]),
            ("torque_nmm", [m.wrench.torque for _, m in topics["wrench"]]),
            ("poc_mm", [m.point for _, m in topics["poc"]]),
        ):
            si = wanted[name] / 1000 if name.endswith("mm") else wanted[name]  # m and N*m (REP 103)
            assert same([[v.x, v.y, v.z] for v in vectors], si), name
        for name in ("wrench", "poc"):
            stamps = [stamp for stamp, _ in topics[name]]
            assert stamps == wanted["stamp_ns"].tolist()
            headers = [m.header for _, m in topics[name]]
            assert [h.stamp.sec * 10**9 + h.stamp.nanosec for h in headers] == stamps
            assert {h.frame_id for h in headers} == {f"biotac_finger{finger}"}
        for name, column in (("flags", "flags"), ("trust", "trust"), ("slip", "slip_level")):
            assert [m.data for _, m in topics[name]] == wanted[column].tolist()
        slow = np.column_stack([wanted["counts"], wanted["pdc"], wanted["tac"], wanted["tdc"]])
        assert np.array_equal([m.data for _, m in topics["counts"]], slow)
        assert np.array_equal([m.data for _, m in topics["pac"]], pac["pac"])
        assert np.array_equal([m.data for _, m in topics["bands"]], expected_bands(recorded, finger)["energy_count2"])


def test_one_mcap_file_is_the_bag_for_programs_that_draw(recorded, tmp_path) -> None:
    assert export(recorded, tmp_path / "a.ros2") == export(recorded, tmp_path / "a.mcap") == 0
    found = []
    for file in (tmp_path / "a.mcap", *(tmp_path / "a.ros2").glob("*.mcap")):
        with file.open("rb") as stream:
            messages = [(s, c.topic, c.message_encoding, m) for s, c, m in make_reader(stream).iter_messages() if s]
        assert {(s.encoding, encoding) for s, _, encoding, _ in messages} == {("ros2msg", "cdr")}
        found.append([(s.name, topic, m.log_time, m.data) for s, topic, _, m in messages])
    assert found[0] == found[1] and len(found[0]) > 100
    with pytest.raises(biotac.RecordingError, match="not a biotac recording"):
        biotac.Recording(tmp_path / "a.mcap")


def test_a_ros_bag_has_gaps_and_outlives_2038(recorded, tmp_path) -> None:
    late = written_again(recorded, tmp_path / "late.mcap", {1: GAP_S}, later_ns=20 * 365 * 86_400 * 10**9)
    assert export(late, tmp_path / "a.ros2") == 0
    with AnyReader([tmp_path / "a.ros2"], default_typestore=get_typestore(Stores.ROS2_HUMBLE)) as bag:
        ((_, stamp_ns, data),) = bag.messages([c for c in bag.connections if c.topic == "/biotac/log"])
        assert stamp_ns == late.stamp_ns(np.array([late.gaps[0].next_t_us]))[0]
        assert bag.deserialize(data, "rcl_interfaces/msg/Log").msg == late.gaps[0].line()


@pytest.mark.parametrize("suffix", list(FORMATS))
def test_nothing_is_overwritten_unasked(recorded, tmp_path, capsys, suffix: str) -> None:
    out = tmp_path / f"a{suffix}"
    out.write_text("mine")
    assert export(recorded, out) == 2
    assert "--force" in capsys.readouterr().err
    assert out.read_text() == "mine" and list(tmp_path.iterdir()) == [out]
    assert export(recorded, out, "--force") == 0
    if out.is_dir():  # a bag
        assert export(recorded, out, "--force") == 0
    assert out.is_dir() or out.read_bytes() != b"mine"


@pytest.mark.parametrize(("suffix", "step"), [*((suffix, 1) for suffix in FORMATS), (".csv", 2)])
def test_an_interrupted_export_leaves_nothing_and_says_so(
    recorded, tmp_path, capsys, interrupt_at, suffix: str, step: int
) -> None:
    interrupt_at(lambda k, text: k == step)
    assert export(recorded, tmp_path / f"a{suffix}") == 130
    error = capsys.readouterr().err
    assert "interrupted" in error and "was not written; the partial file was removed" in error
    left = sorted(path.name for path in tmp_path.iterdir())
    # A flat format's first file may be whole when the second, with PAC, is not.
    assert left in ([], [f"a{suffix}"]) and not (step == 1 and left)


def test_a_folder_that_is_no_bag_is_never_replaced(recorded, tmp_path, capsys) -> None:
    for suffix in FORMATS:
        folder = tmp_path / f"mine{suffix}"
        folder.mkdir()
        (folder / "precious").write_text("x")
        assert export(recorded, folder, "--force") == 2
        assert "is a folder" in capsys.readouterr().err
        assert (folder / "precious").read_text() == "x"


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes here")
def test_a_pipe_is_never_replaced(recorded, tmp_path, capsys) -> None:
    os.mkfifo(pipe := tmp_path / "a.csv")
    assert export(recorded, pipe, "--force") == 2
    assert "is a pipe or a device" in capsys.readouterr().err
    assert pipe.is_fifo()


def test_a_missing_extra_is_named(recorded, tmp_path) -> None:
    program = (
        "import sys; sys.modules['pyarrow'] = None\n"
        "from biotac.cli.main import main\n"
        f"sys.exit(main(['export', {str(recorded.path)!r}, {str(tmp_path / 'a.parquet')!r}]))"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert "pip install 'biotac-gateway[" in done.stderr and done.stderr.count("\n") == 1


def test_a_cut_recording_is_exported_as_far_as_it_goes(recorded, tmp_path, capsys) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(recorded.path.read_bytes()[:-200])
    assert main(["export", str(cut), str(tmp_path / "a.npz")]) == 1
    assert "ends without its index" in capsys.readouterr().err
