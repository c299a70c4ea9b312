"""The guided calibration: when a finger is warm, which places are covered, and that nothing recorded is lost."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import biotac
from biotac.calibrate.reference.csv_file import read_csv
from biotac.calibrate.reference.mounting import LIN
from biotac.calibrate.reference.nano17 import Nano17, Nano17Reader
from biotac.calibrate.reference.samples import Reference, Samples
from biotac.calibrate.wrench.coverage import REGIONS, Coverage
from biotac.calibrate.wrench.guided import MAX_WARM_UP_S, TARE_FRAMES, Step, WrenchProcedure, walk
from biotac.calibrate.wrench.sources import load
from biotac.cli.main import main
from biotac.errors import DeviceLostError, InputError
from biotac.recording.reader import Recording
from biotac.wire.frames import FRAME_DTYPE
from biotac.wire.messages_gen import FrameFlags

R = 5.08  # mm, Lin 2013


def frames(begin: int, count: int, counts_per_min: float = 0.0, *, finger: int = 0, flags: int = 0) -> np.ndarray:
    """Drifting rows of one finger, 10 ms apart from ``begin``."""
    rows = np.zeros(count, FRAME_DTYPE)
    k = begin + np.arange(count)
    rows["finger"], rows["seq"], rows["t_us"], rows["flags"] = finger, k, k * 10_000, flags
    rows["counts"] = np.rint(3000.0 + counts_per_min / 6000.0 * k)[:, None]
    return rows


def still(seconds: float, begin_s: float = 0.0, force_n: float = 0.0) -> Samples:
    t_s = begin_s + np.arange(0.0, seconds, 0.002)
    return Samples(t_s, np.tile([force_n] * 3 + [0.0] * 3, (len(t_s), 1)))


def press(point: tuple[float, float, float], wrench: np.ndarray | None = None, seconds: float = 1.0) -> Samples:
    """3 N into the surface at ``point``, and ``wrench`` on top."""
    at = np.array(point)
    normal = at * [point[0] > 0, 1.0, 1.0] / np.linalg.norm(at * [point[0] > 0, 1.0, 1.0])
    force = -3.0 * normal
    one = np.concatenate([force, np.cross(at, force)]) + (0.0 if wrench is None else wrench)
    t_s = np.arange(0.0, seconds, 0.002)
    return Samples(t_s, np.tile(one, (len(t_s), 1)))


# ---- warm-up and tare --------------------------------------------------------------------------


@pytest.mark.parametrize(("counts_per_min", "warm"), [(-19.0, True), (21.0, False)])
def test_a_finger_is_warm_below_the_limit(counts_per_min: float, warm: bool) -> None:
    lines: list[str] = []
    procedure = WrenchProcedure(0, LIN, lines.append)
    procedure.frames(frames(0, 5900, counts_per_min))
    assert procedure.step is Step.WARM_UP  # a minute is a minute
    procedure.frames(frames(5900, 600, counts_per_min))
    assert (procedure.step is Step.TARE) == warm
    assert procedure.drift_counts_per_min == pytest.approx(counts_per_min, abs=0.5)
    assert lines[0] == "warming up: leave the finger alone"
    assert (lines[1:] == [f"warm: {procedure.drift_counts_per_min:+.1f} counts/min over the last minute"]) == warm


def test_the_drift_is_the_last_minutes() -> None:
    procedure = WrenchProcedure(0, LIN, max_drift_counts_per_min=5.0)
    procedure.frames(frames(0, 12_000, 60.0))
    assert procedure.step is Step.WARM_UP
    rest = frames(12_000, 3_000)
    rest["counts"] = 3120
    procedure.frames(rest)
    assert procedure.step is Step.WARM_UP
    rest = frames(15_000, 3_200)
    rest["counts"] = 3120
    procedure.frames(rest)
    assert procedure.step is Step.TARE


def test_other_fingers_and_touches_do_not_warm_it_up() -> None:
    lines: list[str] = []
    procedure = WrenchProcedure(0, LIN, lines.append)
    procedure.frames(frames(0, 12_000, finger=1))
    assert lines == []
    procedure.frames(frames(0, 12_000, flags=FrameFlags.CONTACT))
    assert procedure.step is Step.WARM_UP


def test_a_finger_that_never_gets_warm_is_given_up() -> None:
    procedure = WrenchProcedure(0, LIN)
    procedure.frames(frames(0, 100, 100.0))
    with pytest.raises(InputError, match=r"after 60 minutes the finger still drifts by .* expected at most 20"):
        procedure.frames(frames(round(MAX_WARM_UP_S * 100) + 1, 100, 100.0))


def tare(procedure: WrenchProcedure, at: int, *, force_n: float = 0.4) -> int:
    """Feed until the board is to tare; the next frame's number."""
    while procedure.step is Step.WARM_UP:
        procedure.frames(frames(at, 500))
        at += 500
    procedure.samples(still(3.0, force_n=force_n))
    procedure.frames(frames(at, TARE_FRAMES))
    assert procedure.wants_tare
    return at + TARE_FRAMES


