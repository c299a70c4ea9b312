"""The gateway's image reads the sensors of a second Pico over a bus of edges: the tape's counts come, in time."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest

import biotac
from biotac.doctor import Facts
from biotac.doctor.listening import listen
from biotac.hand.opening import shake_hands
from biotac.sim.fault_gen import EmuFault
from biotac.sim.loading import load_source
from biotac_rig.leads import PairFacts, check
from biotac_rig.two_picos import TwoPicos
from rig import all_rigs, require

RIG = "two_picos"
SECONDS = 60.0

Open = Callable[[float], tuple[biotac.Hand, TwoPicos]]


@pytest.fixture
def opened(request: pytest.FixtureRequest) -> Iterator[Open]:
    if RIG not in (request.config.getoption("--rig") or [RIG]):
        pytest.skip(f"--rig names others than {RIG}")
    require(all_rigs()[RIG])
    hands = []

    def open_pair(seconds: float) -> tuple[biotac.Hand, TwoPicos]:
        board = TwoPicos(load_source("press.toml", fingers=5, seconds=seconds), pace=0.0, hold=True)
        hands.append(shake_hands(board.link("two_picos")))
        return hands[-1], board

    yield open_pair
    for hand in hands:
        hand.close()


def on_sim(seconds: float) -> biotac.Batch:
    with biotac.open(f"sim:press.toml?fingers=5&seconds={seconds}") as hand:
        return hand.read_batch(seconds + 1)


def assert_same(rows: np.ndarray, others: np.ndarray) -> None:
    """Equal in all fields but time: boards do not start at the same microsecond."""
    assert len(rows) == len(others) > 0
    for field in set(rows.dtype.names or ()) - {"t_us"}:
        assert rows[field].tobytes() == others[field].tobytes(), field


@pytest.mark.nightly  # by day tests/emulator/test_other_driver.py reads the same image of a sensor board
def test_every_word_of_five_sensors_is_right_and_in_time(opened: Open) -> None:
    hand, board = opened(SECONDS)
    batch = hand.read_batch(SECONDS + 1)
    expected = on_sim(SECONDS)
    assert_same(batch.wire, expected.wire)
    assert_same(batch.pac, expected.pac)
    for finger in hand.fingers:
        sensor = hand.sensor_status(finger)
        assert sensor.words_parity == sensor.words_stuck == sensor.words_error == 0
    assert board.sensor_board is not None
    status = board.sensor_board.status()
    assert status.words_late == status.samples_starved == 0
    assert status.slots_served == status.slots_taken == round(SECONDS * 4400)
    assert status.words >= 5 * status.slots_served  # and those that asked for serials
    leads = board.counters()["sensors"]
    assert leads["late_edges"] == 0  # the two boards were never out of step
    assert leads["answer_ns"] < leads["answer_left_ns"]
    print(f"answers {leads['answer_ns']:.0f} of {leads['answer_left_ns']:.0f} ns, staged in {status.slowest_us} us")


FAULTS = {
    EmuFault.BAD_PARITY: "words_parity",
    EmuFault.STUCK_LOW: "words_stuck",
    EmuFault.STUCK_HIGH: "words_stuck",
    EmuFault.TOO_EARLY: "words_error",
    EmuFault.NO_CHANNEL: "words_error",
    EmuFault.UNPLUGGED: "words_stuck",
    EmuFault.SWAPPED: "words_stuck",
}


@pytest.mark.nightly
def test_faults_by_command_are_seen_on_their_finger_and_on_no_other(opened: Open) -> None:
    hand, board = opened(4.0)
    assert board.sensor_board is not None
    for fault, counter in FAULTS.items():
        before = [hand.sensor_status(finger) for finger in hand.fingers]
        board.sensor_board.fault(1, fault)
        hand.read_batch(0.2)
        board.sensor_board.fault(1, EmuFault.NONE)
        hand.read_batch(0.3)  # the sensor is asked for its serial
        after = [hand.sensor_status(finger) for finger in hand.fingers]
        assert getattr(after[1], counter) > getattr(before[1], counter), fault.name
        for finger in (0, 2, 3, 4):
            for name in ("words_parity", "words_stuck", "words_error"):
                assert getattr(after[finger], name) == 0, (fault.name, finger, name)
    assert board.sensor_board.status().words_late == 0


def test_every_fault_is_commanded() -> None:
    assert set(FAULTS) == set(EmuFault) - {EmuFault.NONE}


LEADS = {
    "SCK to nothing": ("lead_clock", ""),
    "MOSI to nothing": ("lead_mosi", ""),
    "MISO to nothing": ("lead_miso", ""),
    "MISO to MOSI": ("lead_miso", ""),
    "SS2 to nothing": ("lead_select", "finger 2 "),
}


@pytest.mark.nightly
@pytest.mark.parametrize("lead", LEADS)
def test_the_doctor_names_the_lead_that_is_wrong(opened: Open, lead: str) -> None:
    code, text = LEADS[lead]
    hand, board = opened(1.0)
    pair = board.sensor_board
    assert pair is not None
    board_facts = listen(hand, 0.1)
    board.do(f"lead {lead}")
    if lead == "MISO to MOSI":
        board.do("lead MOSI to MISO")
    states, before = [hand.sensor_status(finger) for finger in range(5)], pair.status()
    hand.read_batch(0.3)  # where no sensor is left, to the tape's end
    after = [hand.sensor_status(finger) for finger in range(5)]
    board_facts = replace(board_facts, sensors_before=states, sensors_after=after)
    heard = PairFacts(before, pair.status(), pair.serials)
    found = list(check(Facts(hand.port, board=board_facts), heard))
    assert [finding.code for finding in found] == [code], found
    assert text in found[0].seen


def test_places_on_the_tape_are_told_apart() -> None:
    """The ground of the comparison: this scenario's rows differ, so that a slot too early or too late is seen."""
    samples = load_source("press.toml", fingers=5, seconds=1.0).samples
    assert all((one != next_one).any() for one, next_one in pairwise(samples))
