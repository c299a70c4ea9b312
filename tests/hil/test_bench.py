"""Two boards known only by their serial ports, as a user's are: the suite and `biotac doctor` by command line.

The boards are emulated Picos (biotac-two-boards): the ports are all that the suite needs.
"""

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from bench import MID_COUNT, OTHERS_ROUNDS, SETTLED_ROUNDS, staged
from biotac.cli.main import main
from biotac.sim.fault_gen import EmuFault
from biotac.sim.loading import load_source
from rig import ROOT, all_rigs, require

Ports = tuple[str, str]
SUITE = [
    "test_bus_faults.py::test_a_single_bad_channel_is_marked_missing_and_never_stale",
    "test_calibration.py::test_another_sensors_is_refused_and_any_sensors_is_not",
    "test_link.py::test_every_slot_of_one_to_five_fingers_is_sampled_and_nothing_lost",
    "test_link.py::test_recorded_counts_give_the_same_results_as_the_simulated_board",
    "test_saving.py",
]
# Leads that all sensors share are test_two_picos.py's: without frames a slow board is waited for, for minutes.
LEADS = {(): (), ("SS2 to nothing",): ("lead_select",), ("SS2 to SS3", "SS3 to SS2"): ("lead_crossed", "lead_crossed")}


@pytest.fixture
def boards() -> Iterator[Callable[..., Ports]]:
    require(all_rigs()["two_picos"])
    running: list[subprocess.Popen[str]] = []

    def start(*leads: str) -> Ports:
        command = [sys.executable, "-m", "biotac_rig.two_picos", *leads]
        running.append(subprocess.Popen(command, stdout=subprocess.PIPE, text=True))
        assert running[-1].stdout is not None
        _, port, _, sensor_port = running[-1].stdout.readline().split()
        return port, sensor_port

    yield start
    for process in running:
        process.terminate()
        process.communicate()


@pytest.mark.nightly
def test_the_suite_runs_on_two_boards_of_which_only_the_ports_are_known(boards: Callable[..., Ports]) -> None:
    port, sensor_port = boards()
    command = ["--rig", "bench", "--port", port, "--sensor-port", sensor_port]
    tests = [str(Path(__file__).with_name(name)) for name in SUITE]
    done = subprocess.run([sys.executable, "-m", "pytest", *tests, *command], capture_output=True, text=True, cwd=ROOT)
    assert done.returncode == 0, done.stdout
    print(done.stdout)


@pytest.mark.nightly
@pytest.mark.parametrize("leads", LEADS, ids=lambda leads: ", ".join(leads) or "right")
def test_the_doctor_names_the_lead(boards: Callable[..., Ports], capsys, leads: tuple[str, ...]) -> None:
    port, sensor_port = boards(*leads)
    # In this process, with the patience of all tests: emulated boards are slow.
    code = main(["doctor", port, "--sensor-port", sensor_port, "--seconds", "0.5", "--json"])
    found = json.loads(capsys.readouterr().out)["findings"]
    assert tuple(finding["code"] for finding in found if finding["code"].startswith("lead_")) == LEADS[leads], found
    assert bool(found) == bool(code) == bool(leads), found


def test_a_source_is_staged_behind_samples_and_a_change_of_sensors() -> None:
    source = load_source("press.toml", fingers=2, seconds=0.1)
    on_bench = staged(source)
    before = SETTLED_ROUNDS + OTHERS_ROUNDS
    assert (on_bench.samples[:SETTLED_ROUNDS] == MID_COUNT).all()
    assert (on_bench.samples[SETTLED_ROUNDS] == EmuFault.SWAPPED).all()
    assert (on_bench.samples[before:, :2] == source.samples).all()
    assert (on_bench.samples[before:, 2:] == EmuFault.UNPLUGGED).all()
    assert len({*on_bench.serials, *staged(source).serials}) == 10  # no sensor is known from before
    assert all(len(serial) == 16 for serial in on_bench.serials)