def test_the_board_is_asked_again_after_a_refusal_and_quiet() -> None:
    procedure = WrenchProcedure(0, LIN)
    at = tare(procedure, 0)
    procedure.tared(accepted=False)
    assert not procedure.wants_tare
    procedure.frames(frames(at, TARE_FRAMES - 1))
    assert not procedure.wants_tare
    procedure.frames(frames(at, 1, flags=FrameFlags.CONTACT))
    procedure.frames(frames(at, TARE_FRAMES))
    assert procedure.wants_tare
    procedure.tared(accepted=True)
    assert not procedure.wants_tare and procedure.step is Step.TARE
    procedure.frames(frames(at, TARE_FRAMES, flags=FrameFlags.UNTARED))
    assert procedure.step is Step.TARE
    procedure.frames(frames(at, 1))
    assert procedure.step is Step.LOADS
    assert procedure.zero is not None
    np.testing.assert_allclose(procedure.zero, [0.4, 0.4, 0.4, 0.0, 0.0, 0.0])


def test_a_reference_that_moves_is_not_zeroed() -> None:
    lines: list[str] = []
    procedure = WrenchProcedure(0, LIN, lines.append)
    at = tare(procedure, 0)
    moving = still(1.0, 3.0)
    procedure.samples(Samples(moving.t_s, moving.wrench + np.linspace(0.0, 1.0, 500)[:, None]))
    procedure.tared(accepted=True)
    procedure.frames(frames(at, TARE_FRAMES))
    assert procedure.step is Step.TARE and procedure.zero is None
    assert "the reference moves by 0." in lines[-1]
    procedure.samples(still(3.0, 5.0))
    procedure.frames(frames(at, TARE_FRAMES))
    assert procedure.step is Step.LOADS
    with pytest.raises(InputError, match="no torque: expected six axes"):
        procedure.samples(Samples(moving.t_s, moving.wrench[:, :3]))


# ---- coverage ----------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("point", "region"),
    [
        ((R, 0.0, 0.0), "tip"),
        ((-8.0, R * np.sin(0.5), -R * np.cos(0.5)), "pad"),
        ((-2.0, R * np.sin(0.9), -R * np.cos(0.9)), "side of E11"),
        ((-15.0, -R * np.sin(0.9), -R * np.cos(0.9)), "side of E1"),
    ],
)
def test_regions(point: tuple[float, float, float], region: str) -> None:
    coverage = Coverage()
    coverage.add(press(point).wrench, 0.002)
    touched = [name for name, cells in zip(REGIONS, coverage.cells, strict=True) if cells]
    assert touched == [region]
    assert coverage.cells.sum() == 1


def test_ways_and_forces_by_hand() -> None:
    coverage = Coverage()
    # at the pad's middle: 1 N to the tip, and -4 N mm about z, which is +4 about the outward normal
    at = np.array([-8.0, 0.0, -R])
    shear, twist = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, -4.0])
    extra = np.concatenate([shear, np.cross(at, shear) + twist])
    coverage.add(press((-8.0, 0.0, -R), extra).wrench, 0.002)
    (line,) = [line for line in coverage.missing() if line.startswith("pad")]
    # 3 N exactly is neither light nor firm
    assert line == (
        "pad: 1 of 8 cells; no light press; no firm press; no shear from the tip; no shear to E11's side; "
        "no shear to E1's side; no twist the other way"
    )
    assert coverage.missing()[0] == "tip: 0 of 8 cells"


