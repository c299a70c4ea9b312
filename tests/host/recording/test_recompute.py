"""biotac recompute: the board's results again from the counts, others with other settings, nothing overwritten."""

import json
from pathlib import Path

import numpy as np
import pytest
import sensor_faults

import biotac
from biotac.cli.main import main
from biotac.kernels.compiled import FORCE_GAINS, reference_q4
from biotac.recording.crosscheck import FORCE_BOUND_MN
from biotac.wire import messages_gen as wire
from biotac.wire import slots


def record(path: Path, source: str, *, rest: bool = True, **settings: int) -> biotac.Recording:
    with biotac.open(source) as hand:
        for name, value in settings.items():
            hand.board.set_setting(wire.Setting[name.upper()], value)
        hand.record(path)
        hand.stream(rest=rest)
        hand.read_batch(100)
    return biotac.Recording(path)


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    return tmp_path_factory.mktemp("recompute")


@pytest.fixture(scope="module")
def recorded(folder) -> biotac.Recording:
    return record(folder / "a.mcap", "sim:press.toml?fingers=2")


def tares(recording: biotac.Recording) -> list[wire.Tare]:
    return [m for m in recording.messages if isinstance(m, wire.Tare)]


@pytest.mark.parametrize(
    ("source", "options"),
    [
        ("press.toml?fingers=2", []),
        ("press.toml?fingers=2", ["--keep-tare"]),
        ("shear.toml", []),
        ("drift.toml?seconds=8", []),
    ],
)
def test_without_a_change_it_is_what_the_board_sent_bit_for_bit(folder, source: str, options: list[str]) -> None:
    was = record(folder / "same.mcap", f"sim:{source}")
    (folder / "again.mcap").unlink(missing_ok=True)
    assert main(["export", "--recompute", str(folder / "same.mcap"), str(folder / "again.mcap"), *options]) == 0
    again = biotac.Recording(folder / "again.mcap")
    assert again.wire.tobytes() == was.wire.tobytes()
    assert tares(again) == tares(was) != []
    assert again.pac.tobytes() == was.pac.tobytes()
    (folder / "same.mcap").unlink()


def test_another_sensors_words_are_distrusted_again(folder) -> None:
    """With PAC and pressure, which both have to be given to the core."""
    press = sensor_faults.press(1)
    words = press.words.copy()
    words[press.begins("rest") :] = press.other[press.begins("rest") :]
    slot = {"E": slots.ELECTRODE_SLOT, "PDC": slots.PDC_SLOT, "TDC": slots.TDC_SLOT, "PAC": slots.PAC_SLOT}
    np.savez(folder / "exchanged.npz", **{name: words[:, at] for name, at in slot.items()})
    was = record(folder / "exchanged.mcap", f"sim:{folder / 'exchanged.npz'}")
    assert (was.wire["flags"] & wire.FrameFlags.SENSOR_FAULT).any()
    assert main(["export", "--recompute", str(folder / "exchanged.mcap"), str(folder / "exchanged_again.mcap")]) == 0
    assert biotac.Recording(folder / "exchanged_again.mcap").wire.tobytes() == was.wire.tobytes()


def test_where_a_sensor_was_silent_the_filters_begin_anew(folder) -> None:
    # Unplugged twice, and asked for its serial on return: rounds without a FRAME.
    was = record(folder / "silent.mcap", "sim:faults.toml", pressure_filter_milli=100)
    assert (np.diff(was.frames["t_us"][was.wire["finger"] == 1]) > 400_000).sum() == 2
    assert main(["export", "--recompute", str(folder / "silent.mcap"), str(folder / "silent_again.mcap")]) == 0
    assert biotac.Recording(folder / "silent_again.mcap").wire.tobytes() == was.wire.tobytes()


