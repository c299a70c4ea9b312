"""The doctor: every finding from facts that a test makes up, and from simulated boards."""

import dataclasses
import json
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from doctor_facts import PORT, RELEASE, board, dynamic_pressure, healthy, hello, info, message, rounds, usb_port
from rosbags.rosbag1 import Writer
from rosbags.typesys import Stores, get_typestore
from serial.tools import list_ports

import biotac
from biotac import HandWarning
from biotac.cli.main import main
from biotac.clock import Fit
from biotac.doctor import CATALOGUE, Facts, SystemFacts, diagnose, udev
from biotac.doctor.connection import release
from biotac.errors import (
    CommandRefusedError,
    DeviceLostError,
    NotAGatewayError,
    PortBusyError,
    PortError,
    WireVersionError,
)
from biotac.link.holders import Holder
from biotac.version import __version__
from biotac.wire import messages_gen as wire

ROOT = Path(__file__).resolve().parents[3]
NOBODY = Holder(7, "minicom")


def grown(finger: int, **counters: int) -> Facts:
    """Sensor counters that have wrapped on the way."""
    facts = healthy()
    before, after = list(facts.sensors_before), list(facts.sensors_after)
    for name, more in counters.items():
        before[finger] = dataclasses.replace(before[finger], **{name: 2**32 - 1})
        after[finger] = dataclasses.replace(after[finger], **{name: more - 1})
    return board(sensors_before=before, sensors_after=after)


def state(**values: Any) -> Facts:
    after = list(healthy().sensors_after)
    after[1] = dataclasses.replace(after[1], **values)
    return board(sensors_after=after)


def frames(change: Callable[[np.ndarray], None]) -> Facts:
    rows = rounds()
    change(rows[1::2])
    return board(frames=rows)


def pressed(pdc_per_n: float) -> Facts:
    """3 N on finger 1."""

    def press(rows: np.ndarray) -> None:
        rows["normal_n"], rows["normal_half_n"], rows["pdc_tare"] = 3.0, 0.0, 2000
        rows["pdc"] += round(3 * pdc_per_n)

    return frames(press)


def vibration(change: Callable[[np.ndarray], None]) -> Facts:
    rows = dynamic_pressure()
    change(rows[1::2])
    return board(pac=rows)


def out(electrode: int, fault: wire.SensorFault) -> Facts:
    return state(electrodes_out=1 << electrode, electrode_fault=fault)


def shorted(rows: np.ndarray) -> None:
    rows["counts"][:, 1] = 3000 - np.arange(len(rows)) // 4
    rows["counts"][:, 8] = rows["counts"][:, 1] + np.arange(len(rows)) % 3


def copied(rows: np.ndarray) -> None:
    rows["counts"][:, 1] -= np.arange(len(rows)).astype(np.uint16) // 4
    rows["counts"][:, 8] = rows["counts"][:, 1] - 217


def lifted(counts: int, rounds: int) -> Callable[[np.ndarray], None]:
    """A touch in which E5 is so many counts above the tare for so many rounds."""

    def change(rows: np.ndarray) -> None:
        rows["tare_state"], rows["tare"] = wire.TareState.CONTACT, rows["counts"]
        rows["counts"][:rounds, 4] += counts

    return change


def mark(name: str, value: int, column: int | None = None) -> Callable[[np.ndarray], None]:
    def change(rows: np.ndarray) -> None:
        if column is None:
            rows[name] = value
        else:
            rows[name][:, column] = value

    return change


def before(**values: Any) -> Facts:
    return board(before=dataclasses.replace(healthy().before, **values))


def after(**values: Any) -> Facts:
    return board(after=dataclasses.replace(healthy().after, **values))


def link(**counters: int) -> Facts:
    return board(stats=dataclasses.replace(healthy().stats, **counters))


