"""biotac lake inventory: what a lake says of boards and sensors, each against its own earlier recordings."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from record_all import record_all

import biotac
from biotac.cli.main import main
from biotac.recording.layout import CHECKSUM
from biotac.recording.mcap_file import RecordingFile
from biotac.wire import messages_gen as wire
from biotac.wire.framing import encode

DAY_NS = 86_400 * 10**9


@pytest.fixture(scope="module")
def first(tmp_path_factory: pytest.TempPathFactory) -> biotac.Recording:
    return biotac.Recording(record_all("sim:press.toml?seconds=2", tmp_path_factory.mktemp("first") / "a.mcap"))


def days(
    first: biotac.Recording, folder: Path, noise_count: list[float], shift_count: list[int], dead: str | None = None
) -> Path:
    """A lake with a recording a day: its board's noise, how far its tares have moved, an electrode dead on the last."""
    metadata = {key: its for key, its in first.metadata.items() if key != CHECKSUM}
    folder.mkdir()
    paths = []
    for day, (noise, shift) in enumerate(zip(noise_count, shift_count, strict=True)):
        rows = first.wire.copy()
        rows["tare_q4"] += (rows["tare_q4"] != 0xFFFF).astype(np.uint16) * np.uint16(16 * shift)
        if dead and day == len(noise_count) - 1:
            rows["counts"][:, int(dead[1:]) - 1] = 2048
        tare = next(m for m in first.messages if isinstance(m, wire.Tare))
        tare = replace(tare, noise_count2=round(19 * noise**2), reason=wire.TareReason.RESIDUE)
        paths.append(folder / f"{day}.mcap")
        file = RecordingFile(paths[-1].open("xb"), metadata)
        told = [encode(tare.ID, tare.pack()), *(encode(wire.Frame.ID, row.tobytes()) for row in rows)]
        file.add(b"".join(told), first.begin_ns + day * DAY_NS)
        file.close()
    assert main(["export", *map(str, paths), "--lake", str(folder / "lake")]) == 0
    return folder / "lake"


def inventory(lake: Path, capsys: pytest.CaptureFixture[str], code: int = 0) -> dict[str, Any]:
    capsys.readouterr()
    assert main(["lake", "inventory", str(lake), "--json"]) == code
    found: dict[str, Any] = json.loads(capsys.readouterr().out)
    return found


def test_what_is_as_usual_has_no_finding(first, tmp_path, capsys) -> None:
    lake = days(first, tmp_path / "a", [2.0, 2.5, 1.5, 3.0], [10, 18, 2, 14])
    told = inventory(lake, capsys)
    (board,), (sensor,) = told["boards"], told["sensors"]
    assert (board["board"], board["recordings"], board["firmware"]) == ("posix-sim", 4, "0.1.0")
    assert sensor["last_ns"] - sensor["first_ns"] == 3 * DAY_NS
    assert sensor["hours"] == pytest.approx(4 * (first.end_us - first.begin_us) / 3.6e9)
    assert sensor["noise_count"] == pytest.approx(3.0, abs=0.02)
    assert sensor["drift_count"] == pytest.approx(4.0, abs=0.01)  # from 10, the median of those before
    assert sensor["residues_per_hour"] == pytest.approx(4 / sensor["hours"])
    assert sensor["findings"] == sensor["dead"] == []
    assert main(["lake", "inventory", str(lake)]) == 0
    said = capsys.readouterr().out
    assert "sensor BTSIM00000000001 on posix-sim, finger 0: 4 recordings" in said and ": as usual\n" in said


def test_what_is_worse_than_it_ever_was_is_found(first, tmp_path, capsys) -> None:
    lake = days(first, tmp_path / "a", [2.0, 2.5, 1.5, 5.2], [10, 18, 2, 50], dead="E7")
    (sensor,) = inventory(lake, capsys, 1)["sensors"]
    assert sensor["dead"] == ["E7"]
    assert sensor["findings"] == [
        "E7 is dead",
        "noise 5.2 counts, at most 2.5 in 3 earlier recordings",
        "drift 40.0 counts, at most 8.0 in 3 earlier recordings",  # 10, 18 and 2 about their median
    ]


def test_two_recordings_are_no_history(first, tmp_path, capsys) -> None:
    lake = days(first, tmp_path / "a", [2.0, 2.5, 9.0], [10, 18, 90])
    (sensor,) = inventory(lake, capsys)["sensors"]
    assert sensor["findings"] == []
    assert main(["lake", "inventory", str(lake)]) == 0
    assert ": no history yet\n" in capsys.readouterr().out
