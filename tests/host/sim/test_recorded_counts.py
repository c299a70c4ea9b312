"""Recordings as sources: files made here, and the real ones where they are at hand."""

import gzip
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from biotac.errors import InputError, RecordingError
from biotac.sim import load_source
from biotac.sim.fault_gen import EmuFault
from biotac.wire import sensor_gen as _sensor
from biotac.wire import slots

PDC, TAC, TDC = (_sensor.SLOTS.index(name) for name in ("PDC", "TAC", "TDC"))


def arrays(frames: int = 7) -> dict[str, np.ndarray]:
    count = np.arange(frames)
    return {
        "E": (count[:, None] * 20 + np.arange(19)).astype(np.uint16),
        "PDC": (1300 + count).astype(np.uint16),
        "TAC": (2040 + count).astype(np.int32),
        "TDC": (1000.0 + count),
        "PAC": (2000 + count[:, None] * 22 + np.arange(22)).astype(np.uint16),
        "F": np.column_stack([count + 0.25, count + 0.5, -count - 1.0]).astype(np.float32),
        "E_base": np.tile([[3000, 3001], [3002, 3003]], (1, 10))[:, :19].astype(np.uint16),
        "t": np.array([object() is None] * frames),
    }


# ---- npz ---------------------------------------------------------------------------------------


def test_every_channel_lands_in_its_slots(tmp_path: Path) -> None:
    fields = arrays()
    np.savez(tmp_path / "a.npz", **fields)
    source = load_source(tmp_path / "a.npz")
    assert source.samples.shape == (7, 1, 44) and source.samples.dtype == np.uint16
    for row in range(7):
        words = list(source.samples[row, 0])
        assert words[7::2] == list(fields["E"][row])
        assert words[0::2] == list(fields["PAC"][row])
        assert [words[k] for k in (1, 3, 5)] == [fields[name][row] for name in ("PDC", "TAC", "TDC")]
    assert source.truth is None and source.name == "a.npz"


def test_force_is_turned_into_lins_frame(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **arrays())
    force = load_source(tmp_path / "a.npz").truth_force_n
    assert force is not None and force.shape == (7, 1, 3)
    np.testing.assert_allclose(force[2, 0], [2.5, 2.25, 3.0])  # x = Fy, y = Fx, z = -Fz


def test_the_mean_of_the_base_is_the_tare_in_sixteenths(tmp_path: Path) -> None:
    fields = arrays()
    fields["E_base"] = np.repeat([[1000], [1001], [1001]], 19, axis=1)
    np.savez(tmp_path / "a.npz", **fields)
    tare = load_source(tmp_path / "a.npz").tare_q4
    assert tare is not None and tare.dtype == np.uint16
    np.testing.assert_array_equal(tare, np.full((1, 19), 16011))  # 1000.667 * 16 = 16010.67


def test_missing_channels_are_channels_the_sensor_does_not_have(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", E=arrays()["E"])
    source = load_source(tmp_path / "a.npz")
    other = [k for k in range(44) if k not in slots.ELECTRODE_SLOT]
    assert len(other) == 25 and (source.samples[:, 0, other] == EmuFault.NO_CHANNEL).all()
    assert source.tare_q4 is None and source.truth_force_n is None


def test_a_recording_is_copied_and_cropped(tmp_path: Path) -> None:
    np.savez(tmp_path / "a.npz", **arrays())
    source = load_source(tmp_path / "a.npz", fingers=3, seconds=0.05)
    assert source.samples.shape == (5, 3, 44) and len(set(source.serials)) == 3
    np.testing.assert_array_equal(source.samples[:, 2], source.samples[:, 0])
    assert source.tare_q4 is not None and source.tare_q4.shape == (3, 19)
    assert source.truth_force_n is not None and source.truth_force_n.shape == (5, 3, 3)
    assert len(load_source(tmp_path / "a.npz", seconds=60.0).samples) == 7


def cell(name: str, value: float, kind: type = float) -> Callable[[dict[str, np.ndarray]], None]:
    def change(fields: dict[str, np.ndarray]) -> None:
        fields[name] = fields[name].astype(kind)
        fields[name][3, ...] = value

    return change


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda f: f.pop("E"), "expected a field E"),
        (lambda f: f.update(E=f["E"][:, :18]), "field E has shape (7, 18): expected (n, 19)"),
        (lambda f: f.update(E=f["E"][:0]), "field E has shape (0, 19)"),
        (lambda f: f.update(PDC=f["PDC"][:6]), "field PDC has shape (6,): expected (7,)"),
        (cell("E", 4096), "field E row 3 holds 4096"),
        (cell("TDC", -1), "field TDC row 3 holds -1"),
        (cell("PAC", np.nan), "field PAC row 3 holds nan"),
        (cell("E", 3000.5), "field E row 3 holds 3000.5"),
        (lambda f: f.update(E=f["E"].astype(str)), "field E holds <U"),
        (cell("F", np.inf), "field F"),
        (lambda f: f.update(E_base=f["E_base"] + 2000), "field E_base row"),
    ],
)
def test_wrong_fields_are_refused(
    tmp_path: Path, change: Callable[[dict[str, np.ndarray]], object], words: str
) -> None:
    fields = arrays()
    change(fields)
    np.savez(tmp_path / "a.npz", **fields)
    with pytest.raises(InputError) as caught:
        load_source(tmp_path / "a.npz")
    assert words in str(caught.value) and "\n" not in str(caught.value) and "a.npz" in str(caught.value)


