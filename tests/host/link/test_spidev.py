"""Sensors on the computer's own SPI bus: the board's code over spidev, against the simulated board."""

import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from types import ModuleType

import fake_smbus
import fake_spidev
import numpy as np
import pytest
from capture import Capture

import biotac
from biotac.keep import eeprom
from biotac.keep.chip import Chip
from biotac.link import in_process
from biotac.link import spidev as spidev_link
from biotac.sim.loading import load_source
from biotac.wire import messages_gen as wire
from biotac.wire.batches import Batch

Board = Callable[..., tuple[biotac.Hand, "fake_spidev.Bus"]]
SECONDS = 2.0


@pytest.fixture
def board(monkeypatch, tmp_path: Path) -> Iterator[Board]:
    """Opens spidev ports on emulated sensors; time stands still until the bus's clock is told to run."""
    hands: list[biotac.Hand] = []

    def make(scenario: str, fingers: int, *, absent: frozenset[int] = frozenset()) -> tuple[biotac.Hand, object]:
        source = load_source(scenario, fingers=fingers, seconds=SECONDS)
        bus = fake_spidev.Bus(source, tmp_path, absent)
        bus.install(monkeypatch)
        hands.append(biotac.open("spidev:" + ",".join(f"0.{f}" for f in range(fingers))))
        hands[-1].link.pace = 0  # the bus's time runs ahead of the computer's, so nothing may be kept alive by that
        return hands[-1], bus

    yield make
    for hand in hands:
        hand.close()


def run(hand: biotac.Hand, bus: fake_spidev.Bus) -> Batch:
    hand.stream()
    bus.clock.run(SECONDS + 0.1)
    return hand.read_batch(SECONDS)


def simulated(scenario: str, fingers: int) -> Batch:
    with biotac.open(f"sim:{scenario}?fingers={fingers}&seconds={SECONDS}") as hand:
        return hand.read_batch(SECONDS)


def same(ours: np.ndarray, theirs: np.ndarray) -> None:
    """Every field bit for bit, except the time at which the board was switched on."""
    assert len(ours) == len(theirs) > 0
    for name in ours.dtype.names:
        a, b = ours[name], theirs[name]
        if name == "t_us":
            a, b = a - a[0], b - b[0]
        assert a.tobytes() == b.tobytes(), name


@pytest.mark.parametrize(("scenario", "fingers"), [("press.toml", 1), ("shear.toml", 3), ("faults.toml", 2)])
def test_the_wire_is_that_of_the_simulated_board(board: Board, scenario: str, fingers: int) -> None:
    hand, bus = board(scenario, fingers)
    ours, theirs = run(hand, bus), simulated(scenario, fingers)
    assert len(ours.wire) == 100 * SECONDS * fingers
    same(ours.wire, theirs.wire)
    same(ours.pac, theirs.pac)
    events = [[m for m in batch.messages if isinstance(m, wire.Tare)] for batch in (ours, theirs)]
    assert [(m.finger, m.seq, m.reason, m.tare_q16) for m in events[0]] == [
        (m.finger, m.seq, m.reason, m.tare_q16) for m in events[1]
    ]
    assert events[0]
    assert hand.stats.frames_lost == 0
    status = hand.status()
    assert (status.slots_late, status.messages_dropped) == (0, 0)


def test_it_says_who_it_is_and_who_the_sensors_are(board: Board) -> None:
    hand, _ = board("press.toml", 2)
    assert hand.info.board == wire.BoardKind.LINUX_SBC
    assert bytes(hand.info.board_serial) == b"linux-spidev"
    assert hand.fingers == [0, 1]
    with biotac.open("sim:press.toml?fingers=2&seconds=1") as other:
        for finger in range(5):
            ours, theirs = hand.sensor_info(finger), other.sensor_info(finger)
            assert ours.present == theirs.present == (finger < 2)
            assert (ours.serial, ours.software_version, ours.flex_version) == (
                theirs.serial,
                theirs.software_version,
                theirs.flex_version,
            )
            assert (ours.cpu_khz, ours.sampling_hz) == (theirs.cpu_khz, theirs.sampling_hz)