def test_what_the_host_said_of_a_hold_is_heard_again(folder) -> None:
    # Some seconds pass while a command is answered, as many as the pipe to this side holds; it must not end in them.
    with biotac.open("sim:press.toml?seconds=300") as hand:
        hand.board.set_setting(wire.Setting.HOLD_TIMEOUT_MS, 300)
        hand.record(folder / "grasp.mcap")
        hand.read(0.5)
        with hand.grasp("index"):
            hand.read(1.5, fresh=True)  # a hand that is pulled says nothing meanwhile
        hand.read_batch(100)
    was = biotac.Recording(folder / "grasp.mcap")
    reasons = [m.reason for m in tares(was)]
    assert wire.TareReason.HOST_HOLD in reasons and wire.TareReason.HOST_RELEASE in reasons
    assert wire.TareReason.HOLD_LAPSED not in reasons  # as time waits for the reader
    held = (was.wire["flags"] & wire.FrameFlags.HELD) != 0
    assert 20 < held.sum() < len(held)
    assert main(["export", "--recompute", str(folder / "grasp.mcap"), str(folder / "grasp_again.mcap")]) == 0
    again = biotac.Recording(folder / "grasp_again.mcap")
    assert again.wire.tobytes() == was.wire.tobytes()
    # A TARE precedes its FRAME, and the recording may end between them.
    assert tares(again) == [m for m in tares(was) if m.seq <= was.wire["seq"][-1]]


@pytest.mark.parametrize("options", [[], ["--keep-tare"]])
@pytest.mark.parametrize("weights", list(wire.PocWeights))
def test_other_weights_give_what_a_board_with_them_sends(folder, recorded, capsys, weights, options: list[str]) -> None:
    """The truth is another simulated board, which had the setting while it measured."""
    expected = record(folder / "truth.mcap", "sim:press.toml?fingers=2", poc_weights=weights)
    words = ["export", "--recompute", str(recorded.path), str(folder / "new.mcap"), "--force"]
    assert main([*words, "--poc-weights", weights.name.lower(), *options]) == 0
    assert f"poc_weights = {weights.name} ({int(weights)})" in capsys.readouterr().out
    expected.wire  # noqa: B018  (read before the file goes)
    (folder / "truth.mcap").unlink()
    new = biotac.Recording(folder / "new.mcap")
    assert np.array_equal(new.wire["poc_um"], expected.wire["poc_um"])
    assert np.array_equal(new.wire["force_100un"], expected.wire["force_100un"])
    # Energies between one and four thresholds are in no frame: there TORSION_OK stays off when tares are kept.
    unsure = np.uint32(wire.FrameFlags.TORSION_OK if options else 0)
    unsure = np.where(new.wire["flags"] & wire.FrameFlags.POC_LOW, unsure, 0)
    assert np.array_equal(new.wire["flags"] & ~unsure, expected.wire["flags"] & ~unsure)
    assert new.settings == expected.settings
    assert main(["check", str(folder / "new.mcap")]) == 0


@pytest.mark.parametrize("options", [[], ["--keep-tare"]])
def test_the_population_map_gives_what_a_board_with_it_sends(tmp_path, options: list[str]) -> None:
    # the emulated finger has other gains, which would take precedence
    gains = {s.name.lower(): wire.SETTINGS[s].default for s in FORCE_GAINS}
    model = tmp_path / "model.json"
    model.write_text('{"force_model": 1}', encoding="utf-8")
    names = [tmp_path / f"{name}.mcap" for name in ("lin", "population", "new")]
    record(names[0], "sim:press.toml", force_model=wire.ForceModel.LIN, **gains)
    sent = record(names[1], "sim:press.toml", force_model=wire.ForceModel.POPULATION, **gains)
    forced = (sent.wire["flags"] & wire.FrameFlags.UNTARED) == 0
    assert forced.any() and (sent.wire["flags"][forced] & wire.FrameFlags.POPULATION).all()
    assert main(["export", "--recompute", str(names[0]), str(names[2]), "--settings", str(model), *options]) == 0
    new = biotac.Recording(names[2]).wire
    for half in ("normal_half_mn", "shear_half_mn") if options else ():  # of noise, which a frame does not hold
        assert (new[half][forced] == wire.INVALID_COUNT).mean() > 0.5
        new[half], new["trust"] = sent.wire[half], sent.wire["trust"]
    assert new.tobytes() == sent.wire.tobytes()
    assert main(["check", str(names[1])]) == 0