def test_files_that_are_no_npz_are_refused(tmp_path: Path) -> None:
    (tmp_path / "text.npz").write_text("no archive")
    np.savez(tmp_path / "whole.npz", **arrays())
    cut = (tmp_path / "whole.npz").read_bytes()
    (tmp_path / "cut.npz").write_bytes(cut[: len(cut) // 2])
    np.savez(tmp_path / "pickled.npz", E=np.array([{}], dtype=object))
    with (tmp_path / "bare.npz").open("wb") as bare:
        np.save(bare, arrays()["E"])
    for name in ("text", "cut", "pickled", "bare"):
        with pytest.raises(InputError, match=f"{name}.npz.*expected an .npz") as caught:
            load_source(tmp_path / f"{name}.npz")
        assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["none.npz", "none.btd", "none.btd.gz"])
def test_missing_and_empty_recordings_are_refused(tmp_path: Path, name: str) -> None:
    with pytest.raises(InputError, match=r"No such file.*check the path"):
        load_source(tmp_path / name)
    (tmp_path / name).touch()
    with pytest.raises(InputError, match=r"expected an? "):
        load_source(tmp_path / name)


# ---- btd ---------------------------------------------------------------------------------------

ORDER = [0, 17, 0, 18, 0, 19, 0, 20, 0, 21, 0, 22, 0, 23, 0, 24, 0, 25, 0, 26, 0, 27, 0, 28, 0, 29, 0, 30, 0,
         31, 0, 32, 0, 33, 0, 34, 0, 35, 0, 1, 0, 2, 0, 3]  # fmt: skip
HEADER = "DataStructure: 2.0\r\nSerial Number: ,,BTSP050400018017\0\x10\r\nOtherData: \r\n\r\nBegin File\r\n"


def btd_lines(frames: int = 3) -> list[list[float]]:
    """Sensors: absent, there, absent. Value = 100 * frame + place in the frame."""
    return [
        [0.01 * frame + slot / 4400, 5 + frame // 2, 40 + frame, channel, 0, 1, 100 * frame + slot, 0, 0, 1]
        for frame in range(frames)
        for slot, channel in enumerate(ORDER)
    ]


def write_btd(path: Path, lines: list[list[float]], header: str = HEADER) -> Path:
    body = "".join(f"{t:.6f} " + " ".join(f"{v:g}" for v in rest) + "\r\n" for t, *rest in lines)
    data = (header + body).encode("latin-1")
    path.write_bytes(gzip.compress(data) if path.name.endswith(".gz") else data)
    return path


@pytest.mark.parametrize("name", ["a.btd", "a.btd.gz", "A.BTD"])
def test_btd_frames_are_put_into_our_slot_order(tmp_path: Path, name: str) -> None:
    source = load_source(write_btd(tmp_path / name, btd_lines()))
    assert source.samples.shape == (3, 1, 44) and source.skipped_frames == 0
    frame = list(source.samples[1, 0])
    # the file's slots are PAC E1 PAC E2 ... E19 PAC PDC PAC TAC PAC TDC, ours begin with PAC PDC PAC TAC PAC TDC
    assert frame[0::2] == [100 + slot for slot in range(0, 44, 2)]
    assert frame[1::2] == [100 + slot for slot in (39, 41, 43, *range(1, 39, 2))]


def test_every_sensor_that_was_there_is_a_finger(tmp_path: Path) -> None:
    lines = [[*line[:4], 7, 0, *line[6:]] for line in btd_lines()]
    source = load_source(write_btd(tmp_path / "a.btd", lines))
    assert source.samples.shape == (3, 2, 44) and (source.samples[:, 0] == 7).all()
    assert source.samples[0, 1, 1] == 39  # PDC
    assert load_source(tmp_path / "a.btd", fingers=1).samples.shape == (3, 1, 44)
    three = load_source(tmp_path / "a.btd", fingers=3).samples
    np.testing.assert_array_equal(three[:, 2], three[:, 0])


def test_more_sensors_than_a_board_has_are_refused(tmp_path: Path) -> None:
    lines = [[*line[:4], *[7, 0] * 6] for line in btd_lines()]
    with pytest.raises(RecordingError, match="6 sensors: expected at most 5"):
        load_source(write_btd(tmp_path / "a.btd", lines))


def test_bad_parity_becomes_its_code_whatever_was_read(tmp_path: Path) -> None:
    lines = btd_lines()
    lines[44 + 3][6:8] = [65535, 1]  # frame 1, place 3: E2
    samples = load_source(write_btd(tmp_path / "a.btd", lines)).samples
    assert samples[1, 0, _sensor.SLOTS.index("E2")] == EmuFault.BAD_PARITY
    assert (samples == EmuFault.BAD_PARITY).sum() == 1


def test_incomplete_frames_are_left_out_and_counted(tmp_path: Path) -> None:
    lines = btd_lines(4)
    lines[44 * 3 + 4][3] = 17  # the last frame has 44 lines, but E1 twice and a PAC less
    del lines[44 + 10]
    source = load_source(write_btd(tmp_path / "a.btd", lines))
    assert source.skipped_frames == 2 and len(source.samples) == 2
    assert list(source.samples[:, 0, 1]) == [39, 239]  # PDC


def edited(row: int, column: int, value: float) -> list[list[float]]:
    lines = btd_lines()
    lines[row][column] = value
    return lines


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ([], "nothing after 'Begin File'"),
        (edited(50, 6, 4096), "line 56 holds 4096"),
        (edited(50, 6, float("nan")), "line 56 is"),
        ([*btd_lines(), [1.0, 2, 3]], "line 138 is '1.000000 2 3'"),
        ([line[:9] for line in btd_lines()], "line 6 is"),
        ([[*line[:4], 0, 1, 0, 1, 0, 1] for line in btd_lines()], "no value has good parity"),
        (btd_lines(1)[:40], "no complete frame among 1"),
    ],
)
def test_malformed_btd_is_refused(tmp_path: Path, lines: list[list[float]], words: str) -> None:
    path = write_btd(tmp_path / "a.btd", lines)
    with pytest.raises(InputError) as caught:
        load_source(path)
    assert words in str(caught.value) and "\n" not in str(caught.value)


