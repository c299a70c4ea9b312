"""`biotac doctor --bringup` on the emulated Pico: no finding without a fault, and each defect by name."""

from pathlib import Path

import pytest

import biotac
from biotac.doctor import bringup, bringup_report, diagnose
from biotac.doctor.bringup import Bringup
from biotac.doctor.listening import examine

FINGERS = 3
# A defect by the emulator's verbs: the code of the finding, and words in it.
DEFECTS = {
    "chip revision 1": ("chip_old", "chip id 0x10002927"),
    "lead SS2 to nothing": ("sensor_missing", "2 of 3 sensors answer: finger 0, 1"),
    "lead SS0 to SS1;lead SS1 to SS0": ("lead_crossed", "the select of finger 0 ends at the sensor of finger 1"),
    "late bits above 5 MHz": ("bus_margin", "finger 0 is clean up to 4.81 MHz"),
    "flash chip c84015": ("flash_unknown", "flash: c84015"),
    "erase in 600 ms": ("flash_slow", "erase of a sector: 60"),
    "supply at 3900 mV": ("supply", "mV; expected 4100 to 5500 mV"),
    "clock 1.005 times as fast": ("clock_off", "clock against USB: "),
    "finger 1 feels 0.02 of PDC": ("pressure_flat", "counts/N, up to "),
    "finger 1 feels 0 of E7": ("channel_stuck", "finger 1: E7"),
    "lose a start of frame in 5": ("usb_frames", "lost starts of frame"),
}

# The emulated board's time goes on while this program computes, however long that takes: whenever it listens, one press
# at least is whole within PRESS_S. Off the midline, where no two electrodes are mirror images; and by rounds too short
# for `biotac doctor` to report the press, a finding that would come first.
PRESS_S = 3.0
PRESSES = """
name = "presses"
step = [
    {do = "rest", seconds = 1.5},
    {do = "press", seconds = 0.2, at = "E13", force_n = 3.0},
    {do = "hold", seconds = 0.2},
    {do = "press", seconds = 0.2, force_n = 0.0},
]
"""

#: bring_up.md's
ORDER = ["words at 1 MHz", "at 0.99 MHz", "serial numbers", "usual rate", "press each", "faster rates", "restart 1 "]

pytestmark = pytest.mark.usefixtures("emulated_pico")


@pytest.fixture
def few(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bringup, "PINGS", 50)  # an emulated Pico takes minutes for a thousand
    monkeypatch.setattr(bringup, "RESTARTS", 1)  # and as long for ten of these


def report(verbs: str, folder: Path) -> tuple[dict[str, str], str]:
    """Findings by code, the first of each, and the page."""
    seen, steps = Bringup(), []
    (folder / "presses.toml").write_text(PRESSES)
    facts = examine(
        f"emu:pico?source={folder}/presses.toml&fingers={FINGERS}&seconds=300&pace=fast"
        + (f"&do={verbs}" if verbs else ""),
        expected_fingers=FINGERS,
        by=lambda hand: bringup.measure(hand, seen, steps.append, seconds=1.0, press_s=PRESS_S),
    )
    findings = [*bringup.check(seen, facts), *diagnose(facts)]
    bringup_report.write(folder / "bringup.md", seen, facts, findings)
    assert len(seen.restarts) == bringup.RESTARTS, (facts.error, steps)
    assert [part for step in steps for part in ORDER if part in step] == ORDER, steps
    return {finding.code: finding.seen for finding in reversed(findings)}, (folder / "bringup.md").read_text()


@pytest.mark.nightly  # by day tests/host/doctor/test_bringup.py, on the simulated board
@pytest.mark.usefixtures("few")
def test_a_board_without_a_defect_has_a_report_without_findings(tmp_path: Path) -> None:
    found, page = report("", tmp_path)
    assert found == {}
    for words in (
        "0x20002927",
        "ef4015 W25Q16JV",
        "| erase of a sector | 4",
        "BTSIM00000000101",
        "Only silicon can tell",
    ):
        assert words in page
    assert (tmp_path / "bringup.png").stat().st_size > 10_000


@pytest.mark.nightly
@pytest.mark.parametrize("verbs", DEFECTS)
def test_a_defect_is_named_and_nothing_else(tmp_path: Path, verbs: str) -> None:
    found, page = report(verbs, tmp_path)
    code, words = DEFECTS[verbs]
    assert words in found.pop(code) and not found
    assert "*Cure:*" in page


@pytest.mark.nightly
def test_an_issi_flash_gives_the_half_of_its_number_that_is_its_own() -> None:
    serials = set()
    for verb in ("", "&do=flash chip 9d6015"):
        with biotac.open(f"emu:pico?source=press.toml&pace=fast{verb}") as hand:
            serials.add(bytes(hand.info.board_serial[:8]))
    assert len(serials) == 1