def test_a_missing_sensor_leaves_the_others_alone(board: Board) -> None:
    hand, bus = board("shear.toml", 3, absent=frozenset({1}))
    assert hand.fingers == [0, 2]
    ours, theirs = run(hand, bus), simulated("shear.toml", 3)
    assert set(ours.wire["finger"]) == {0, 2}
    same(ours.wire, theirs.wire[theirs.wire["finger"] != 1])
    status = hand.sensor_status(1)
    assert not status.present
    assert status.words_good == 0 < status.words_stuck


def test_fingers_are_sampled_one_transfer_apart_and_settle_50_us_from_the_last(board: Board) -> None:
    hand, bus = board("press.toml", 5)
    run(hand, bus)
    commands = bus.commands()
    assert [device for device, _ in commands[:10]] == [0, 1, 2, 3, 4] * 2
    first, last = commands[0][1], commands[4][1]
    assert last - first == 4 * bus.transfer_ns
    reads = [t_ns for _, word, t_ns in bus.log if word == fake_spidev.LISTEN_WORD and t_ns > last]
    assert 50_000 <= reads[0] - (last + bus.transfer_ns) < 53_000
    assert [emu.early_reads for emu in bus.sensors] == [0] * 5


def test_a_bus_too_slow_for_every_slot_loses_counted_slots_and_no_time(board: Board) -> None:
    hand, bus = board("press.toml", 2)
    bus.overhead_ns = 100_000
    frames = run(hand, bus).frames
    assert np.diff(frames["t_us"][frames["finger"] == 0]).tolist() == [10_000] * (int(100 * SECONDS) - 1)
    bus.clock.wait()
    sampled = len(bus.commands()) // 2
    late = hand.status().slots_late
    assert late > 0
    assert abs(sampled + late - 4400 * (SECONDS + 0.1)) <= 4
    assert [emu.early_reads for emu in bus.sensors] == [0, 0]


def test_a_host_that_does_not_read_loses_whole_frames(board: Board, monkeypatch) -> None:
    monkeypatch.setattr(in_process, "OUTBOX_BYTES", 8192)  # the emulated bus is slow to fill the real one
    hand, bus = board("press.toml", 1)
    hand.stream()
    standstill = Capture(still=True)
    hand.add(standstill)
    bus.clock.run(SECONDS)
    bus.clock.wait()
    standstill.resume.set()
    dropped = hand.status().messages_dropped
    assert dropped > 0
    assert (hand.stats.crc_errors, hand.stats.other_errors) == (0, 0)


def test_a_bus_that_fails_is_a_lost_board(board: Board) -> None:
    hand, bus = board("press.toml", 1)
    hand.stream()
    bus.fault = OSError(110, "Connection timed out")
    bus.clock.run(1.0)
    with pytest.raises(biotac.DeviceLostError, match=r"spidev:0\.0 failed.*Connection timed out.*open it again"):
        hand.read(1.0)
    hand.close()
    assert bus.opened[0].closed


def test_closing_gives_the_devices_back_and_ends_the_thread(board: Board) -> None:
    hand, bus = board("press.toml", 2)
    link = hand.link
    hand.close()
    hand.close()
    assert isinstance(link, spidev_link.SpidevLink)
    assert link.port not in {thread.name for thread in threading.enumerate()}
    assert [spi.closed for spi in bus.opened] == [True, True]