def test_settings_come_from_a_file(folder, recorded, capsys) -> None:
    (folder / "s.json").write_text(json.dumps({"settings": {"force_gain_z_nn": 4_524_468}}))
    out = folder / "gain.mcap"
    words = ["export", "--recompute", str(recorded.path), str(out)]
    assert main([*words, "--settings", str(folder / "s.json"), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["frames"] == len(recorded.frames)
    new = biotac.Recording(out)
    truth = reference_q4(new.wire["counts"], new.wire["tare_q4"], new.settings)
    valid = ~np.isnan(new.frames["force_n"][:, 2])
    assert np.abs(new.frames["force_n"][valid] - truth.force_n[valid]).max() <= FORCE_BOUND_MN / 1e3
    about = json.loads(new.metadata["recomputed"])
    assert about["from"] == "a.mcap" and about["changes"] == {"force_gain_z_nn": 4_524_468}


def test_the_tare_machine_hears_its_settings(folder, recorded) -> None:
    """A threshold nothing reaches: no contact any more, as on a board with it."""
    expected = record(folder / "deaf.mcap", "sim:press.toml?fingers=2", contact_energy_count2=1_000_000)
    (folder / "deaf.json").write_text('{"contact_energy_count2": 1000000}')
    words = ["export", "--recompute", str(recorded.path), str(folder / "new.mcap"), "--force"]
    assert main([*words, "--settings", str(folder / "deaf.json")]) == 0
    new = biotac.Recording(folder / "new.mcap")
    assert new.wire.tobytes() == expected.wire.tobytes() != recorded.wire.tobytes()
    assert main([*words, "--settings", str(folder / "deaf.json"), "--keep-tare"]) == 2


def test_a_recording_that_began_in_mid_life_says_so(folder, capsys) -> None:
    path = folder / "mid.mcap"
    path.unlink(missing_ok=True)
    # Some seconds pass with each command that a recording begins with; then there is still something to record.
    with biotac.open("sim:press.toml?seconds=1800") as hand:
        hand.read(3.0)
        hand.record(path)
        hand.read(10.0, fresh=True)
    assert main(["export", "--recompute", str(path), str(folder / "mid2.mcap"), "--force"]) == 0
    assert "finger 0 was tared before the recording began" in capsys.readouterr().err
    new, was = biotac.Recording(folder / "mid2.mcap"), biotac.Recording(path)
    assert np.array_equal(new.wire["seq"], was.wire["seq"]) and int(was.wire["seq"][0]) > 200
    assert np.array_equal(new.wire["tare_q4"][0], was.wire["tare_q4"][0])


def test_heartbeats_need_kept_tares(folder, capsys) -> None:
    path = folder / "quiet.mcap"
    record(path, "sim:press.toml", rest=False)
    assert main(["export", "--recompute", str(path), str(folder / "q2.mcap")]) == 2
    assert "heartbeats" in capsys.readouterr().err
    assert not (folder / "q2.mcap").exists()
    assert main(["export", "--recompute", str(path), str(folder / "q2.mcap"), "--keep-tare"]) == 0
    assert biotac.Recording(folder / "q2.mcap").wire.tobytes() == biotac.Recording(path).wire.tobytes()


@pytest.mark.parametrize(("text", "seen"), [('{"poc_weights": 1.5}', "integers"), ('{"poc_weights": 7}', "0 to 2")])
def test_settings_that_are_none_are_refused(folder, recorded, capsys, text: str, seen: str) -> None:
    (folder / "bad.json").write_text(text)
    words = ["export", "--recompute", str(recorded.path), str(folder / "x.mcap")]
    assert main([*words, "--settings", str(folder / "bad.json")]) == 2
    error = capsys.readouterr().err
    assert seen in error and error.count("\n") == 1
    assert not (folder / "x.mcap").exists()


def test_out_may_be_an_export(folder, recorded) -> None:
    out = folder / "again.npz"
    assert main(["export", "--recompute", str(recorded.path), str(out), "--poc-weights", "abs_n2"]) == 0
    with np.load(out) as arrays:
        about = json.loads(str(arrays["columns"]))
        assert json.loads(about["metadata"]["settings"])["poc_weights"] == 0
        assert len(arrays["finger1/frames/poc_mm"]) == len(recorded.frames) // 2


@pytest.mark.parametrize(("out", "step"), [("stopped.mcap", 1), ("stopped.mcap", 5), ("stopped.csv", 5)])
def test_an_interrupted_recomputation_leaves_nothing(
    recorded, tmp_path, capsys, interrupt_at, out: str, step: int
) -> None:
    interrupt_at(lambda k, text: k == step)
    assert main(["export", "--recompute", str(recorded.path), str(tmp_path / out)]) == 130
    assert f"{out} was not written" in capsys.readouterr().err
    assert list(tmp_path.iterdir()) == []