# The facts -> the one code that must come, and a word that the finding must name.
CASES: list[tuple[str, Facts, str]] = [
    ("no_board", Facts(None), "no serial port"),
    (
        "several_boards",
        Facts(None, SystemFacts(boards=[usb_port("COM3", "A"), usb_port("COM10", "B")])),
        "serial:A on COM3, serial:B on COM10",
    ),
    ("no_serial_port", Facts(None, SystemFacts(usb_boards=1)), "no serial port"),
    ("in_loader", Facts(None, SystemFacts(loaders=["USB 1-2"])), "USB 1-2"),
    (
        "no_permission",
        Facts(PORT, SystemFacts(permitted=False, owner="root's"), PortError(f"no permission to open {PORT}")),
        "root's",
    ),
    (
        "port_busy",
        Facts(PORT, SystemFacts(holders=[NOBODY]), PortBusyError(f"{PORT} is in use by minicom")),
        "minicom (process 7)",
    ),
    ("port_shared", Facts(PORT, SystemFacts(holders=[NOBODY]), board=healthy()), "minicom (process 7)"),
    ("port_failed", Facts(PORT, error=PortError("no port here")), "no port here"),
    ("modem_manager", Facts(PORT, SystemFacts(modem_manager=True), board=healthy()), "ID_MM_DEVICE_IGNORE"),
    ("not_a_gateway", Facts(PORT, error=NotAGatewayError("nothing answers")), "nothing answers"),
    ("board_lost", Facts(PORT, error=DeviceLostError("went away")), "went away"),
    ("refused", Facts(PORT, error=CommandRefusedError("LINK_BUSY")), "LINK_BUSY"),
    ("wire_version", Facts(PORT, error=WireVersionError("speaks wire 9.0")), "wire 9.0"),
    ("schema_differs", board(warnings=[HandWarning("schema_differs", "other schema")]), "other schema"),
    ("rounds", board(warnings=[HandWarning("rounds", "2 of 22 samples of PAC")]), "2 of 22 samples"),
    (
        "firmware_older",
        board(hello=hello(0, 0, 9, fingers_present=0b11)),
        f"firmware 0.0.9, this package {__version__}",
    ),
    (
        "wrong_sensor",
        board(sensors=[info(0, "BT00001"), dataclasses.replace(info(1, "BTSP050400018017"), present=0)]),
        "finger 1 is BTSP050400018017",
    ),
    (
        "sensor_lost",
        board(sensors=[info(0, "BT00001"), dataclasses.replace(info(1, "BT00002"), present=0)]),
        "finger 1, BT00002, was unplugged",
    ),
    ("no_sensor", board(hello=hello(*RELEASE), sensors=[]), "no sensor answers"),
    ("sensor_missing", dataclasses.replace(board(), expected_fingers=3), "2 of 3 sensors answer: finger 0, 1"),
    ("sensor_lost", board(frames=rounds((0,))), "finger 1 sent no frame"),
    ("sensor_lost", after(fingers_present=1), "finger 1 stopped"),
    (
        "sensor_unsure",
        frames(lambda rows: mark("flags", int(wire.FrameFlags.SENSOR_UNSURE))(rows[260:])),
        "finger 1 was away and has not identified itself since: 40 of 300",
    ),
    (
        "sensor_other",
        frames(lambda rows: mark("flags", int(wire.FrameFlags.SENSOR_OTHER | wire.FrameFlags.SENSOR_UNSURE))(rows[9:])),
        "finger 1: a different sensor answers",
    ),
    (
        "same_serial",
        board(sensors=[info(0, "BT00001"), info(1, "BT00001")]),
        "fingers 0, 1 all report serial number BT00001",
    ),
    ("mixed_sensors", board(sensors=[info(0, "BT1"), info(1, "BT2", flex="21")]), "finger 1: flex 21, software 0210"),
    ("mixed_sensors", board(sensors=[info(0, "BT1"), info(1, "BT2", software="0300")]), "software 0300"),
    ("words_stuck", grown(1, words_stuck=44), "finger 1: 44 of 4444 words are 0x0000 or 0xFFFF"),
    ("words_parity", grown(0, words_parity=1), "finger 0: 1 of 4401 words have bad parity"),
    ("words_error", grown(0, words_error=5), "5 of 4405 words"),
    ("board_restarted", after(uptime_s=0), "up for 0 s"),
    ("board_restarted", link(disordered=2), "up for"),
    ("chip_old", board(chip=message(wire.BoardFacts, chip_id=0x10002927)), "0x10002927"),
    ("chip_floats", board(chip=message(wire.BoardFacts, chip_id=0x20004927)), "0x20004927: RP2350 A2"),
    ("faults_latched", before(faults=9), "board: STORAGE"),
    ("faults_latched", before(finger_faults=(0, 32, 0, 0, 0)), "middle: RAIL"),
    ("slots_late", after(slots_late=2), "3 slots"),
    ("messages_dropped", after(messages_dropped=4), "4 messages"),
    ("frames_lost", link(frames_lost=5), "5 frames and 0 PAC"),
    ("frames_lost", link(pac_lost=6), "6 PAC"),
    ("bytes_damaged", link(crc_errors=7), "7 frames with a bad CRC"),
    ("bytes_damaged", link(other_errors=8), "8 otherwise"),
    ("rate_wrong", board(frames=rounds((0, 1), step_us=10_200)), "finger 0: 4314 samples a second, expected 4400"),
    ("clock_drift", board(clock=Fit(0.0, 1.0, 0.001, -180.0, 30.0)), "-180 ppm, +/- 30 ppm"),
    ("clock_jumped", board(clock_resets=2), "2 jump(s)"),
    ("no_tare", state(tare_state=wire.TareState.INIT), "finger 1"),
    ("tare_fault", state(tare_state=wire.TareState.FAULT, tare_age_ms=90_000), "90 s old"),
    ("base_old", frames(mark("flags", int(wire.FrameFlags.BASE_OLD))), "finger 1 has been touched for over a minute"),
    ("sensor_frozen", state(sensor_fault=wire.SensorFault.FROZEN), "finger 1: every channel"),
    *(
        ("channel_railed", frames(mark(name, count, column)), f"finger 1: {at}")
        for name, column, at in (("counts", 4, "E5"), ("counts", 18, "E19"), ("pdc", None, "PDC"), ("tdc", None, "TDC"))
        for count in (0, 4090)
    ),
    ("channel_railed", vibration(mark("pac", 4095)), "finger 1: PAC"),
    *(("channel_stuck", frames(mark(name, 2100)), f"finger 1: {name.upper()}") for name in ("pdc", "tac", "tdc")),
    ("channel_stuck", frames(mark("counts", 2100, 6)), "finger 1: E7"),
    ("channel_stuck", vibration(mark("pac", 2100)), "finger 1: PAC"),
    ("channel_noisy", out(2, wire.SensorFault.NOISY), "finger 1: E3"),
    ("channel_stuck", out(4, wire.SensorFault.STUCK), "finger 1: E5"),
    ("electrode_alone", out(18, wire.SensorFault.ALONE), "finger 1: E19"),
    ("electrodes_shifted", state(sensor_fault=wire.SensorFault.TOGETHER), "finger 1"),
    ("electrodes_silent", state(sensor_fault=wire.SensorFault.SILENT), "finger 1"),
    ("sensor_exchanged", state(sensor_fault=wire.SensorFault.EXCHANGED), "finger 1"),
    ("electrodes_shorted", frames(shorted), "finger 1: E2 and E9"),
    ("channel_copied", frames(copied), "finger 1: E2 and E9"),
    ("electrodes_inverted", frames(lifted(1000, 25)), "finger 1: E5 rises by 1000 counts"),
    ("pressure_flat", pressed(20), "finger 1: static pressure moves by 20 counts per newton"),
    ("pressure_flat", pressed(2), "finger 1: static pressure moves by 2 counts per newton"),
    ("pressure_flat", frames(mark("flags", int(wire.FrameFlags.PDC_FLAT))), "finger 1: static pressure did not follow"),
    ("channel_missing", frames(mark("counts", wire.INVALID_COUNT, 0)), "finger 1: E1"),
    ("channel_missing", frames(mark("tdc", wire.INVALID_COUNT)), "finger 1: TDC"),
]


