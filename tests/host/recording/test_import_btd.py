"""biotac import: a .btd's counts in a recording, with the results of the board's own code and the file's times."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import biotac
from biotac.cli.main import main
from biotac.sim import load_source
from biotac.wire import messages_gen as wire
from biotac.wire import sensor_gen as sensor

CHANNEL = {name: (sensor.CHANNEL_COMMAND[name] & 0x7E) >> 1 for name in sensor.SLOTS}
SECOND_S = 0.5  # a gap of the logger's, behind the first half


def write_btd(path: Path, samples: np.ndarray, gap_s: float = SECOND_S) -> np.ndarray:
    """Samples (frames, sensors, 44) as text, with one bad word; returns each frame's time, s."""
    frames = len(samples)
    times = np.arange(frames) * 0.01 + np.where(np.arange(frames) >= frames // 2, gap_s, 0.0)
    lines = ["a header", "Begin File"]
    for k in range(frames):
        for slot, name in enumerate(sensor.SLOTS):
            pairs = []
            for finger in range(samples.shape[1]):
                bad = (k, finger, slot) == (7, 0, sensor.SLOTS.index("E5"))
                pairs.append(f"{samples[k, finger, slot]} {int(bad)}")
            lines.append(f"{times[k] + slot / 4400:.6f} 1 {k} {CHANNEL[name]} {' '.join(pairs)}")
    path.write_text("\n".join(lines) + "\n")
    return times


@pytest.fixture(scope="module")
def imported(tmp_path_factory) -> tuple[biotac.Recording, np.ndarray, np.ndarray]:
    folder = tmp_path_factory.mktemp("btd")
    samples = load_source("press.toml", fingers=2, seconds=3.0).samples
    times = write_btd(folder / "a.btd", samples)
    assert main(["export", str(folder / "a.btd"), str(folder / "a.mcap")]) == 0
    return biotac.Recording(folder / "a.mcap"), samples, times


def test_every_count_is_there_at_its_time(imported) -> None:
    recording, samples, times = imported
    gaps = [re.fullmatch(r"gap of 0.5 s, (\d+) frames missed: a sensor fell silent", one) for one in recording.problems]
    assert sum(int(gap[1]) for gap in gaps if gap) == 100 and recording.fingers == [0, 1]  # of both, or each by itself
    electrodes = [sensor.SLOTS.index(name) for name in sensor.ELECTRODE_NAMES]
    for finger in (0, 1):
        rows = recording.frames[recording.frames["finger"] == finger]
        pac = recording.pac[recording.pac["finger"] == finger]
        wanted = samples[:, finger, electrodes].copy()
        if finger == 0:
            wanted[7, 4] = 65535
        assert np.array_equal(rows["counts"], wanted)
        assert np.array_equal(rows["pdc"], samples[:, finger, sensor.SLOTS.index("PDC")])
        assert np.array_equal(pac["pac"], samples[:, finger, np.array(sensor.SLOTS) == "PAC"])
        assert np.array_equal(rows["t_us"], np.rint(times * 1e6))
        assert np.array_equal(pac["seq"], rows["seq"])


def test_a_file_of_which_nothing_is_missing_is_reported_too(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    write_btd(tmp_path / "a.btd", load_source("press.toml", fingers=1, seconds=1.0).samples, gap_s=0.0)
    assert main(["export", str(tmp_path / "a.btd"), str(tmp_path / "a.mcap")]) == 0
    out, notes = capsys.readouterr()
    assert out.startswith("100 frames of 1 finger(s), 0 incomplete skipped") and notes == ""


def test_results_are_those_of_the_boards_own_code(imported) -> None:
    """The truth is a simulated board that plays the same samples."""
    recording, _, _ = imported
    with biotac.open("sim:press.toml?fingers=2&seconds=3") as hand:
        for setting, value in recording.settings.items():
            hand.board.set_setting(setting, value)  # the scenario brings other gains
        sent = hand.read_batch(100)
    own = recording.wire["finger"] == 1  # without the bad word
    theirs = sent.wire["finger"] == 1
    for name in ("counts", "tare_q4", "poc_um", "force_100un", "torque_mnmm", "flags", "tare_state", "seq"):
        assert np.array_equal(recording.wire[own][name], sent.wire[theirs][name]), name
    tares = [m for m in recording.messages if isinstance(m, wire.Tare) and m.finger == 1]
    live = [m for m in sent.messages if isinstance(m, wire.Tare) and m.finger == 1]
    assert [m.tare_q16 for m in tares] == [m.tare_q16 for m in live] != []


def test_it_is_a_recording_as_any_other(imported, capsys) -> None:
    recording, _, _ = imported
    assert main(["check", str(recording.path), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == 600
    with biotac.open(f"replay:{recording.path}") as hand:
        with pytest.warns(biotac.ReadWarning, match=r"gap of 0.5 s"):
            frames = hand.read(100)
        assert frames.tobytes() == recording.frames.tobytes()
    assert recording.metadata["port"] == "btd:a.btd"


def test_a_real_file_with_gaps(shared_data: Path, tmp_path: Path) -> None:
    assert main(["export", str(shared_data / "btd_biotacsp/data.btd.gz"), str(tmp_path / "b.mcap")]) == 0
    recording = biotac.Recording(tmp_path / "b.mcap")
    with np.load(shared_data / "btd_biotacsp/btd.npz") as truth:
        assert np.array_equal(recording.frames["counts"], truth["E"])
        assert np.array_equal(recording.pac["pac"], truth["PAC"])
    gaps_s = np.diff(recording.frames["t_us"]) / 1e6
    assert np.count_nonzero(gaps_s > 0.2) == 154


@pytest.mark.parametrize("cut", [3, 30])
def test_a_file_that_is_cut_within_its_last_line_lacks_one_frame(tmp_path: Path, capsys, cut: int) -> None:
    path = tmp_path / "a.btd"
    write_btd(path, load_source("press.toml", fingers=1, seconds=3.0).samples)
    path.write_bytes(path.read_bytes()[:-cut])
    assert main(["export", str(path), str(tmp_path / "a.mcap")]) == 0
    captured = capsys.readouterr()
    assert "299 frames of 1 finger(s), 1 incomplete skipped" in captured.out
    assert "1 gap(s) of more than 0.09 s" in captured.err
