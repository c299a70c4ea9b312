"""The doctor's first evening with new boards: which lead is wrong, and what a new board's own numbers tell."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from doctor_facts import RELEASE, board, healthy, hello, info, message, rounds

from biotac import FrameFlags
from biotac.cli.main import main
from biotac.doctor import Facts, Finding, PairFacts, bringup, judge, leads
from biotac.doctor.bringup import Bringup, Restart
from biotac.wire import messages_gen as wire
from biotac.wire import sensor_gen


def pair(words: int, *, error: int = 0, good: tuple[int, ...] = (), serials: tuple[str, ...] = ()) -> Facts:
    """A sensor board that heard so many words; the gateway has good ones of some fingers, and error words."""
    facts = healthy()
    after = [
        dataclasses.replace(before, words_good=100 * (before.finger in good), words_error=error)
        for before in facts.sensors_before
    ]
    rows = rounds(good) if good else rounds()[:0]
    changed = {"sensors_after": after, "frames": rows, "hello": hello(*RELEASE, fingers_present=0)}
    status = [message(wire.EmuStatus, words=count) for count in (2**32 - 1, words - 1)]
    sensors = [info(finger, f"BTEMU{k}") for k, finger in enumerate(good)]
    return dataclasses.replace(board(sensors=sensors, **changed), pair=PairFacts(*status, serials))


ALL = tuple(range(5))

LEADS: list[tuple[Facts, list[tuple[str, str]]]] = [
    (pair(500, good=ALL, serials=tuple(f"BTEMU{k}" for k in ALL)), []),
    (pair(0), [("lead_clock", "saw no clock")]),
    (pair(500, error=9), [("lead_mosi", "understood no command")]),
    (pair(500), [("lead_miso", "500 words, but none reached")]),
    (
        pair(500, good=(0, 1, 3, 4)),
        [("lead_select", "finger 2 gives few good words or none, unlike fingers 0, 1")],
    ),
    (
        pair(500, good=(1, 0, 2, 3, 4), serials=tuple(f"BTEMU{k}" for k in ALL)),
        [("lead_crossed", "finger 1 ends at the sensor of finger 0"), ("lead_crossed", "finger 0 ends at")],
    ),
]


def test_of_a_pair_a_finger_that_was_silent_before_it_had_a_tape_is_no_finding() -> None:
    silent = dataclasses.replace(healthy().before, finger_faults=(int(FrameFlags.SENSOR_UNSURE),) * 5)

    def codes(facts: Facts) -> set[str]:
        return {finding.code for finding in judge(facts)}

    alone = board(before=silent)
    assert "faults_latched" in codes(alone)
    status = message(wire.EmuStatus)
    assert "faults_latched" not in codes(dataclasses.replace(alone, pair=PairFacts(status, status, ())))
    worn = board(before=dataclasses.replace(silent, faults=int(wire.FaultFlags.STORAGE)))
    assert "faults_latched" in codes(dataclasses.replace(worn, pair=PairFacts(status, status, ())))


@pytest.mark.parametrize(("facts", "expected"), LEADS)
def test_the_lead_that_is_wrong_is_told_by_what_either_end_heard(facts: Facts, expected: list[tuple[str, str]]) -> None:
    found = list(leads.check(facts))
    assert [finding.code for finding in found] == [code for code, _ in expected]
    for finding, (_, words) in zip(found, expected, strict=True):
        assert words in finding.seen


def evening(change: Callable[[Bringup], object] = lambda seen: None) -> list[Finding]:
    """What the first evening of a healthy board finds, but for a change; its fingers are pressed in the second half."""
    answer = {"usb_frame": 0, "flash_id": (0xEF, 0x40, 0x15), "supply_mv": 4800, "erase_us": 45_000}
    first = message(wire.BoardFacts, **answer)
    last = dataclasses.replace(first, t_us=10_000_000, usb_frame=10_000 % 2048, usb_starts=10_000)
    rows = rounds()
    half = rows[len(rows) // 2 :]
    half["flags"], half["pdc"], rows["pdc_tare"] = FrameFlags.CONTACT, 2000 + 240, 2000
    half["force_n"] = [0.0, 0.0, 3.0]
    clean = np.array([[1000, 0]] * 2 + [[0, 1000]] * 3)
    restarts = [Restart(1.0, 0b11, int(wire.FaultFlags.STARTED))] * 2
    rates = {4464: clean, 8928: clean}
    seen = Bringup(chip=[first, last], idle=[first, last], rates=rates, restarts=restarts, frames=rows)
    change(seen)
    return list(bringup.check(seen, board()))


def chip(**values: Any) -> Callable[[Bringup], None]:
    return lambda seen: seen.chip.append(dataclasses.replace(seen.chip.pop(), **values))


def rows(name: str, values: Callable[[np.ndarray], Any]) -> Callable[[Bringup], None]:
    def change(seen: Bringup) -> None:
        seen.frames[name][1::2] = values(seen.frames[1::2])

    return change


EVENING: list[tuple[str, Callable[[Bringup], object], str]] = [
    ("flash_unknown", chip(flash_id=(0xC8, 0x40, 0x15)), "c84015"),
    ("dma_late", chip(slots_dma_late=3), "late DMA: 3; expected none"),
    ("early_fault", chip(early_faults=2), "failed: 2; expected none"),
    ("flash_slow", chip(erase_us=400_001), "400 ms"),
    ("supply", chip(supply_mv=4099), "4099 mV"),
    ("supply", chip(supply_mv=5501), "5501 mV"),
    ("clock_off", chip(t_us=10_007_000), "+700 ppm"),
    ("usb_frames", lambda seen: seen.idle.append(dataclasses.replace(seen.idle.pop(), usb_starts=9_997)), "3 of 10000"),
    ("slots_jitter", lambda seen: np.add.at(seen.frames["t_us"], [8], 6), "6 us"),
    (
        "bus_margin",
        lambda seen: seen.rates.update({5000: np.array([[1, 0], [1, 9], *[[0, 9]] * 3])}),
        "finger 1 is clean up to 4.46 MHz",
    ),
    (
        "bus_margin",
        lambda seen: seen.rates.update({992: seen.rates[4464], 4464: np.array([[0, 9], [9, 0], *[[0, 9]] * 3])}),
        "finger 0 is clean up to 0.99 MHz, of usually 4.46 MHz",
    ),
    ("not_pressed", rows("force_n", lambda own: 0.2), "finger 1"),
    ("pressure_flat", rows("pdc", lambda own: 2000 + np.where(own["flags"], 6, 0)), "2.0 counts/N"),
    ("pdc_warm", lambda seen: warm(seen.frames[1::2]), "finger 1: +40 counts a degree"),
    ("restart", lambda seen: seen.restarts.append(Restart(1.0, 0b01, int(wire.FaultFlags.STARTED))), "after restart 3"),
    ("restart", lambda seen: seen.restarts.append(Restart(1.0, 0b11, int(wire.FaultFlags.HUNG))), "HUNG"),
]


def warm(rows: np.ndarray) -> None:
    """By the product manual's formula two degrees, at 40 counts each."""
    celsius = np.linspace(25.0, 27.0, len(rows))
    share = sensor_gen.TDC_A / (np.exp(sensor_gen.TDC_BETA_K / (celsius + 273.15)) + sensor_gen.TDC_B)
    rows["tdc"] = np.round(4095 * share)
    rows["pdc"] = rows["pdc"] + np.round(40 * (celsius - 25.0))


@pytest.mark.parametrize(("code", "change", "words"), EVENING, ids=[f"{c[0]}-{k}" for k, c in enumerate(EVENING)])
def test_of_the_first_evening_one_defect_makes_one_finding(
    code: str, change: Callable[[Bringup], object], words: str
) -> None:
    assert evening() == []
    (found,) = evening(change)
    assert found.code == code and words in found.seen


def test_a_scenario_that_ends_ends_the_evening(tmp_path: Path, monkeypatch, capsys) -> None:
    monkeypatch.setattr(bringup, "PINGS", 50)
    monkeypatch.setattr("biotac.cli.boards.doctor.PLAYED_PRESS_S", 1.0)
    words = ["doctor", "sim:press.toml?seconds=3", "--bringup", "--seconds", "1", "--report", str(tmp_path / "b.md")]
    assert main(words) in (0, 1)
    output = capsys.readouterr().err
    assert "restart 1" not in output and "bus_margin" not in output
    steps = [output.index(text) for text in ("words at 1 MHz", "finger 0: ", "serial numbers", "faster rates")]
    assert steps == sorted(steps)