def test_half_a_second_of_mirror_images_is_no_short() -> None:
    """E4 and E14 as a press on the midline begins: a quarter of a second and one mean cannot tell them apart."""

    def mirrored(rows: np.ndarray) -> None:
        shorted(rows)
        rows["counts"][:, 1] -= 8 * np.arange(len(rows)).astype(np.uint16)
        rows["counts"][:, 8] = rows["counts"][:, 1] + 6

    facts = frames(mirrored)
    assert facts.board is not None
    rows = facts.board.frames
    few = rows[rows["t_us"] < rows["t_us"].min() + 500_000]
    assert {f.code for f in diagnose(facts)} == {"electrodes_shorted"}  # of so many that it is one
    assert diagnose(dataclasses.replace(facts, board=dataclasses.replace(facts.board, frames=few))) == []


@pytest.mark.parametrize("change", [lifted(999, 300), lifted(1095, 24)])
def test_skin_that_bulges_is_not_inverted(change: Callable[[np.ndarray], None]) -> None:
    assert diagnose(frames(change)) == []


def test_pressure_of_a_healthy_finger_is_no_finding() -> None:
    assert not [f for f in diagnose(pressed(100)) if f.code == "pressure_flat"]


def test_a_press_that_the_default_map_reads_too_large_is_not_flat() -> None:
    with biotac.open("sim:press.toml") as hand:
        rows = hand.read(seconds=6.5)
    side = rows[rows["t_us"] > 4_000_000]  # the scenario's press of 4 N at E13
    assert not [f for f in diagnose(board(frames=side)) if f.code == "pressure_flat"]


