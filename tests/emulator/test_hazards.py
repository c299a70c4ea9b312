"""Hazards of the chip from data sheets, errata and field reports, played to the image.

Each test is a row of the board's page, which `python tests/emulator/test_hazards.py` writes. With --image FILE pytest
plays them to another image. By day one of each kind, at night all.
"""

import inspect
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

import biotac
from biotac import FaultFlags
from biotac.doctor import bringup
from biotac.wire import messages_gen as wire

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "firmware/boards/pico/README.md"
BEGIN, END = "<!-- hazards -->\n", "<!-- end of hazards -->\n"
SOURCES: dict[str, str] = {}
Test = Callable[..., None]


def known_from(source: str, *, by_day: bool = False) -> Callable[[Test], Test]:
    def note(test: Test) -> Test:
        SOURCES[test.__name__] = source
        return test if by_day else pytest.mark.nightly(test)

    return note


class Board:
    """The image, emulated, as fast as it goes."""

    def __init__(self, image: str | None) -> None:
        self.image = f"&image={image}" if image else ""
        self.hands: list[biotac.Hand] = []

    def open(self, *verbs: str, fingers: int = 1) -> tuple[biotac.Hand, Any]:
        """A hand with an emulated board."""
        do = f"&do={';'.join(verbs)}" if verbs else ""
        hand = biotac.open(f"emu:pico?source=press.toml&fingers={fingers}&seconds=60&pace=fast{self.image}{do}")
        self.hands.append(hand)
        return hand, hand.link.board  # type: ignore[attr-defined]


@pytest.fixture
def board(request: pytest.FixtureRequest) -> Iterator[Board]:
    image = request.config.getoption("--image")
    if image is None:
        request.getfixturevalue("emulated_pico")
    made = Board(image)
    yield made
    for hand in made.hands:
        hand.close()


def streams_on(hand: biotac.Hand, board: Any, *verbs: str) -> dict[str, Any]:
    """The verbs, a tenth of a second apart, do not end or dent a stream; returns the emulator's counters then."""
    hand.stream()
    hand.read(0.2)
    resets = board.counters()["usb"]["resets"]
    for verb in verbs:
        board.do(verb)
        hand.read(0.1)
    hand.read(0.5)
    hand.stop()
    seen: dict[str, Any] = board.counters()
    assert (seen["boots"], seen["usb"]["resets"], hand.stats.frames_lost) == (1, resets, 0)
    return seen


def comes_back(hand: biotac.Hand, board: Any, verb: str, within_s: float = 0.3) -> dict[str, Any]:
    """The verb hangs the controller: within this time the host has found the board again, and no trace is left."""
    hand.link.release()  # type: ignore[attr-defined]
    before = board.counters()["usb"]
    board.do(verb)
    if "control" in verb:
        board.send_line("open and close 1 times")
    else:
        hand.board.send(wire.Ping(req_id=1))
    wanted = {"hangs": before["hangs"] + 1, "resets": before["resets"] + 1, "state": "configured"}
    seen = board.until(within_s, usb=wanted)
    assert seen["boots"] == 1 and seen["usb"]["failed"] == []
    hand.ping()
    return dict(seen)


# ---- USB ---------------------------------------------------------------------------------------------------------


@known_from("RP2040-E15; pico-sdk 1.5.0", by_day=True)
@pytest.mark.parametrize("saves", [30, pytest.param(150, marks=pytest.mark.nightly)])
def test_a_packet_armed_late_in_a_frame_hangs_the_controller(board: Board, saves: int) -> None:
    """none is armed in a frame's last 200 us, nor after a flash write that missed the frame's start"""
    hand, emulated = board.open("hang 1 of late armings", fingers=5)
    assert streams_on(hand, emulated)["usb"]["armed_late"] == 0
    for k in range(saves):  # each leaves the frame at another time
        hand.board.set_setting(biotac.Setting.STATUS_PERIOD_MS, 1000 + k)
        hand.board.save_settings()
    usb = emulated.counters()["usb"]
    assert usb["armed"] > 6 * saves and (usb["armed_late"], usb["hangs"]) == (0, 0)


