"""`biotac calibrate population`: a map of other fingers on a finger that has no calibration yet."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import biotac
from biotac import ForceModel, FrameFlags, Setting
from biotac.calibrate import population as population_map
from biotac.cli.main import main
from biotac.map.board_map import from_blob


def test_a_map_of_our_own_fingers_gives_the_force(port: str, tmp_path: Path, capsys: pytest.CaptureFixture) -> None:
    shipped = population_map.load(None)
    ours = replace(shipped.population, coefficients=1.25 * shipped.population.coefficients)
    path = tmp_path / "ours.json"
    path.write_text(population_map.dumps(replace(shipped, population=ours)), encoding="utf-8")
    assert main(["calibrate", "population", port, "--finger", "1", "--population", str(path), "--json"]) == 0
    facts = json.loads(capsys.readouterr().out)
    assert (facts["finger"], facts["made_of"], facts["saved"]) == (1, "F1.npz, F2.npz", False)
    with biotac.open(port) as hand:
        blob = hand.board.get_map(1)
        assert blob is not None and hand.board.get_map(0) is None
        frames = hand.read_batch(0.5).wire
    frames = frames[(frames["finger"] == 1) & ((frames["flags"] & FrameFlags.MAPPED) != 0)]
    assert len(frames)
    # the board's tare in place of the map's, which may be any
    tare = frames["tare_q4"][0] / 16
    board_map = from_blob(blob)
    force, _, _ = board_map.results(frames["counts"], frames["tare_q4"], np.zeros(len(frames), np.int32))
    np.testing.assert_allclose(force[0] / 1e4, ours.force(frames["counts"][:1].astype(float), tare)[0], atol=0.1)


def test_the_firmwares_own_map_comes_back_into_force(port: str, capsys: pytest.CaptureFixture) -> None:
    defaults = {s: biotac.Calibration().settings()[s] for s in biotac.Calibration().settings()}
    with biotac.open(port) as hand:
        hand.board.set_map(0, population_map.load(None).population.wrench_map(np.zeros(19)).on_board())
        hand.board.set_setting(Setting.FORCE_MODEL, ForceModel.LIN)
        for setting, value in defaults.items():
            hand.board.set_setting(setting, value)
        hand.board.set_map(1, population_map.load(None).population.wrench_map(np.zeros(19)).on_board())
        hand.board.set_calibration(1, biotac.Calibration(force_gain_nn=(1, 2, 3)))
    argv = ["calibrate", "population", port, "--finger"]
    assert main([*argv, "0"]) == 2
    assert "finger 0 has a wrench map of its own (force, " in capsys.readouterr().err
    with biotac.open(port) as hand:
        assert hand.board.get_map(0) is not None and hand.board.setting(Setting.FORCE_MODEL) == ForceModel.LIN
    assert main([*argv, "0", "--force"]) == 0
    assert "map of F1.npz, F2.npz, in force, until the next reboot" in capsys.readouterr().out
    assert main([*argv, "1", "--force"]) == 2
    assert "force gains of its own, which go before the map" in capsys.readouterr().err
    with biotac.open(port) as hand:
        assert hand.board.get_map(0) is None and hand.board.get_map(1) is not None
        assert hand.board.setting(Setting.FORCE_MODEL) == ForceModel.POPULATION