@pytest.mark.parametrize(("code", "facts", "words"), CASES, ids=[f"{c[0]}-{k}" for k, c in enumerate(CASES)])
def test_one_fault_makes_one_finding(code: str, facts: Facts, words: str) -> None:
    found = diagnose(facts)
    assert {f.code for f in found} == {code}
    assert words in found[0].seen


@pytest.mark.parametrize("version", ["1.12.3", "1.12.3.dev4", "1.12.3rc1", "1.12.3+g0a1"])
def test_a_development_version_is_not_newer_than_its_release(version: str) -> None:
    assert release(version) == (1, 12, 3)


def test_every_code_has_a_case_and_every_section_of_the_page_is_read() -> None:
    files = [*Path(__file__).parent.glob("test_*.py"), ROOT / "tests/rig/test_leads.py"]
    cases = "".join(path.read_text() for path in files)
    assert set(re.findall(r'\(\s*"(\w+)",', cases)) >= set(CATALOGUE)
    page = (ROOT / "host/docs/reference/doctor.md").read_text()
    assert re.findall("^## (.+)$", page, re.MULTILINE) == list(CATALOGUE)
    assert all(entry.meaning in page and entry.cure in page for entry in CATALOGUE.values())


def test_what_is_healthy_is_left_alone() -> None:
    assert diagnose(board()) == []
    # 180 ppm, but not sure: a short look says nothing of the crystal.
    assert diagnose(board(clock=Fit(0.0, 1.0, 0.001, -180.0, 100.0))) == []
    assert diagnose(board(clock=Fit(0.0))) == []
    assert diagnose(board(clock=None, clock_resets=9)) == []  # a simulated board's time is no clock
    assert diagnose(Facts(PORT, SystemFacts(modem_manager=True, left_alone=True), board=healthy())) == []
    # Single bad words do not make a channel missing, nor single rails an electrode dead.
    few = rounds()
    few["counts"][:20, 3] = wire.INVALID_COUNT
    few["counts"][20:40, 3] = 4095
    # A finger that was away and has proved to be the same one is told by lost words.
    few["flags"][40:60] = wire.FrameFlags.SENSOR_UNSURE
    assert diagnose(board(frames=few)) == []


def test_an_error_word_is_explained() -> None:
    facts = grown(0, words_error=1).board
    assert facts is not None
    facts.sensors_after[0] = dataclasses.replace(facts.sensors_after[0], last_error_word=0xA52D)
    assert "0xA52D (read less than 50 us after the sample command)" in diagnose(Facts(PORT, board=facts))[0].seen