def test_too_short_or_too_light_is_not_covered() -> None:
    coverage = Coverage()
    coverage.add(press((-8.0, 0.0, -R), seconds=0.2).wrench, 0.002)
    coverage.add(0.3 * press((-8.0, 0.0, -R)).wrench, 0.002)
    coverage.add(np.full((500, 6), np.nan), 0.002)
    assert coverage.cells.sum() == 0
    coverage.add(press((-8.0, 0.0, -R), seconds=0.1).wrench, 0.002)
    assert coverage.cells.sum() == 1


# ---- on a simulated board with an emulated Nano17 ----------------------------------------------


class Interrupting(Nano17Reader):
    """Ctrl-C, or a cable that comes out, once the board is at ``at_s``."""

    at_s = 0.0
    error: type[BaseException] = KeyboardInterrupt
    source_s = 0.0  # length of the board's source
    last_s = 0.0  # up to which it was read: where no time passes, seconds of it come at once

    def read(self, board_s: float) -> Samples:
        if board_s > self.at_s:
            raise self.error("pulled out")
        self.last_s = board_s
        return super().read(board_s)


def walked(
    folder: Path, scenario: str, at_s: float | None = None, error: type[BaseException] = KeyboardInterrupt
) -> tuple[WrenchProcedure, list[str], Path, Interrupting]:
    path = folder / "walk.mcap"
    lines: list[str] = []
    with biotac.open(f"sim:{scenario}") as hand:
        assert hand.link.source is not None
        reader = Interrupting(hand.link.source, 0)
        reader.source_s = len(hand.link.source.samples) / 100.0
        reader.at_s, reader.error = (1e9 if at_s is None else at_s), error
        procedure = WrenchProcedure(0, reader.nano17.mounting, lines.append)
        walk(hand, reader, procedure, path)
        assert not hand.streaming
        hand.board.set_setting(biotac.Setting.POC_WEIGHTS, 0)  # refused while streaming
    return procedure, lines, path, reader


@pytest.fixture(scope="module")
def everywhere(tmp_path_factory: pytest.TempPathFactory) -> tuple[WrenchProcedure, list[str], Path, Interrupting]:
    return walked(tmp_path_factory.mktemp("walk"), "calibrate.toml")


def test_a_finger_is_walked_through(everywhere: tuple[WrenchProcedure, list[str], Path, Interrupting]) -> None:
    procedure, lines, path, reader = everywhere
    assert procedure.step is Step.DONE
    assert procedure.coverage.complete and procedure.coverage.missing() == []
    assert lines[0] == "warming up: leave the finger alone"
    assert lines[1].startswith("warm: ")
    assert lines[2] == Step.LOADS.value
    assert lines[-1] == "covered: tip 8/8, pad 8/8, side of E11 8/8, side of E1 8/8"
    assert procedure.zero is not None
    np.testing.assert_allclose(procedure.zero[:3], Nano17().zero[:3], atol=0.01)
    np.testing.assert_allclose(procedure.zero[3:], Nano17().zero[3:], atol=0.05)
    recording = Recording(path)
    assert not recording.problems
    # it ended by itself, before the script did
    assert (recording.end_us - recording.begin_us) / 1e6 < 0.9 * reader.source_s


