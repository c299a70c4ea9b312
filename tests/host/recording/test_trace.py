"""biotac export --trace: the tare machine's course, against the board's own messages and sums over the counts."""

from pathlib import Path

import numpy as np
import pytest
from record_all import record_all

import biotac
from biotac.cli.main import main
from biotac.errors import InputError
from biotac.wire import messages_gen as wire


@pytest.fixture(scope="module")
def recorded(tmp_path_factory) -> biotac.Recording:
    return biotac.Recording(record_all("sim:press.toml?fingers=2", tmp_path_factory.mktemp("trace") / "a.mcap"))


@pytest.fixture(scope="module")
def trace(recorded, tmp_path_factory) -> np.ndarray:
    out = tmp_path_factory.mktemp("trace") / "a.csv"
    assert main(["export", str(recorded.path), str(out), "--trace"]) == 0
    return np.genfromtxt(out.with_suffix(".trace.csv"), delimiter=",", names=True, dtype=None, encoding="utf-8")


@pytest.mark.parametrize("finger", [0, 1])
def test_its_states_reasons_and_pressure_are_those_that_the_board_sent(recorded, trace, finger: int) -> None:
    rows, frames = (table[table["finger"] == finger] for table in (trace, recorded.frames))
    at = np.searchsorted(frames["t_us"], rows["t_us"])
    np.testing.assert_array_equal(frames["t_us"][at], rows["t_us"])
    np.testing.assert_array_equal(frames["tare_state"][at], rows["tare_state"])
    tares = [m for m in recorded.messages if isinstance(m, wire.Tare) and m.finger == finger]
    new = np.flatnonzero(np.diff(rows["tare_reason"])) + 1
    assert [(m.t_us, m.reason) for m in tares] == [(r["t_us"] % 2**32, r["tare_reason"]) for r in rows[new]]
    assert {m.reason for m in tares} >= {wire.TareReason.START, wire.TareReason.ROLL_BACK, wire.TareReason.RELEASE}
    held = np.flatnonzero((rows["tare_state"] == wire.TareState.CONTACT) & (rows["still_sweeps"] >= 2))
    above = frames["pdc"][at[held]].astype(float) - frames["pdc_tare"][at[held] - 1]  # as it was for the verdict
    assert len(held) > 10 and np.abs(above - rows["pdc_above_count"][held]).max() <= 1 / 32


@pytest.mark.parametrize("finger", [0, 1])
def test_its_energy_is_the_means_squared_distance_from_the_tare(recorded, trace, finger: int) -> None:
    """Each round ends the eight rounds of three electrodes, the last but one those of E19."""
    rows, frames = (table[table["finger"] == finger] for table in (trace, recorded.frames))
    counts, checked = frames["counts"].astype(float), 0
    for row in rows[rows["tare_state"] == wire.TareState.CONTACT]:
        last = int(np.searchsorted(frames["t_us"], row["t_us"]))
        if np.ptp(counts[last - 15 : last + 1], axis=0).max() >= 24:  # the trigger's filter holds such words back
            continue
        checked += 1
        ends = last - 7 + np.arange(19) // 3
        means = np.array([counts[end - 7 : end + 1, i].mean() for i, end in enumerate(ends)])
        energy_count2 = ((means - frames["tare"][last - 1]) ** 2).sum()
        assert row["energy_count2"] == pytest.approx(energy_count2, rel=1e-9)
    assert checked > 10


def test_what_lacks_rounds_and_what_is_no_flat_table_is_refused(recorded, tmp_path: Path, capsys) -> None:
    path = tmp_path / "touched.mcap"
    with biotac.open("sim:press.toml") as hand, hand.record(path):
        hand.stream(rest=False)
        hand.read(3.0)
    assert main(["export", str(path), str(tmp_path / "a.csv"), "--trace"]) == InputError.exit_code
    assert "heartbeats" in capsys.readouterr().err
    assert main(["export", str(recorded.path), str(tmp_path / "a.npz"), "--trace"]) == InputError.exit_code
    assert "name it .csv or .parquet" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == [path]
