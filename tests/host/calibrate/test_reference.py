"""Force/torque references: the facts a file must state, the effect of a mounting, and files that grow."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.writer import Writer

from biotac.calibrate.reference.csv_file import CsvWriter, GrowingCsv
from biotac.calibrate.reference.mounting import LIN, Mounting, read_mounting
from biotac.calibrate.reference.nano17 import MOUNTING
from biotac.calibrate.reference.samples import Samples, checked
from biotac.calibrate.wrench.sources import read_reference
from biotac.errors import DeviceLostError, InputError, RecordingError, RecordingWarning

N = 2000


def wrench(n: int = N) -> np.ndarray:
    """A reference that is pressed now and then, with every axis different."""
    t = np.arange(n) / 100.0
    return np.column_stack([np.sin(t * (k + 1)) * (k + 1) for k in range(6)])


def written(tmp_path: Path, header: str, rows: np.ndarray, comment: str = "") -> Path:
    path = tmp_path / "plate.csv"
    lines = [",".join(f"{v:.9g}" for v in row) for row in rows]
    path.write_text("\n".join([*([comment] if comment else []), header, *lines]) + "\n")
    return path


# ---- mounting ----------------------------------------------------------------------------------


def test_a_mounting_turns_by_hand() -> None:
    # the sensor's z is Lin's x, x is Lin's y, y is Lin's z; the origin lies 10 mm behind Lin's
    mounting = Mounting(np.array([[0.0, 0, 1], [1, 0, 0], [0, 1, 0]]), np.array([-10.0, 0.0, 0.0]))
    # 2 N dorsal through Lin's origin: seen from 10 mm behind it has a moment of -20 N mm about y
    lin = np.array([[0.0, 0.0, 2.0, 0.0, 0.0, 0.0]])
    sensor = mounting.to_sensor(lin)
    # lin (0, 0, 2) is the sensor's y; the moment (10, 0, 0) x (0, 0, 2) = (0, -20, 0), the sensor's x
    np.testing.assert_allclose(sensor, [[0.0, 2.0, 0.0, -20.0, 0.0, 0.0]], atol=1e-12)
    np.testing.assert_allclose(mounting.to_finger(sensor), lin, atol=1e-12)
    on_itself = Mounting(mounting.rotation, mounting.offset_mm, -1.0)
    np.testing.assert_allclose(on_itself.to_finger(-sensor), lin, atol=1e-12)
    np.testing.assert_allclose(mounting.to_finger(sensor[:, :3]), lin[:, :3], atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('rotation = [[1,0,0],[0,1,0],[0,0,0.9]]\noffset_mm = [0,0,0]\nreads = "force on finger"',
         r"not orthonormal, R R' is off by 0\.19"),
        ('rotation = [[1,0,0],[0,1,0],[0,0,-1]]\noffset_mm = [0,0,0]\nreads = "force on finger"', "mirrors"),
        ('rotation = [[1,0,0],[0,1,0]]\noffset_mm = [0,0,0]\nreads = "force on finger"', r"shape \(2, 3\)"),
        ('rotation = [[1,0,0],[0,1,0],[0,0,1]]\noffset_mm = [0,0,9e9]\nreads = "force on finger"', "up to 500 mm"),
        ('rotation = [[1,0,0],[0,1,0],[0,0,1]]\noffset_mm = [0,0,0]\nreads = "both"', "reads is 'both'"),
        ('rotation = [[1,0,0],[0,1,0],[0,0,1]]\nreads = "force on finger"', "key 'offset_mm' is missing"),
        ('rotation = [["a",0,0],[0,1,0],[0,0,1]]\noffset_mm = [0,0,0]\nreads = "force on finger"', "is not numeric"),
        ("rotation = [", "expected TOML with rotation"),
    ],
)  # fmt: skip
def test_a_wrong_mounting_is_refused(text: str, message: str, tmp_path: Path) -> None:
    path = tmp_path / "mounting.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=message):
        read_mounting(str(path))


def test_a_mounting_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "mounting.toml"
    path.write_text('rotation = [[0,1,0],[1,0,0],[0,0,-1]]\noffset_mm = [1,2,3]\nreads = "force on sensor"\n')
    mounting = read_mounting(str(path))
    assert mounting.rotation.tolist() == [[0, 1, 0], [1, 0, 0], [0, 0, -1]]
    assert mounting.offset_mm.tolist() == [1, 2, 3]
    assert mounting.sign == -1.0
    assert read_mounting("lin") is LIN


# ---- CSV ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("header", "torque_factor"),
    [
        ("time [s],Fx [N],Fy [N],Fz [N],Tx [N m],Ty [N m],Tz [N m]", 1000.0),
        ("t (s),FX (N),FY (N),FZ (N),TX (N*mm),TY (N·mm),TZ (N-mm)", 1.0),
    ],
)
def test_units_of_a_csv_are_read(header: str, torque_factor: float, tmp_path: Path) -> None:
    loads = wrench()
    rows = np.column_stack([5.0 + np.arange(N) * 0.002, loads])
    found = read_reference(str(written(tmp_path, header, rows)), LIN).samples
    np.testing.assert_allclose(found.t_s, rows[:, 0], rtol=1e-8)
    np.testing.assert_allclose(found.wrench[:, :3], loads[:, :3], rtol=1e-8)
    np.testing.assert_allclose(found.wrench[:, 3:], loads[:, 3:] * torque_factor, rtol=1e-8)


def test_a_csv_may_have_three_axes_semicolons_and_other_columns(tmp_path: Path) -> None:
    path = tmp_path / "plate.csv"
    loads = wrench()
    lines = [f"{k};{v[2]};{v[0]};{v[1]};{k * 0.01}" for k, v in enumerate(loads)]
    path.write_text("\n".join(["sample;Fz [N];Fx [N];Fy [N];t [s]", *lines]))
    found = read_reference(str(path), LIN).samples
    np.testing.assert_allclose(found.wrench[:, :3], loads[:-1, :3])  # the last line has no end
    assert found.wrench.shape[1] == 3


@pytest.mark.parametrize("noise_n", [0.0, 0.01])
def test_a_reference_that_repeats_its_last_reading_is_told_or_refused(noise_n: float) -> None:
    """Presses that are held still are none, not even without noise."""
    t_s = np.arange(30_000) * 0.002
    size_n = np.interp(t_s % 4.0, [1.0, 1.5, 3.0, 3.5], [0.0, 3.0, 3.0, 0.0])
    force = size_n[:, None] * [0.6, 0.0, 0.8] + np.random.default_rng(3).normal(0.0, noise_n, (len(t_s), 3))
    np.testing.assert_array_equal(checked("x", Samples(t_s, force)).wrench, force)
    force[2600:3400] = force[2600]  # 1.6 s, from the press's hold into the next rest
    with pytest.warns(RecordingWarning, match=r"x: 2\.7% of the readings repeat the last one .* left out"):
        lost = np.isnan(checked("x", Samples(t_s, force)).wrench[:, 0])
    assert not lost[:2600].any() and lost[2601:3400].all() and not lost[3400:].any()
    force[4800:4950] = force[4800]  # within a hold, so that no leap follows; but noise never repeats by itself
    with pytest.warns(RecordingWarning):
        lost = np.isnan(checked("x", Samples(t_s, force)).wrench[:, 0])
    assert (lost[4801:4950] == (noise_n > 0.0)).all()
    for begin in range(4600, 20_000, 2000):
        force[begin : begin + 800] = force[begin]
    with pytest.raises(RecordingError, match=r"x: 2\d\.\d% of the readings .*: expected at most 10%"):
        checked("x", Samples(t_s, force))


@pytest.mark.parametrize("cut", [3, 20])
def test_a_row_that_a_full_disk_cut_is_left_out(cut: int, tmp_path: Path) -> None:
    path = written(tmp_path, GOOD, np.column_stack([np.arange(N) * 0.002, wrench()]))
    path.write_text(path.read_text()[:-cut])
    assert len(read_reference(str(path), LIN).samples) == N - 1


GOOD = "t_s,Fx_N,Fy_N,Fz_N,Mx_Nmm,My_Nmm,Mz_Nmm"


@pytest.mark.parametrize(
    ("header", "change", "message"),
    [
        ("t_s,Fx,Fy_N,Fz_N,Mx_Nmm,My_Nmm,Mz_Nmm", "", "column 'Fx' has no unit"),
        ("t_ms,Fx_N,Fy_N,Fz_N,Mx_Nmm,My_Nmm,Mz_Nmm", "", "'t_ms' is in 'ms': expected t in s"),
        ("t_s,Fx_gf,Fy_N,Fz_N,Mx_Nmm,My_Nmm,Mz_Nmm", "", "is in 'gf'"),
        ("t_s,Fx_N,Fy_N,a,Mx_Nmm,My_Nmm,Mz_Nmm", "", "no column Fz_N"),
        ("t_s,Fx_N,Fx_N,Fz_N,Mx_Nmm,My_Nmm,Mz_Nmm", "", "is there twice"),
        (GOOD, "milliseconds", "0.5 samples per second: expected 20 to 20000; t looks like ms"),
        (GOOD, "backward", r"time goes from 2\.000000 to 1\.990000 s after sample 1000"),
        (GOOD, "millinewton", r"force changes by \d+ N .* is it in mN"),
        (GOOD, "kilonewton", r"force changes by 0\.00\d+ N .* kN"),
        (GOOD, "nan", "1000 of 2000 samples are not finite, first sample 500"),
        (GOOD, "words", "at row 2000, column 7.: expected a number in every column"),
        (GOOD, "one", "1 samples: expected a recording"),
    ],
)
def test_a_csv_that_cannot_be_believed_is_refused(header: str, change: str, message: str, tmp_path: Path) -> None:
    rows = np.column_stack([np.arange(N) * 0.002, wrench()])
    if change == "milliseconds":
        rows[:, 0] *= 1000.0
    elif change == "backward":
        rows[1001:, 0] -= 0.012
    elif change == "millinewton":
        rows[:, 1:4] *= 1000.0
    elif change == "kilonewton":
        rows[:, 1:4] *= 0.001
    elif change == "nan":
        rows[500:1500, 2] = np.nan
    elif change == "one":
        rows = rows[:1]
    path = written(tmp_path, header, rows)
    if change == "words":
        path.write_text(path.read_text() + "1,2,3,4,5,6,x\n")
    with pytest.raises(RecordingError, match=message):
        read_reference(str(path), LIN)


def test_a_csv_of_ours_has_its_mounting_and_others_must_be_told(tmp_path: Path) -> None:
    path = tmp_path / "ours.csv"
    writer = CsvWriter(path, MOUNTING, "some\nsensor")
    loads = wrench()
    for begin in (0, 700):
        part = slice(begin, begin + 700)
        writer.add(Samples(np.arange(N)[part] * 0.002, loads[part]))
    # a kill here loses nothing: added rows can be read before the file is closed
    found = read_reference(str(path))
    assert len(found.samples) == 1400
    writer.close()
    assert found.sensor == "some sensor"
    np.testing.assert_array_equal(found.mounting.rotation, MOUNTING.rotation)
    np.testing.assert_array_equal(found.mounting.offset_mm, MOUNTING.offset_mm)
    assert read_reference(str(path), LIN).mounting is LIN
    with pytest.raises(InputError, match="already exists; choose another name"):
        CsvWriter(path, MOUNTING, "")
    bare = written(tmp_path, GOOD, np.column_stack([np.arange(N) * 0.002, loads]))
    with pytest.raises(RecordingError, match="how the sensor is mounted on the finger: expected --mounting"):
        read_reference(str(bare))


# ---- MCAP --------------------------------------------------------------------------------------


def mcap_json(
    path: Path,
    topics: tuple[str, ...] = ("/ft",),
    schema: str = "geometry_msgs/WrenchStamped",
    *,
    stamp: tuple[str, str] = ("sec", "nanosec"),
) -> Path:
    loads = wrench()
    with path.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        number = writer.register_schema(schema, "jsonschema", b"{}")
        for topic in topics:
            channel = writer.register_channel(topic, "json", number)
            for k, row in enumerate(loads.tolist()):
                message: dict[str, Any] = {
                    "header": {
                        "stamp": dict(zip(stamp, (5 + k // 500, k % 500 * 2_000_000), strict=True)),
                        "frame_id": "ft",
                    },
                    "wrench": {
                        "force": dict(zip("xyz", row[:3], strict=True)),
                        "torque": dict(zip("xyz", [v / 1000.0 for v in row[3:]], strict=True)),
                    },
                }
                writer.add_message(channel, k, json.dumps(message).encode(), k)
        writer.finish()
    return path


@pytest.mark.parametrize("stamp", [("sec", "nsec"), ("secs", "nsecs")])
def test_json_stamps_have_the_names_of_ros_2_of_foxglove_and_of_ros_1(tmp_path: Path, stamp: tuple[str, str]) -> None:
    found = read_reference(str(mcap_json(tmp_path / "ft.mcap", stamp=stamp)), MOUNTING)
    np.testing.assert_allclose(found.samples.t_s, 5.0 + np.arange(N) * 0.002)


def test_json_wrenches_in_an_mcap_file(tmp_path: Path) -> None:
    loads = wrench()
    found = read_reference(str(mcap_json(tmp_path / "ft.mcap")), MOUNTING)
    np.testing.assert_allclose(found.samples.t_s, 5.0 + np.arange(N) * 0.002)
    np.testing.assert_allclose(found.samples.wrench, loads, atol=1e-12)
    assert found.mounting is MOUNTING
    two = mcap_json(tmp_path / "two.mcap", ("/a", "/b"))
    with pytest.raises(RecordingError, match=r"holds /a, /b: expected one topic .* FILE:TOPIC"):
        read_reference(str(two), LIN)
    assert len(read_reference(f"{two}:/b", LIN).samples) == N
    with pytest.raises(RecordingError, match=r"holds /ft \(other\): expected one topic"):
        read_reference(str(mcap_json(tmp_path / "other.mcap", schema="other")), LIN)
    with pytest.raises(RecordingError, match="expected --mounting"):
        read_reference(str(two))
    (tmp_path / "no.mcap").write_bytes(b"no")
    with pytest.raises(RecordingError, match="expected an MCAP file"):
        read_reference(str(tmp_path / "no.mcap"), LIN)
    with pytest.raises(InputError, match=r"unknown file type: expected \.csv"):
        read_reference("plate.xlsx", LIN)


def test_wrenches_of_a_ros_2_bag(tmp_path: Path) -> None:
    from rosbags.rosbag2 import StoragePlugin
    from rosbags.rosbag2 import Writer as Bag
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    make = store.types
    kind = "geometry_msgs/msg/WrenchStamped"
    loads = wrench(200)
    with Bag(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        connection = bag.add_connection("/ft", kind, typestore=store)
        for k, row in enumerate(loads):
            vector = make["geometry_msgs/msg/Vector3"]
            message = make[kind](
                make["std_msgs/msg/Header"](
                    make["builtin_interfaces/msg/Time"](7, k * 2_000_000), "frame of the sensor"
                ),
                make["geometry_msgs/msg/Wrench"](vector(*row[:3]), vector(*(row[3:] / 1000.0))),
            )
            bag.write(connection, k, store.serialize_cdr(message, kind))
    (file,) = (tmp_path / "bag").glob("*.mcap")
    found = read_reference(str(file), LIN).samples
    np.testing.assert_allclose(found.wrench, loads, atol=1e-9)
    np.testing.assert_allclose(found.t_s, 7.0 + np.arange(200) * 0.002)


# ---- a file that grows, and the emulated Nano17 ------------------------------------------------


def timed() -> np.ndarray:
    return np.column_stack([5.0 + np.arange(N) * 0.002, wrench()])


def test_a_file_that_grows_is_read_row_by_row(tmp_path: Path) -> None:
    """Rows from before are left out; a row that is cut by a write comes with the next."""
    now_s = 0.0
    path = written(tmp_path, "Time [s],Fx [N],Fy [N],Fz [N],Tx [N m],Ty [N m],Tz [N m]", timed())
    reader = GrowingCsv(path, LIN, steady_s=lambda: now_s)
    assert len(reader.read()) == 0
    with path.open("a", buffering=1) as file:
        file.write("90.01,1,2,3,4,5,6\n90.02,1,2,3,4,5,6\n90.03,1,2,")
        file.flush()
        found = reader.read()
        assert found.t_s.tolist() == [90.01, 90.02]
        assert found.wrench[0].tolist() == [1, 2, 3, 4000, 5000, 6000]
        now_s = 4.0
        assert len(reader.read()) == 0
        file.write("9,4,5,6\n")
        file.flush()
        assert reader.read().wrench[:, 2].tolist() == [9]
        now_s = 9.1
        with pytest.raises(DeviceLostError, match=r"has not grown for 5\.1 s"):
            reader.read()
        file.write("90.04,a,2,3,4,5,6\n")
        file.flush()
        with pytest.raises(RecordingError, match="expected a number in every column"):
            reader.read()
    reader.close()
    with pytest.raises(RecordingError, match="expected --mounting"):
        GrowingCsv(path)


@pytest.mark.parametrize("missing", ["", "NA", "null", '"NA"', "NaN", "#N/A", "None"])
@pytest.mark.parametrize("quote", ["", '"'])
def test_a_csv_may_have_missing_words_and_quoted_numbers(tmp_path: Path, missing: str, quote: str) -> None:
    """Missing readings as pandas, R, DuckDB and spreadsheets write them: the sensor marks such a reading as bad."""
    path = written(tmp_path, "t_s,Fx_N,Fy_N,Fz_N", np.column_stack([np.arange(N) / 100.0, wrench()[:, :3]]))
    head, *rows = path.read_text().splitlines()
    rows = [",".join(f"{quote}{cell}{quote}" for cell in row.split(",")) for row in rows]
    rows[700] = ",".join([*rows[700].split(",")[:3], missing])
    path.write_text("\n".join([head, *rows]) + "\n")
    samples = read_reference(str(path), LIN).samples
    assert np.flatnonzero(np.isnan(samples.wrench).any(axis=1)).tolist() == [700] and len(samples) == N