def test_what_was_walked_can_be_fitted_from_its_files(
    everywhere: tuple[WrenchProcedure, list[str], Path, Interrupting],
) -> None:
    path, beside = everywhere[2], everywhere[2].with_suffix(".csv")
    reference = beside, read_csv(beside)
    loaded = load(path, reference, serial="BTSIM00000000006")
    assert loaded.joined is not None and loaded.joined.on_skin_share > 0.99
    assert loaded.run.axes == ("Fx", "Fy", "Fz", "Mx", "My", "Mz", "torsion")
    origin = loaded.provenance(1_700_000_000)
    assert (origin["serial"], origin["files"]) == ("BTSIM00000000006", ["walk.mcap", "walk.csv"])
    assert origin["reference"] == "walk.csv emulated Nano17"
    assert origin["mounting"]["offset_mm"] == [-5.0, 1.5, 10.0]
    assert origin["alignment"]["peak"] > 0.9
    with pytest.raises(InputError, match="is of sensor BTSIM00000000006, but this is BT0000000000000A"):
        load(path, reference, serial="BT0000000000000A")
    assert load(path, reference, serial="BT0000000000000A", force=True).run.serial
    with pytest.raises(InputError, match="which has no force: add --reference"):
        load(path)


@pytest.mark.nightly  # a whole procedure; that something is missing is said by day when Ctrl-C ends one
def test_what_was_left_out_is_said_in_words(tmp_path: Path) -> None:
    procedure, lines, *_ = walked(tmp_path, "calibrate_gaps.toml")
    assert lines[-1] == "the simulated source has ended"
    assert procedure.coverage.missing() == [
        "side of E11: 0 of 8 cells",
        "tip: no shear to the tip",
        "pad: no shear to the tip",
        "side of E1: no shear to the tip",
    ]
    assert "missing: side of E11: 0 of 8 cells" in lines[-2]


SHORT = "calibrate.toml?seconds=140"


def test_ctrl_c_ends_it_and_keeps_everything(tmp_path: Path) -> None:
    procedure, lines, path, reader = walked(tmp_path, SHORT, 130.0)
    assert procedure.step is Step.DONE and procedure.zero is not None
    assert lines[-1] == "stopped by Ctrl-C" and "; missing: pad: 0 of 8 cells" in lines[-2]
    recording = Recording(path)
    assert not recording.problems
    assert (recording.end_us - recording.begin_us) / 1e6 >= 130.0  # to the last byte that came
    reference = read_csv(path.with_suffix(".csv"))
    assert abs(reader.last_s - np.ptp(reference.samples.t_s)) < 0.05


def test_a_source_that_ends_ends_it(tmp_path: Path) -> None:
    procedure, lines, *_ = walked(tmp_path, "calibrate.toml?seconds=10")
    assert procedure.zero is None and lines[-1] == "the simulated source has ended"


@pytest.mark.nightly
def test_a_reference_that_goes_away_leaves_the_files(tmp_path: Path) -> None:
    with pytest.raises(DeviceLostError):
        walked(tmp_path, SHORT, 130.0, DeviceLostError)
    again = Reference("again", read_csv(tmp_path / "walk.csv").samples, LIN)
    assert len(again.samples) > 120 * 500
    assert not Recording(tmp_path / "walk.mcap").problems
    with pytest.raises(InputError, match="already exists; choose another name"):
        walked(tmp_path, SHORT)


# ---- the verb ----------------------------------------------------------------------------------


def test_outputs_are_checked_before_minutes_of_loading(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    (tmp_path / "BTSIM00000000006.md").write_text("mine")
    argv = ["calibrate", "wrench", "--live", "sim:calibrate.toml", "--finger", "index", "--reference", "nano17"]
    assert main([*argv, "--out", str(tmp_path)]) == 2
    assert "BTSIM00000000006.md already exists" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["BTSIM00000000006.md"]


def test_a_full_disk_says_where_the_data_is(tmp_path: Path) -> None:
    full = "import resource, signal, sys; signal.signal(signal.SIGXFSZ, signal.SIG_IGN); "
    full += "resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000)); "
    full += "from biotac.cli.main import main; sys.exit(main(sys.argv[1:]))"
    argv = ["calibrate", "wrench", "--live", "sim:calibrate.toml", "--finger", "index", "--reference", "nano17"]
    words = [sys.executable, "-B", "-c", full, *argv, "--out", str(tmp_path)]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 2 and "File too large" in done.stderr
    assert f"the recorded data is in {tmp_path / 'BTSIM00000000006.mcap'} and" in done.stderr
