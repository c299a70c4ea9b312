"""The doctor's first evening with new boards: a wrong lead is named by the numbers of the new board itself."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from doctor_facts import board, message, rounds

from biotac import FrameFlags
from biotac.cli.main import main
from biotac.doctor import Finding, bringup
from biotac.doctor.bringup import Bringup, Restart
from biotac.wire import messages_gen as wire
from biotac.wire import sensor_gen


def evening(change: Callable[[Bringup], object] = lambda seen: None) -> list[Finding]:
    """Findings of the first evening of a healthy board, with one change; the fingers are pressed in the second half."""
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
    """Two degrees by the product manual's formula, at 40 counts each."""
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


@pytest.mark.nightly
def test_a_scenario_that_ends_ends_the_evening(tmp_path: Path, capsys) -> None:
    words = ["doctor", "sim:press.toml?seconds=3", "--bringup", "--seconds", "1", "--report", str(tmp_path / "b.md")]
    assert main(words) in (0, 1)
    output = capsys.readouterr().err
    assert "restart 1" not in output and "bus_margin" not in output
    steps = [output.index(text) for text in ("words at 1 MHz", "finger 0: ", "serial numbers", "faster rates")]
    assert steps == sorted(steps)