@known_from("RP2040-E15", by_day=True)
@pytest.mark.parametrize(
    "verb", ["corrupt a bulk handshake", pytest.param("corrupt a control handshake", marks=pytest.mark.nightly)]
)
def test_a_corrupt_handshake_hangs_the_controller(board: Board, verb: str) -> None:
    """a controller that hears no frame for 100 ms is reset, and the host finds it again"""
    comes_back(*board.open(), verb)


@pytest.mark.nightly
def test_what_follows_a_release_meets_a_board_whose_time_runs(board: Board) -> None:
    """Otherwise the host's time-out goes by while the watchdog's clock stands still, and the board never comes back."""
    _, emulated = board.open()
    emulated.send_line("run\ncorrupt a control handshake\nopen and close 1 times")  # in one piece, as under load
    emulated.until(0.3, usb={"hangs": 1, "resets": 2, "state": "configured"})


@known_from("RP2040-E15; data sheet 4.1.4, SIE_STATUS")
def test_a_hung_controller_takes_the_bus_for_suspended(board: Board) -> None:
    """it is reset all the same, as the lines move"""
    comes_back(*board.open("hang as if asleep"), "corrupt a bulk handshake")


@known_from("data sheet 4.1.4, INTS; rp-hal #492")
def test_a_suspend_is_told_that_is_none(board: Board) -> None:
    """the stream goes on: only a bus without frames is suspended"""
    hand, emulated = board.open()
    streams_on(hand, emulated, *(f"tell of a suspend {how}" for how in ("late", "falsely", "late")))


@known_from("USB 2.0, 7.1.7.6; data sheet 4.1.4", by_day=True)
def test_the_bus_sleeps_and_wakes_while_the_flash_is_erased(board: Board) -> None:
    """the link is open afterwards"""
    hand, emulated = board.open("erase in 400 ms", "sleep for 200 ms while it erases")
    hand.board.save_settings()
    assert emulated.counters()["flash"]["erases"] == 1
    streams_on(hand, emulated)


@known_from("USB 2.0, 8.4.6.4; pico-feedback #385, tinyusb #2492", by_day=True)
@pytest.mark.parametrize(
    "verbs",
    [[], pytest.param(["answer setups with what is armed"], marks=pytest.mark.nightly)],
    ids=["held off", "not held off"],
)
def test_a_request_comes_before_the_one_before_is_answered(board: Board, verbs: list[str]) -> None:
    """only the second is answered; if the chip does not hold the host off, unless another interrupt runs"""
    _, emulated = board.open(*verbs)
    gaps_ns = [*range(100, 12_000, 100), *range(12_000, 60_000, 1000)]
    for gap_ns in gaps_ns:
        emulated.send_line(f"two setups {gap_ns}")
    usb = emulated.until(2, usb={"hurried": {"asked": len(gaps_ns)}})["usb"]
    assert usb["hurried"] == {"asked": len(gaps_ns), "wrong": 0}
    assert usb["failed"] == [] and usb["toggle_errors"] == usb["available_not_last"] == 0


@known_from("circuitpython #8824")
def test_a_port_is_opened_and_closed_a_thousand_times_in_a_row(board: Board) -> None:
    """no request fails, and the board answers the last host"""
    hand, emulated = board.open()
    hand.link.release()  # type: ignore[attr-defined]
    emulated.do("open and close 1000 times")
    with pytest.raises(biotac.DeviceLostError):  # it never comes to this: time goes by
        emulated.until(1, boots=-1)
    assert emulated.counters()["usb"]["failed"] == []
    hand.ping()


@known_from("USB 2.0, 7.1.5")
def test_a_host_without_power_is_at_the_other_end(board: Board) -> None:
    """where the board can sense VBUS, D+ is let go"""
    hand, emulated = board.open()
    hand.read(0.05)  # the board's time runs; the board waits in it until a plug bounces no more
    hand.stop()
    emulated.do("unplug")
    assert emulated.until(1, usb={"state": "detached"})["boots"] == 1
    emulated.do("plug")
    assert emulated.until(1, usb={"state": "configured"})["usb"]["driven_unpowered"] == 0


