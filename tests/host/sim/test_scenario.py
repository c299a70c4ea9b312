"""The scenario format: the effect of a timeline, and which files are scenarios."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from biotac import sim
from biotac.cli.main import main
from biotac.core import geometry as surface
from biotac.errors import InputError
from biotac.sim import Source, bundled_scenarios, load_source, sampling
from biotac.sim.fault_gen import EmuFault
from biotac.sim.faults import BUS_FAULTS, FAULTS
from biotac.sim.physics import SimFinger
from biotac.sim.scenario import STEP_KEYS, parse_scenario
from biotac.sim.source import CODES
from biotac.sim.timeline import Pose, Track
from biotac.wire import slots
from biotac.wire.slots import ELECTRODE_SLOT, FRAME_S
from biotac_lab.gains import fit_gains

REST = '[[step]]\ndo = "rest"\nseconds = 1.0\n'
PRESS = '[[step]]\ndo = "press"\nseconds = 0.5\nat = "E17"\nforce_n = 5.0\n'

ROOT = Path(__file__).resolve().parents[3]


def play(tmp_path: Path, text: str, **options: float) -> Source:
    path = tmp_path / "try.toml"
    path.write_text(text)
    return load_source(path, **options)  # type: ignore[arg-type]


# ---- timelines ---------------------------------------------------------------------------------


def test_a_press_ramps_holds_and_lets_go(tmp_path: Path) -> None:
    text = 'name = "t"\n' + REST + PRESS + '[[step]]\ndo = "hold"\nseconds = 1\n' + REST
    source = play(tmp_path, text)
    truth = source.truth
    assert truth is not None and source.samples.shape == (350, 1, 44)
    force_z = truth.force_n[:, 0, 2]
    assert not force_z[:100].any() and not truth.contact[:100].any()
    np.testing.assert_allclose(force_z[100:150], 5.0 * (np.arange(50) + 0.5) / 50, rtol=1e-9)
    np.testing.assert_allclose(force_z[150:250], 5.0)
    np.testing.assert_allclose(force_z[250:260], 5.0 * (9.5 - np.arange(10)) / 10, rtol=1e-9)
    assert truth.contact[100:260].all() and not truth.contact[260:].any()
    np.testing.assert_allclose(truth.poc_mm[200, 0], [-2.8, 0.0, -5.08])
    assert np.isnan(truth.poc_mm[50]).all() and np.isnan(truth.poc_mm[300]).all()
    # the counts follow: E17 falls while pressed and comes back
    e17 = source.samples[:, 0, slots.ELECTRODE_SLOT[16]].astype(float)
    assert e17[150:250].mean() < e17[:100].mean() - 100 and abs(e17[300:].mean() - e17[:100].mean()) < 20


def test_shear_twist_and_slide_stay_until_changed(tmp_path: Path) -> None:
    text = (
        'name = "t"\n' + PRESS
        + '[[step]]\ndo = "shear"\nseconds = 0.1\nshear_n = [1.0, -2.0]\n'
        + '[[step]]\ndo = "twist"\nseconds = 0.1\ntorsion_nmm = 4\n'
        + '[[step]]\ndo = "slide"\nseconds = 0.1\nto_mm = [-9.8, 0.0]\n'
        + '[[step]]\ndo = "hold"\nseconds = 0.1\n'
        + '[[step]]\ndo = "press"\nseconds = 0.1\nforce_n = 0\n' + PRESS
    )  # fmt: skip
    truth = play(tmp_path, text).truth
    assert truth is not None
    np.testing.assert_allclose(truth.force_n[85, 0], [1.0, -2.0, 5.0], atol=1e-9)
    contact, force = np.array([-9.8, 0.0, -5.08]), np.array([1.0, -2.0, 5.0])
    np.testing.assert_allclose(truth.poc_mm[85, 0], contact, atol=1e-9)
    np.testing.assert_allclose(truth.torque_nmm[85, 0], np.cross(contact, force) - (0, 0, 4.0), atol=1e-9)
    # released, so the next press starts without shear or torsion
    np.testing.assert_allclose(truth.force_n[-1, 0, :2], 0.0, atol=1e-12)


def test_fingers_are_cut_and_repeated_with_sensors_of_their_own(tmp_path: Path) -> None:
    text = 'name = "t"\nseed = 9\nfingers = 2\n' + PRESS.replace("[[step]]", "[[step]]\nfingers = [1]")
    two, one, five = play(tmp_path, text), play(tmp_path, text, fingers=1), play(tmp_path, text, fingers=5)
    np.testing.assert_array_equal(one.samples, two.samples[:, :1])
    np.testing.assert_array_equal(five.samples[:, :2], two.samples)
    assert five.truth is not None and five.truth.contact[-1].tolist() == [False, True, False, True, False]
    assert len({five.samples[:, k].tobytes() for k in range(5)}) == 5
    assert len(set(five.serials)) == 5 and all(len(serial) == 16 for serial in five.serials)


def test_the_last_frame_of_a_scenario_that_ends_in_contact_is_pressed(tmp_path: Path) -> None:
    source = play(tmp_path, 'name = "t"\n' + REST + PRESS + '[[step]]\ndo = "hold"\nseconds = 0.5\n')
    pdc = source.samples[-5:, 0, slots.PDC_SLOT].astype(float)
    assert pdc.min() > source.samples[0, 0, slots.PDC_SLOT] + 400


def test_finger_tables_choose_the_sensors(tmp_path: Path) -> None:
    text = (
        'name = "t"\n[[finger]]\nprofile = "worn"\nseed = 4\nserial = "BT2P0220B11E0004"\n'
        '[[finger]]\nseed = 4\n' + REST
    )  # fmt: skip
    source = play(tmp_path, text)
    assert source.serials == ("BT2P0220B11E0004", "BTSIM00000000004")
    for k, profile in enumerate(("worn", "new")):
        mean = source.samples[:, k, slots.ELECTRODE_SLOT].mean(axis=0)
        np.testing.assert_allclose(mean, SimFinger(4, profile).rest_counts(np.zeros(1))[0], atol=3)


# ---- faults ------------------------------------------------------------------------------------


def test_a_fault_replaces_exactly_the_words_it_covers(tmp_path: Path) -> None:
    fault = '[[fault]]\nat_s = 0.5\nseconds = 0.1\nfinger = 1\nkind = "{}"\n'
    text = 'name = "t"\nfingers = 2\n' + REST
    clean = play(tmp_path, text).samples
    for kind, code in BUS_FAULTS.items():
        words = play(tmp_path, text + fault.format(kind)).samples
        expected = clean.copy()
        expected[50:60, 1, :] = code
        np.testing.assert_array_equal(words, expected)
    words = play(tmp_path, text + fault.format("bad_parity") + 'channel = "PAC"\n').samples
    assert (words[50:60, 1, slots.PAC_SLOT] == EmuFault.BAD_PARITY).all()
    assert (words == EmuFault.BAD_PARITY).sum() == 220
    # between frames: 4400 slots a second, so 0.502 s is slot 2209, the tenth of frame 50 (from 0: 9)
    words = play(tmp_path, text + fault.format("stuck_low").replace("0.5", "0.502", 1)).samples
    assert (words[50, 1, :9] < 4096).all() and (words[50, 1, 9:] == EmuFault.STUCK_LOW).all()
    assert (words[60, 1, :9] == EmuFault.STUCK_LOW).all() and (words[60, 1, 9:] < 4096).all()


# ---- gains -------------------------------------------------------------------------------------


def test_fitted_gains_recover_gains_that_are_exact() -> None:
    rng = np.random.default_rng(1)
    signal = rng.normal(0.0, 100.0, (50, 19))
    arms = np.cross(surface.ELECTRODE_MM, surface.ELECTRODE_NORMAL)
    force = signal @ surface.ELECTRODE_NORMAL * [1e-3, 2e-4, 0.0]
    torque = signal @ arms * [7e-3, -3e-3, 5.0]
    assert fit_gains(signal, force, torque) == {
        "force_gain_x_nn": 1_000_000,
        "force_gain_y_nn": 200_000,
        "torque_gain_y_nn": -3_000_000,
        "torque_gain_z_nn": 100_000_000,  # 5e9, held at the setting's end
    }
    assert fit_gains(np.zeros((50, 19)), force, torque) == {}


# ---- bundled scenarios -------------------------------------------------------------------------


def test_the_page_and_a_new_scenario_have_every_verb_and_fault(tmp_path: Path) -> None:
    new = tmp_path / "new.toml"
    assert main(["sim", "--new", str(new)]) == 0
    assert main(["sim", "--new", str(new)]) == 2 and main(["sim", "--new", str(new), "--force"]) == 0
    page, text = (ROOT / "host/docs/guides/simulator.md").read_text(encoding="utf-8"), new.read_text(encoding="utf-8")
    for word in (*STEP_KEYS, *(key for keys in STEP_KEYS.values() for key in keys), *BUS_FAULTS):
        assert f"`{word}" in page and word in text, word
    assert all(f"`{name}`" in page for name in FAULTS)


@pytest.mark.parametrize("name", bundled_scenarios())
def test_bundled_scenarios_play_and_can_be_repeated(name: str) -> None:
    text = (Path(sim.__file__).parent / "scenarios" / name).read_bytes()
    scenario = parse_scenario(text, file=name)
    assert scenario.name + ".toml" == name
    for track in scenario.tracks:
        end = track.states(np.array([0.0, track.seconds]))
        assert not end.force_n.any() and not end.warm_c.any()  # no jump where a repetition begins
    source = load_source(name, seconds=3.0)
    assert len(source.samples) == 300


def test_drift_never_touches_and_keeps_below_the_tares_slew() -> None:
    source = load_source("drift.toml", fingers=5)
    assert source.truth is not None and not source.truth.contact.any() and len(source.samples) == 6000
    counts = source.samples[:, :, slots.ELECTRODE_SLOT].astype(float)
    # 10 s means are 10 s apart; the tare follows 0.5 count/s (SPEC.md, Tare)
    means = counts.reshape(6, 1000, -1).mean(axis=1)
    slope = np.abs(np.diff(means, axis=0)).max() / 10.0
    assert 0.1 < slope < 0.5


def test_faults_shows_each_kind_once_on_one_of_three_fingers() -> None:
    samples = load_source("faults.toml").samples
    assert samples.shape[1] == 3 and (samples[:, [0, 2]] < 4096).all()
    for code in set(CODES) - {EmuFault.UNPLUGGED, EmuFault.SWAPPED}:  # a sensor that is away is no fault of a word
        frames = np.flatnonzero((samples[:, 1] == code).any(axis=1))
        assert len(frames) > 0 and (np.diff(frames) == 1).all()  # one stretch


# ---- load_source -------------------------------------------------------------------------------


def test_a_missing_scenario_lists_the_bundled_ones(tmp_path: Path) -> None:
    for path in ("no_such.toml", tmp_path / "press.toml"):
        with pytest.raises(InputError, match=r"or one of calibrate\.toml, calibrate_gaps\.toml, drift\.toml"):
            load_source(path)


def test_a_file_of_the_same_name_comes_first(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "press.toml").write_text('name = "mine"\n' + REST)
    assert load_source("press.toml").name == "mine"
    assert load_source("poke.toml", seconds=0.1).name == "poke"


@pytest.mark.parametrize(
    ("path", "options", "words"),
    [
        ("press.csv", {}, r"press\.csv: unknown kind of source: expected \.toml"),
        *((f"folder.{kind}", {}, "not a file") for kind in ("toml", "npz")),
        *(("press.toml", {"fingers": count}, "expected 1 to 5") for count in (0, 6, True)),
        *(("press.toml", {"seconds": s}, r"expected 0\.01 to 7200") for s in (0.0, float("nan"), 7201.0)),
    ],
)
def test_what_cannot_be_loaded_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, path, options, words
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("folder.toml", "folder.npz"):
        Path(name).mkdir()
    with pytest.raises(InputError, match=words):
        load_source(path, **options)


def test_what_skin_remembers_goes_on_over_thousands_of_frames() -> None:
    """Creep and the pressure's lags, which are computed in blocks, against their plain recursion."""
    finger = SimFinger(1)
    finger.noise_counts = 0.0
    finger.drift_per_min[:] = 0.0
    track = Track()
    press = Pose(x_mm=-3.0, force_n=4.0, tip_mm=7.0)
    for _ in range(4):
        track.ramp(2.0, press, start=replace(press, force_n=0.0))
        track.ramp(5.0, press)
        track.ramp(1.0, press.released())
    states = track.states(np.arange(3001) * FRAME_S)
    words = sampling.sample(finger, states)[:, ELECTRODE_SLOT]
    exact, keep = finger.counts(states), np.exp(-FRAME_S / sampling.CREEP_S)
    lagged = np.zeros(19)
    for k, pressed in enumerate(exact - finger.rest_counts(states.warm_c)):
        lagged = keep * lagged + (1.0 - keep) * pressed
        exact[k] += finger.creep_share * lagged
    share = ELECTRODE_SLOT / 44.0
    np.testing.assert_allclose(words, exact[:-1] * (1.0 - share) + exact[1:] * share, atol=0.5000001)