@pytest.mark.parametrize(
    ("port", "message"),
    [
        ("spidev:", r"'' is not an SPI device; expected BUS\.DEVICE"),
        ("spidev:0.-1", r"'0\.-1' is not an SPI device"),
        ("spidev:0.0,0.00", r"0\.00 is listed twice; each finger needs"),
        ("spidev:0.0,0.1,0.2,1.0,1.1,1.2", "6 devices; expected at most 5"),
    ],
)
def test_a_bad_port_says_what_is_expected(port: str, message: str) -> None:
    with pytest.raises(biotac.PortError, match=message):
        biotac.open(port)


def test_without_spidev_it_names_the_extra(monkeypatch) -> None:
    monkeypatch.setitem(sys.modules, "spidev", None)
    with pytest.raises(biotac.PortError, match=r"needs spidev.*pip install 'biotac-gateway\[bus\]'"):
        biotac.open("spidev:0.0")


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (FileNotFoundError(2, "No such file or directory"), r"no SPI device /dev/spidev0\.1; enable SPI"),
        (PermissionError(13, "Permission denied"), r"no permission to open /dev/spidev0\.1; sudo usermod -aG spi"),
        (OSError(16, "Device or resource busy"), r"/dev/spidev0\.1 cannot be used .*busy"),
    ],
)
def test_a_device_that_does_not_open_says_why_and_the_others_are_closed(monkeypatch, error, message) -> None:
    opened = []

    class Spi:
        closed = False

        def open(self, bus: int, device: int) -> None:
            if device == 1:
                raise error
            opened.append(self)

        def close(self) -> None:
            self.closed = True

    module = ModuleType("spidev")
    module.SpiDev = Spi  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "spidev", module)
    with pytest.raises(biotac.PortError, match=message):
        biotac.open("spidev:0.0,0.1")
    assert [spi.closed for spi in opened] == [True]


def test_the_computers_clock_sleeps_through_long_waits_and_never_returns_early(monkeypatch) -> None:
    now, slept = [10**12], []

    def tick() -> int:
        now[0] += 100  # looking takes time
        return now[0]

    def sleep(seconds: float) -> None:
        slept.append(seconds)
        now[0] += round(seconds * 1e9) + 7_000  # and oversleeps

    monkeypatch.setattr(time, "monotonic_ns", tick)
    monkeypatch.setattr(time, "sleep", sleep)
    clock = spidev_link.MonotonicClock()
    assert clock.wait_until(10**12 + 227_000)
    assert clock.now_ns() >= 10**12 + 227_000
    assert slept == [pytest.approx(127e-6, abs=1e-6)]
    before = now[0]
    clock.delay_ns(5_000)
    assert now[0] >= before + 5_000


# ---- calibrations on the harnesses ---------------------------------------------------------------


def test_what_the_harnesses_eeproms_hold_is_in_force_when_it_is_opened(board: Board, monkeypatch) -> None:
    first, bus = board("shear.toml", 2)
    serial = bytes(first.sensor_info(1).serial).decode()
    first.close()
    wires = fake_smbus.Wires({0x50: fake_smbus.Eeprom(256, 8, 1), 0x51: fake_smbus.Eeprom(4096, 32, 2)})
    monkeypatch.setitem(sys.modules, "smbus2", wires.module())
    own = biotac.Calibration(serial=serial, made_s=5, force_gain_nn=(7, 8, 9))
    with Chip("1:0x51", "24c32") as chip:
        eeprom.store(chip, own)
    with biotac.open("spidev:0.0,0.1?calibration=,1:0x51:24c32") as hand:
        assert hand.board.calibrations() == {1: own}
    # On finger 0's harness it is another sensor's; and finger 0's own chip is blank.
    with pytest.raises(biotac.CommandRefusedError, match="OTHER_SENSOR"):
        biotac.open("spidev:0.0,0.1?calibration=1:0x51:24c32")
    with pytest.raises(biotac.InputError, match="EEPROM 1:0x50 is blank"):
        biotac.open("spidev:0.0,0.1?calibration=1:0x50:24c02,1:0x51:24c32")
    assert wires.open_buses == 0
    assert all(spi.closed for spi in bus.opened)
