"""Forces applied to simulated fingers beside those they felt. The truth is the ramp in the scenario's text."""

from pathlib import Path

import numpy as np

import biotac
from biotac.cli.main import main
from biotac.recording.felt import Felt, table
from biotac.sim.loading import bundled_scenarios, load_source
from biotac.wire.slots import ELECTRODE_SLOT

RAMP = """name = "ramp"\nfingers = 2\nfault = [{at_s = 0.5, seconds = 0.2, finger = 1, kind = "stuck_low"}]
step = [{do = "rest", seconds = 1.5}, {do = "press", at = "E17", force_n = 4.0, seconds = 0.5, fingers = [1]},
        {do = "hold", seconds = 1.0}]"""  # a finger without a good word has no frame, and the counters stand still


def played(tmp_path: Path) -> str:
    (tmp_path / "ramp.toml").write_text(RAMP)
    return f"sim:{tmp_path / 'ramp.toml'}"


def check_ramp(applied_n: np.ndarray | None, rows: np.ndarray) -> None:
    first = rows[rows["finger"] == 0][0]
    t_s = (rows["t_us"] - float(first["t_us"])) / 1e6 + first["seq"] * 0.01 + 0.005  # the middles of the rounds
    z_n = 4.0 * np.clip((t_s - 1.5) / 0.5, 0.0, 1.0) * (rows["finger"] == 1)
    assert applied_n is not None and len(rows) > 100
    np.testing.assert_allclose(applied_n, np.outer(z_n, [0.0, 0.0, 1.0]), atol=2e-4)  # a recording has steps of 0.1 mN


def test_it_is_known_at_each_row_until_the_board_restarts(tmp_path: Path) -> None:
    with biotac.open(played(tmp_path), reconnect=True) as hand:
        hand.stream("results", rest=False)  # heartbeats: a frame's number is not how many came
        frames = np.concatenate([batch.frames for batch in hand.batches()])
        assert frames["seq"].max() > len(frames)
        check_ramp(hand.applied_n(frames["finger"], frames["t_us"]), frames)
        assert np.isnan(hand.applied_n(frames["finger"][:1], frames["t_us"][:1] + 10_000_000)).all()
        hand.board.restart()
        assert hand.applied_n(frames["finger"], frames["t_us"]) is None


def test_recordings_keep_it_and_record_and_pictures_show_it(tmp_path: Path, capsys) -> None:
    port, whole, cut, again, late, replayed = played(tmp_path), *(str(tmp_path / f"{k}.mcap") for k in range(5))
    output = [main(["record", port, whole]), capsys.readouterr().out.splitlines()[-1]][1]
    assert main(["file", "cut", whole, cut, "--from", "1"]) == 0
    assert main(["export", whole, again, "--recompute", "--keep-tare"]) == 0
    with biotac.open(port, pace=2.0) as hand:
        hand.read(seconds=0.5)
        with hand.record(late):
            hand.read(seconds=2.4)
    for recording in map(biotac.Recording, (whole, cut, again, late)):
        check_ramp(recording.applied_n, recording.frames)
    felt_n = biotac.Recording(whole)["middle"]["force_n"][-125:]  # over 2 N: 25 rows of 3 N, 100 of 4 N
    off_n = np.sqrt(((felt_n - biotac.Recording(whole).applied_n[-250:][1::2][-125:]) ** 2).sum(axis=1).mean())
    assert output.split() == ["3.80", f"{felt_n[:, 2].mean():.2f}", f"{off_n:.2f}"]
    assert main(["record", f"replay:{whole}", replayed]) == 0
    assert capsys.readouterr().out.splitlines()[-1] == output
    check_ramp(biotac.Recording(replayed).applied_n, biotac.Recording(replayed).frames)
    real = tmp_path / "real.npz"
    np.savez(real, E=load_source("press.toml").samples[:, 0, ELECTRODE_SLOT])
    assert main(["record", f"sim:{real}", replayed, "--force"]) == 0  # an unknown finger
    assert biotac.Recording(replayed).applied_n is None and "applied, N" not in capsys.readouterr().out
    from matplotlib.image import imread  # half a second to import

    assert [main(["export", path, f"{path}.png"]) for path in (whole, replayed)] == [0, 0]
    pictures = (imread(f"{path}.png")[:, :, :3] * 255 for path in (whole, replayed))
    wide = [int(np.isclose(one, [255, 223, 195], atol=2).all(axis=2).sum()) for one in pictures]  # a quarter of C1
    assert wide[0] > 1000 > 200 > wide[1]
    (felt := Felt()).add(np.ones((1, 3)), np.full((1, 3), np.nan))
    assert table({"map": felt}) == ["map: no force in 1 more frames"]


def test_list_says_what_a_scenario_applies(capsys) -> None:
    assert main(["list"]) == 0
    for line, name in zip(capsys.readouterr().out.splitlines()[-12:], bundled_scenarios(), strict=True):
        most_n = np.linalg.norm(load_source(name).truth.force_n, axis=-1).max()
        assert line.startswith(f"sim:{name} ") and f" s, up to {most_n:.1f} N: " in line
