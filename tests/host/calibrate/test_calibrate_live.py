"""The whole command: a simulated finger calibrated on an emulated Nano17, and the map proved on a board."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from stand_in import StandIn

import biotac
from biotac.calibrate.wrench import upload
from biotac.calibrate.wrench.sources import load
from biotac.cli.main import main
from biotac.errors import PortError
from biotac.map.board_map import BoardMap, from_blob
from biotac.map.file import load_fitted

pytestmark = pytest.mark.nightly  # a minute and a half of procedure and fits

SERIAL = "BTSIM00000000006"


@pytest.fixture(scope="module")
def calibrated(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder as the command leaves it."""
    out = tmp_path_factory.mktemp("live") / "calibrated"
    options = ["--finger", "index", "--reference", "nano17", "--out", str(out)]
    assert main(["calibrate", "wrench", "--live", "sim:calibrate.toml", *options, "--no-upload"]) == 0
    return out


def fit_again(calibrated: Path, *options: str) -> list[str]:
    files = [str(calibrated / f"{SERIAL}.mcap"), "--reference", str(calibrated / f"{SERIAL}.csv")]
    return ["calibrate", "wrench", *files, *options]


def test_it_leaves_recording_reference_report_picture_and_map(calibrated: Path) -> None:
    names = sorted(path.name for path in calibrated.iterdir())
    assert names == [f"{SERIAL}.{end}" for end in ("csv", "mcap", "md", "png", "wrench.json")]
    fitted = json.loads((calibrated / f"{SERIAL}.wrench.json").read_text())["provenance"]
    assert (fitted["serial"], fitted["files"]) == (SERIAL, [f"{SERIAL}.mcap", f"{SERIAL}.csv"])
    assert fitted["software"].startswith("biotac-gateway ")
    assert fitted["alignment"]["clear"] > 5.0
    page = (calibrated / f"{SERIAL}.md").read_text(encoding="utf-8")
    assert fitted["data_sha256"] in page and SERIAL in page
    assert load_fitted(calibrated / f"{SERIAL}.wrench.json").axes == ("Fx", "Fy", "Fz", "Mx", "My", "Mz", "torsion")


def test_the_map_is_on_the_board_and_does_there_what_was_fitted(
    calibrated: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(fit_again(calibrated, "--upload", "sim:calibrate.toml", "--save", "--json")) == 0
    facts: dict[str, Any] = json.loads(capsys.readouterr().out)
    board = facts["board"]
    # the limit asked for: 10 mN RMS; and as much at a lever of a centimetre
    assert board["force_mn_rms"] <= 10.0 and board["torque_nmm_rms"] <= 0.1
    assert board["outside"] == 0 and board["rows"] == facts["rows"]
    assert board["frames_bit_for_bit"] > 0 and board["saved"]
    assert facts["serial"] == SERIAL
    # better than Lin's scales on every force, or the procedure recorded the wrong things
    assert min(facts["better_than_lin"][:3]) > 1.0
    again = json.loads((calibrated / f"{SERIAL}.wrench.json").read_text())["provenance"]
    assert facts["data_sha256"] == again["data_sha256"]


def test_another_fingers_board_is_refused(calibrated: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(fit_again(calibrated, "--upload", "sim:press.toml")) == 2
    assert f"is of sensor {SERIAL}, but this is BTSIM00000000001: expected the same" in capsys.readouterr().err


def test_a_board_that_computes_otherwise_is_found_out(calibrated: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A board with a block of the map changed."""
    from biotac.calibrate.reference.csv_file import read_csv

    reference = calibrated / f"{SERIAL}.csv"
    loaded = load(calibrated / f"{SERIAL}.mcap", (reference, read_csv(reference)))
    fitted = load_fitted(calibrated / f"{SERIAL}.wrench.json")
    with biotac.open("sim:calibrate.toml") as hand:

        def spoilt(finger: int, given: BoardMap, *, force: bool) -> None:
            held = from_blob(given.blob)
            held.blocks[0].coefficients[:, 2] += np.int64(1)
            hand.board.set_map(finger, held, force=force)

        while not (hand.read(0.2)["flags"] & biotac.FrameFlags.CONTACT).all():
            pass  # at rest no map is evaluated
        hand.stop()
        with pytest.raises(PortError, match=r"the board has the map, but \d+ of \d+ frames do not match it"):
            other = StandIn(hand, board=StandIn(hand.board, set_map=spoilt))
            upload.upload(other, 0, fitted, loaded.run.counts, loaded.run.pdc, serial=SERIAL, made_s=1)