def test_a_btd_without_its_begin_line_or_with_cut_compression_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="Begin File"):
        load_source(write_btd(tmp_path / "a.btd", btd_lines(), header="DataStructure: 2.0\r\n"))
    path = write_btd(tmp_path / "a.btd.gz", btd_lines())
    path.write_bytes(path.read_bytes()[:-20])
    with pytest.raises(InputError, match="cannot be read"):
        load_source(path)
    path.write_bytes(b"not gzip")
    with pytest.raises(InputError, match="cannot be read"):
        load_source(path)


def test_text_in_a_btd_line_is_named(tmp_path: Path) -> None:
    path = write_btd(tmp_path / "a.btd", btd_lines())
    path.write_bytes(path.read_bytes().replace(b"0.000227 ", b"0.0002x7 ", 1))
    with pytest.raises(InputError, match=r"line 7 is '0\.0002x7"):
        load_source(path)


# ---- real recordings ---------------------------------------------------------------------------


def test_the_real_btd_equals_its_decoded_arrays(shared_data: Path) -> None:
    source = load_source(shared_data / "btd_biotacsp/data.btd.gz")
    decoded = np.load(shared_data / "btd_biotacsp/btd.npz")
    assert source.samples.shape == (2124, 1, 44) and source.skipped_frames == 0
    words = source.samples[:, 0]
    np.testing.assert_array_equal(words[:, slots.ELECTRODE_SLOT], decoded["E"])
    np.testing.assert_array_equal(words[:, slots.PAC_SLOT], decoded["PAC"])
    for name, slot in (("PDC", PDC), ("TAC", TAC), ("TDC", TDC)):
        np.testing.assert_array_equal(words[:, slot], decoded[name])


def test_the_real_force_recording_carries_tare_and_force(shared_data: Path) -> None:
    source = load_source(shared_data / "syntouchcontact/F1.npz")
    assert source.samples.shape == (22508, 1, 44) and source.truth_force_n is not None
    assert source.tare_q4 is not None and source.tare_q4.min() > 2000 * 16
    assert source.tare_q4.max() < 3600 * 16
    # always pressed from below: force on the finger is dorsal, +z, 0.4 to 10.6 N in size
    assert (source.truth_force_n[:, 0, 2] > 0).all()
    size = np.linalg.norm(source.truth_force_n[:, 0], axis=1)
    assert size.min() > 0.3 and size.max() < 10.7


def test_the_real_plate_recording_has_pressure_and_no_tare(shared_data: Path) -> None:
    source = load_source(shared_data / "robotic_finger/trial_15330.npz", seconds=10.0)
    assert source.samples.shape == (1000, 1, 44) and source.tare_q4 is None
    assert (source.samples[:, 0, PDC] < 4096).all()
    assert (source.samples[:, 0, TDC] == EmuFault.NO_CHANNEL).all()