# ---- simulated boards with faults ----------------------------------------------------------------

SCENE = 'name = "scene"\nseed = 5\nfingers = {fingers}\n[[step]]\ndo = "rest"\nseconds = 4.0\n'
FAULT = '[[fault]]\nat_s = {at_s}\nseconds = {seconds}\nfinger = 1\nkind = "{kind}"\n{more}\n'


def run_doctor(capsys, tmp_path: Path, text: str, *words: str) -> tuple[int, dict[str, Any]]:
    path = tmp_path / "scene.toml"
    path.write_text(text)
    code = main(["doctor", f"sim:{path}?pace=fast", "--seconds", "3", "--json", *words])
    return code, json.loads(capsys.readouterr().out)


def test_a_healthy_board_exits_0(capsys, tmp_path: Path) -> None:
    code, out = run_doctor(capsys, tmp_path, SCENE.format(fingers=3), "--fingers", "3")
    assert (code, out["findings"]) == (0, [])
    assert out["measured"]["fingers"] == [0, 1, 2]
    assert out["measured"]["slots_per_s"] == {"0": 4400.0, "1": 4400.0, "2": 4400.0}


@pytest.mark.parametrize(
    ("kind", "code"), [("stuck_high", "words_stuck"), ("bad_parity", "words_parity"), ("error_word", "words_error")]
)
def test_a_fault_on_the_bus_is_found_on_its_finger_only(capsys, tmp_path: Path, kind: str, code: str) -> None:
    fault = FAULT.format(at_s=1.5, seconds=0.3, kind=kind, more="")
    exit_code, out = run_doctor(capsys, tmp_path, SCENE.format(fingers=3) + fault)
    assert exit_code == 1
    assert [f["code"] for f in out["findings"]] == [code]
    # In every 11th of these 30 rounds the sensor is asked for its serial (talk/sensors.c): an answer is no sample.
    assert out["findings"][0]["seen"].startswith(f"finger 1: {(30 - 3) * 44} of ")


@pytest.mark.parametrize(
    ("kind", "seconds", "codes"),
    [
        ("unplugged", 0.3, ["words_stuck"]),  # the same one, which has said so
        ("swapped", 0.3, ["sensor_other", "words_stuck"]),
        ("stuck_low", 1.485, ["sensor_unsure", "words_stuck"]),  # back for the last two rounds that are listened to
    ],
)
def test_a_sensor_that_was_away_is_told_with_who_it_is(
    capsys, tmp_path: Path, kind: str, seconds: float, codes: list[str]
) -> None:
    fault = FAULT.format(at_s=1.5, seconds=seconds, kind=kind, more="")
    exit_code, out = run_doctor(capsys, tmp_path, SCENE.format(fingers=3) + fault)
    assert exit_code == 1
    assert [f["code"] for f in out["findings"]] == codes
    assert all(f["seen"].startswith("finger 1") for f in out["findings"])


def test_a_sensor_that_stays_away_is_lost(capsys, tmp_path: Path) -> None:
    fault = FAULT.format(at_s=1.5, seconds=2.5, kind="unplugged", more="")
    _, out = run_doctor(capsys, tmp_path, SCENE.format(fingers=3) + fault)
    assert {"sensor_lost", "words_stuck"} <= {f["code"] for f in out["findings"]}


def test_a_model_without_a_channel_is_told(capsys, tmp_path: Path) -> None:
    fault = FAULT.format(at_s=0, seconds=4.0, kind="no_channel", more='channel = "TDC"')
    _, out = run_doctor(capsys, tmp_path, SCENE.format(fingers=2) + fault)
    assert [f["code"] for f in out["findings"]] == ["words_error", "channel_missing"]
    assert out["findings"][1]["seen"] == "finger 1: TDC"


def test_a_sensor_that_is_not_there_is_missed_when_it_is_expected(capsys, tmp_path: Path) -> None:
    code, out = run_doctor(capsys, tmp_path, SCENE.format(fingers=2), "--fingers", "5")
    assert code == 1
    assert [f["code"] for f in out["findings"]] == ["sensor_missing"]