@known_from("USB 2.0, 9.6.3; Linux refuses more since 2.6.16")
def test_a_hub_without_a_supply_gives_100_ma(board: Board) -> None:
    """it asks for no more than the Pico draws; sensors have to be powered apart"""
    assert board.open("hub gives 100 mA")[1].counters()["usb"]["state"] == "configured"


# ---- the sensors' bus --------------------------------------------------------------------------------------------


@known_from("nobody has seen it: slot.c relies on the data sheet, 2.5", by_day=True)
def test_the_dma_is_late_with_a_word_of_every_slot(board: Board) -> None:
    """slots are counted as lost (SLOT_DMA_LATE), no finger as unplugged; after 44 the core clocks the bus"""
    hand, emulated = board.open(fingers=5)
    hand.stream()
    hand.read(0.1)
    emulated.do("pace the DMA 2 times as slowly")
    assert (hand.read(0.2)["counts"][-5:] != wire.INVALID_COUNT).all()
    hand.stop()
    faults = hand.board.faults()
    assert faults.board == FaultFlags.STARTED | FaultFlags.SLOT_DMA_LATE
    facts = hand.board.measure()
    assert facts.slots_dma_late == 44
    assert [m.code for m in bringup.measures(bringup.Bringup(chip=[facts])) if m.code] == ["dma_late"]
    assert hand.status().fingers_present == 0b11111
    assert not any(hand.sensor_status(finger).words_stuck for finger in hand.fingers)


# ---- boot and flash ----------------------------------------------------------------------------------------------


@known_from("data sheets of IS25LP and MX25: 35h")
def test_a_flash_chip_takes_35h_for_the_way_into_another_mode(board: Board) -> None:
    """boot reads by 03h and asks the chip nothing"""
    assert board.open()[1].counters()["flash"]["wrong"] == []


@known_from("flash read at the limit of the rate", by_day=True)
def test_the_image_is_misread_as_it_is_copied(board: Board) -> None:
    """the copy's CRC-32 is checked before it runs; the board starts again and tells EARLY_FAULT"""
    begun_anew(board, "misread the image in 5 starts")


@known_from("data sheet 2.8.1")
def test_an_exception_comes_before_the_program_is_in_sram(board: Board) -> None:
    """the board starts again and tells EARLY_FAULT"""
    begun_anew(board, "fault before main in 5 starts")


def begun_anew(board: Board, verb: str) -> None:
    hand, emulated = board.open(verb)
    assert emulated.counters()["watchdog_resets"] == 5
    assert hand.board.clear_faults().board == FaultFlags.STARTED | FaultFlags.EARLY_FAULT


@known_from("W25Q16JV 0.4 s; other chips 1 s")
def test_the_flash_takes_a_second_to_erase(board: Board) -> None:
    """the watchdog, which runs from boot2 on, waits for two"""
    hand, emulated = board.open("erase in 1000 ms")
    hand.read(0.1)  # until then time stands still, and the watchdog with it
    hand.stop()
    hand.board.save_settings()
    seen = emulated.counters()
    assert (seen["flash"]["erases"], seen["watchdog_resets"]) == (1, 0)


# ---- the board's page ----------------------------------------------------------------------------------------------


def rows() -> str:
    """A row for each test of this file that plays a hazard."""
    lines = ["| Hazard | Known from | Reaction of the image |", "|---|---|---|"]
    for name, source in SOURCES.items():
        hazard, does = name.removeprefix("test_").replace("_", " "), inspect.getdoc(globals()[name])
        lines.append(f"| {hazard.replace('crc', 'CRC').replace('sram', 'SRAM')} | {source} | {does} |")
    return "\n".join(lines) + "\n"


def test_the_boards_page_lists_them_all() -> None:
    listed = PAGE.read_text().partition(BEGIN)[2].partition(END)[0]
    assert listed == rows(), "run python tests/emulator/test_hazards.py"


if __name__ == "__main__":
    PAGE.write_text(re.sub(f"{BEGIN}.*{END}", lambda _: BEGIN + rows() + END, PAGE.read_text(), flags=re.DOTALL))
