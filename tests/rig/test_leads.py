"""Two wired boards under the doctor: which lead is wrong."""

import dataclasses

import pytest
from doctor_facts import RELEASE, board, healthy, hello, info, message, rounds

from biotac import FrameFlags
from biotac.doctor import Facts, diagnose
from biotac.wire import messages_gen as wire
from biotac_rig import emu_gen as emu
from biotac_rig import leads


def pair(words: int, *, error: int = 0, good: tuple[int, ...] = (), serials: tuple[str, ...] = ()) -> Facts:
    """A sensor board that heard so many words; the gateway has good ones of some fingers, and error words."""
    facts = healthy()
    after = [
        dataclasses.replace(before, words_good=100 * (before.finger in good), words_error=error)
        for before in facts.sensors_before
    ]
    rows = rounds(good) if good else rounds()[:0]
    changed = {"sensors_after": after, "frames": rows, "hello": hello(*RELEASE, fingers_present=0)}
    status = [message(emu.EmuStatus, words=count) for count in (2**32 - 1, words - 1)]
    sensors = [info(finger, f"BTEMU{k}") for k, finger in enumerate(good)]
    return leads.paired(board(sensors=sensors, **changed), leads.PairFacts(*status, serials))


ALL = tuple(range(5))

LEADS: list[tuple[Facts, list[tuple[str, str]]]] = [
    (pair(500, good=ALL, serials=tuple(f"BTEMU{k}" for k in ALL)), []),
    (pair(0), [("lead_clock", "saw no clock")]),
    (pair(500, error=9), [("lead_mosi", "understood no command")]),
    (pair(500), [("lead_miso", "500 words, but none reached")]),
    (pair(500, good=(0, 1, 3, 4)), [("lead_select", "finger 2 gives few good words or none, unlike fingers 0, 1")]),
    (
        pair(500, good=(1, 0, 2, 3, 4), serials=tuple(f"BTEMU{k}" for k in ALL)),
        [("lead_crossed", "finger 1 ends at the sensor of finger 0"), ("lead_crossed", "finger 0 ends at")],
    ),
]


def test_of_a_pair_a_finger_that_was_silent_before_it_had_a_tape_is_no_finding() -> None:
    silent = dataclasses.replace(healthy().before, finger_faults=(int(FrameFlags.SENSOR_UNSURE),) * 5)

    def codes(facts: Facts) -> set[str]:
        return {finding.code for finding in diagnose(facts)}

    alone = board(before=silent)
    assert "faults_latched" in codes(alone)
    status = message(emu.EmuStatus)
    assert "faults_latched" not in codes(dataclasses.replace(alone, pair=leads.PairFacts(status, status, ())))
    worn = board(before=dataclasses.replace(silent, faults=int(wire.FaultFlags.STORAGE)))
    assert "faults_latched" in codes(dataclasses.replace(worn, pair=leads.PairFacts(status, status, ())))


@pytest.mark.parametrize(("facts", "expected"), LEADS)
def test_the_lead_that_is_wrong_is_told_by_what_either_end_heard(facts: Facts, expected: list[tuple[str, str]]) -> None:
    found = facts.leads
    assert [finding.code for finding in found] == [code for code, _ in expected]
    for finding, (_, words) in zip(found, expected, strict=True):
        assert words in finding.seen