def test_a_port_that_is_not_there_and_a_stranger_on_one(capsys, scripted_board, time_passes) -> None:
    assert main(["doctor", "/dev/ttyNOWHERE7"]) == 1
    assert capsys.readouterr().out.startswith("error port_failed: no port /dev/ttyNOWHERE7")
    stranger = scripted_board(lambda i, p: b"OK\r\n" + time_passes())
    assert main(["doctor", stranger.path]) == 1
    assert "error not_a_gateway" in capsys.readouterr().out


@pytest.mark.parametrize(
    "port",
    ["sim:nothere.toml", "replay:nothere.mcap", "bag:nothere.bag", "csv:no.csv?columns=no.toml", "bag:other.bag"],
)
def test_what_cannot_be_played_is_not_healthy_but_told_as_stream_does(port: str, capsys, tmp_path, monkeypatch) -> None:
    monkeypatch.chdir(tmp_path)
    with Writer("other.bag") as bag:  # a bag with a single topic, which is no BioTac's
        store = get_typestore(Stores.ROS1_NOETIC)
        topic = bag.add_connection("/other", "std_msgs/msg/Empty", typestore=store)
        bag.write(topic, 0, store.serialize_ros1(store.types["std_msgs/msg/Empty"](), "std_msgs/msg/Empty"))
    assert main(["stream", port]) != 0
    words = capsys.readouterr().err.removeprefix("biotac: ").strip()
    assert main(["doctor", port, "--json"]) != 0
    out = json.loads(capsys.readouterr().out)
    assert [(f["code"], f["seen"]) for f in out["findings"]] == [("port_failed", words)]


def test_a_good_recording_is_no_board_and_refuses_nothing(tmp_path: Path, capsys) -> None:
    with biotac.open("sim:press.toml?fingers=2") as hand, hand.record(tmp_path / "good.mcap"):
        hand.read(0.5)
    assert main(["doctor", f"replay:{tmp_path / 'good.mcap'}", "--json"]) == 1
    (finding,) = json.loads(capsys.readouterr().out)["findings"]
    assert finding["code"] == "port_failed"
    assert "`biotac check" in finding["seen"]


def test_without_permission_the_rule_is_printed(capsys, monkeypatch) -> None:
    monkeypatch.setattr(list_ports, "comports", lambda: [usb_port("/dev/null")])  # is there, and no port
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    assert main(["doctor"]) == 1
    assert udev.rule().splitlines()[2] in capsys.readouterr().out


def test_the_doctor_leaves_the_stream_stopped() -> None:
    from biotac.doctor.listening import listen

    with biotac.open("sim:press.toml") as hand:
        listen(hand, 0.5)
        assert hand.status().streams == 0


def test_a_program_on_a_pty_is_not_blamed_for_its_clock(tmp_path: Path, capsys) -> None:
    words = [sys.executable, "-m", "biotac", "sim", "press.toml", "--json"]
    process = subprocess.Popen(words, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    try:
        port = json.loads(process.stdout.readline())["port"]
        assert main(["doctor", port, "--seconds", "1.5", "--json"]) in (0, 1)
        found = {f["code"] for f in json.loads(capsys.readouterr().out)["findings"]}
        assert not found & {"clock_jumped", "clock_drift"}
    finally:
        process.terminate()
        process.wait()
        process.stdout.close()


def test_a_report_is_one_file_with_findings_and_what_they_were_judged_by(tmp_path, capsys) -> None:
    place = tmp_path / "report.json"
    assert main(["doctor", "sim:press.toml?fingers=2&seconds=2&pace=0", "--seconds", "1", "--report", str(place)]) == 0
    answer = json.loads(place.read_text())
    assert answer["findings"] == []
    assert answer["library"] == __version__
    assert answer["board"]["hello"]["fingers_present"] == 0b11
    assert len(answer["board"]["sensors_after"]) == 5
    assert answer["sensor_board"] is None
