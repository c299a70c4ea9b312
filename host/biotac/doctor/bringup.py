"""A board's first evening, measured: board, clock, flash, bus, this computer's USB, each finger, restarts.

``measure`` needs about a minute, and the user's hand for some seconds of it; ``check`` finds values out of range.
Limits without another source are those of the part's data sheet.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import CommandRefusedError
from ..hand.hand import Hand
from ..wire import messages_gen as wire
from ..wire import sensor_gen as sensor
from ..wire.frames import FRAME_DTYPE, StructArray
from ..wire.framing import encode
from ..wire.identity import ascii_text
from .catalogue import Finding
from .facts import ExaminedBoard, Facts
from .listening import has_crystal, listen

FLASH = {"ef4015": "W25Q16JV", "ef7015": "W25Q16JV-IM", "ef4016": "W25Q32JV", "ef7016": "W25Q32JV-IM"}  # a Pico's
ERASE_MAX_US = 400_000  # of a sector, W25Q16JV data sheet
SUPPLY_MV = (4100, 5500)  # VSYS: 4.40 V at a device's end of USB (USB 2.0, 7.2.2) less a diode; the board's most
CLOCK_PPM = 650.0  # USB frames are within 500 ppm (USB 2.0, 7.1.12), a crystal within 100, a ms of reading in 20 s 50
LOST_STARTS = 2  # of frame, that two readings may differ by
JITTER_US = 5.0  # a slot's start; it is read in whole us
MARGIN = 1.25  # how much faster than usual the bus must still be clean: the margin for cables, temperature and supply
PDC_PER_N = 20.0  # count: fingers have 62 to 111 (Navarro 2015, K of 9 to 16 mN a count)
PDC_PER_C = 30.0  # count: a degree that looks like a third of a newton
RESTARTS = 10
PINGS, WINDOWS, WINDOW = 1000, 64, 8
SLOW_KHZ = 1000  # clocked by the core: a fault at this rate does not come from leads
RATES_KHZ = (0, 2300, 4900, 5300, 5700, 6300, 7000, 7900, 9000)
RATE_US = 250_000
Floats = NDArray[np.float64]
TOUCHED_N = 1.0
UNKNOWN = "not measured"


@dataclass(frozen=True)
class Restart:
    """One of them; ``seconds`` by this computer until the board answered again."""

    seconds: float
    present: int
    faults: int


@dataclass
class Bringup:
    """All measurements; lists and arrays are empty where the board or a sensor gave none."""

    emulated: bool = False  #: in a process or an emulator: measurements of silicon, cables and a hub are made up
    serials: tuple[str, ...] = ()  #: of the sensors by select, where they are known without asking
    chip: list[wire.BoardFacts] = field(default_factory=list)  #: at the start and the end of all but the restarts
    idle: list[wire.BoardFacts] = field(default_factory=list)  #: likewise of a time without a stream
    #: Good and other words (fingers, 2) by kHz: at SLOW_KHZ first, and at the usual rate and faster.
    slow: dict[int, NDArray[np.int64]] = field(default_factory=dict)
    rates: dict[int, NDArray[np.int64]] = field(default_factory=dict)
    ping_s: list[float] = field(default_factory=list)
    up_bytes_s: float = 0.0
    down_bytes_s: float = 0.0
    restarts: list[Restart] = field(default_factory=list)
    frames: StructArray = field(default_factory=lambda: np.zeros(0, FRAME_DTYPE))  #: at rest, then pressed

    @property
    def words(self) -> dict[int, NDArray[np.int64]]:
        """Of all rates, the usual one first."""
        return self.rates | self.slow

    def rows_of(self, finger: int) -> StructArray:
        rows: StructArray = self.frames[self.frames["finger"] == finger]
        return rows


def measure(
    hand: Hand, seen: Bringup, announce: Callable[[str], None], *, seconds: float, press_s: float
) -> ExaminedBoard:
    """Measure a board that ``reconnect``s into ``seen``, step by step; return the doctor's facts, too.

    ``announce`` gets the user's next step, and the one under way. The board's state is as after a restart.
    """
    seen.emulated = not has_crystal(hand)
    seen.serials = getattr(hand.link.source, "serials", ())
    announce("words at 1 MHz, clocked by the core: touch nothing")
    hand.stream("results")  # an emulated board's time begins with it
    hand.stop()
    _rates(hand, seen.slow, (SLOW_KHZ,))
    for khz, words in seen.slow.items():
        answers = [f"finger {f}: {good} of {good + bad} good" for f, (good, bad) in enumerate(words) if good]
        announce(f"at {khz / 1000:.2f} MHz: {', '.join(answers) or 'no good word: V+, SS or MISO'}")
    announce("serial numbers, then words at the usual rate")
    facts = listen(hand, seconds)
    if facts.chip is not None:
        seen.chip.append(facts.chip)
    seen.frames = facts.frames
    if facts.present:
        announce(f"press each finger on its pad, slowly and firmly, within {press_s:.0f} s")
        seen.frames = np.concatenate([facts.frames, hand.read(press_s)])
        hand.stop()
    if not seen.chip:
        return facts
    announce("this computer's USB")
    _usb(hand, seen)
    announce("the sensors' bus at faster rates, and the flash")
    _rates(hand, seen.rates, RATES_KHZ)
    seen.idle.append(hand.board.measure())
    _erase(hand)
    seen.chip.append(hand.board.measure())
    is_process = hand.info.board in (wire.BoardKind.POSIX_SIM, wire.BoardKind.POSIX_LIVE)  # a scenario may end
    restarts = 0 if is_process else RESTARTS
    for k in range(restarts):
        announce(f"restart {k + 1} of {restarts}")
        begun_s = time.monotonic()
        hand.board.restart()
        status = hand.status()
        seen.restarts.append(Restart(time.monotonic() - begun_s, status.fingers_present, status.faults))
    return facts


def _usb(hand: Hand, seen: Bringup) -> None:
    seen.idle.append(hand.board.measure())
    for _ in range(PINGS):
        sent_s = time.perf_counter()
        hand.ping()
        seen.ping_s.append(time.perf_counter() - sent_s)
    # The largest that a host may send at any time, which is refused, and the largest that it may ask for.
    up, down = wire.WriteMap(0, 0, 0, (0,) * 128), wire.GetStatus(0)
    seen.up_bytes_s = _windows(hand, up) * len(encode(up.ID, up.pack()))
    seen.down_bytes_s = _windows(hand, down) * len(encode(wire.Status.ID, bytes(wire.Status.STRUCT.size)))


def _windows(hand: Hand, message: Any) -> float:
    """Messages a second, WINDOW at a time."""
    begun_s = time.perf_counter()
    for _ in range(WINDOWS):
        for _ in range(WINDOW - 1):
            hand.board.send(message)
        with suppress(CommandRefusedError):
            hand.board.ask(message, wire.ANSWERS[type(message)])
    return WINDOWS * WINDOW / (time.perf_counter() - begun_s)


def _rates(hand: Hand, rates: dict[int, NDArray[np.int64]], each_khz: tuple[int, ...]) -> None:
    with suppress(CommandRefusedError):
        for khz in each_khz:
            at_khz = hand.board.try_bus_rate(khz).bus_khz
            before = _words(hand)
            if at_khz in rates or not _passed(hand, RATE_US):
                break
            rates[at_khz] = (_words(hand) - before) % 2**32
    with suppress(CommandRefusedError):
        hand.board.try_bus_rate(0)


def _passed(hand: Hand, us: int) -> bool:
    """Let this much device time pass; False where a scenario ends before."""
    begun_us = hand.status().t_us
    while not hand.link.ended and (hand.status().t_us - begun_us) % 2**32 < us:
        pass
    return not hand.link.ended


def _words(hand: Hand) -> NDArray[np.int64]:
    states = [hand.sensor_status(finger) for finger in range(sensor.MAX_SENSORS)]
    return np.array([[s.words_good, s.words_stuck + s.words_error + s.words_parity] for s in states])


def _erase(hand: Hand) -> None:
    """Begin to upload a map, which erases a sector that no map in force uses, and cancel it."""
    with suppress(CommandRefusedError):
        hand.board.command(wire.BeginMap(0, 0, 128, 0))
        hand.board.command(wire.WriteMap(0, 0, 0, (0,) * 128))
    hand.stop()
    hand.board.command(wire.Stop(0))


# ---- evaluation ---------------------------------------------------------------------------------------


def clock_ppm(seen: list[wire.BoardFacts]) -> float | None:
    """How fast the board's clock is against USB's frames; None without USB, or within a second."""
    if len(seen) < 2:
        return None
    first, last = seen[0], seen[-1]
    elapsed_us = (last.t_us - first.t_us) % 2**32
    if 0xFFFF in (first.usb_frame, last.usb_frame) or elapsed_us < 1_000_000:
        return None
    return (elapsed_us / (1000 * _frames(first, last)) - 1) * 1e6


def _frames(first: wire.BoardFacts, last: wire.BoardFacts) -> int:
    """USB frames in between; their numbers have only the last 11 bits."""
    about = (last.t_us - first.t_us) % 2**32 / 1000
    return round(about + ((last.usb_frame - first.usb_frame - about + 1024) % 2048 - 1024))


def lost_starts(seen: list[wire.BoardFacts]) -> tuple[int, int] | None:
    """How many starts of frame did not come, and of how many; None without USB."""
    if clock_ppm(seen) is None:
        return None
    frames = _frames(seen[0], seen[-1])
    return frames - (seen[-1].usb_starts - seen[0].usb_starts) % 2**32, frames


def jitter_us(frames: StructArray) -> Floats:
    """How far each round of one finger began from the time that the others' steps predict."""
    late_us = frames["t_us"] - frames["seq"] * (len(sensor.SLOTS) * 1e6 / sensor.SLOT_HZ)
    return late_us - np.median(late_us)


def noise_counts(frames: StructArray) -> Floats:
    """Standard deviation of each electrode (19,), from its changes' mean change at rest; NaN with too few frames."""
    rest = frames[frames["flags"] & wire.FrameFlags.CONTACT == 0]
    if len(rest) < 50:
        return np.full(rest["counts"].shape[1], np.nan)
    bends: Floats = np.abs(np.diff(rest["counts"].astype(float), n=2, axis=0)).mean(axis=0)
    bends *= np.sqrt(np.pi / 12)
    return bends


def pdc_per_n(frames: StructArray) -> tuple[float, float]:
    """Counts of static pressure per newton of the board's force, and the largest force; NaN where nothing pressed."""
    force_n = np.linalg.norm(frames["force_n"], axis=1)
    rise = np.where(frames["pdc"] == wire.INVALID_COUNT, np.nan, frames["pdc"]) - frames["pdc_tare"]
    good = np.isfinite(force_n) & np.isfinite(rise) & (force_n > TOUCHED_N)
    if good.sum() < 10:
        return np.nan, np.nan
    return float(rise[good] @ force_n[good] / (force_n[good] @ force_n[good])), float(force_n[good].max())


def pdc_per_c(frames: StructArray) -> float:
    """Counts of static pressure per degree, untouched; NaN where the temperature moved by less than half a degree."""
    rest = frames[(frames["flags"] & wire.FrameFlags.CONTACT == 0) & (frames["tdc"] != wire.INVALID_COUNT)]
    if len(rest) < 50:
        return np.nan
    share = rest["tdc"] / sensor.FULL_SCALE_COUNT
    celsius = sensor.TDC_BETA_K / np.log(sensor.TDC_A / share - sensor.TDC_B)
    return float(np.polyfit(celsius, rest["pdc"], 1)[0]) if np.ptp(celsius) > 0.5 else np.nan


def clean_khz(seen: Bringup, finger: int) -> tuple[int, int] | None:
    """The fastest bus rate up to which all words of a finger are good, and the usual one; None without good words."""
    clean = [khz for khz, words in sorted(seen.words.items()) if words[finger, 0] > 0]
    bad = [khz for khz, words in seen.words.items() if words[finger, 1] > 0]
    good = [khz for khz in clean if khz < min(bad, default=10**9)]
    return (max(good), next(iter(seen.words))) if good else None


@dataclass(frozen=True)
class Measure:
    """A value of the board's own, as text, and the expected one; ``code`` is the finding where it is another."""

    name: str
    seen: str
    expected: str
    code: str = ""


def measures(seen: Bringup) -> list[Measure]:
    """The board's measurements of itself, empty where it has none."""
    if not seen.chip:
        return []
    last, ppm, lost = seen.chip[-1], clock_ppm(seen.chip), lost_starts(seen.idle)
    flash, (low, high) = bytes(last.flash_id).hex(), SUPPLY_MV
    found: list[tuple[str, str, str, str, bool]] = [
        ("chip id", f"0x{last.chip_id:08X}", "first digit: revision, 2 is an RP2040 B2 or an RP2350 A2", "", False),
        ("flash", f"{flash} {FLASH.get(flash, '')}".strip(), ", ".join(FLASH), "flash_unknown",
         any(last.flash_id) and flash not in FLASH),
        ("slots lost by late DMA", str(last.slots_dma_late), "none", "dma_late", last.slots_dma_late > 0),
        ("starts that failed", str(last.early_faults), "none", "early_fault", last.early_faults > 0),
        ("erase of a sector", f"{last.erase_us / 1000:.1f} ms", f"at most {ERASE_MAX_US / 1000:.0f} ms", "flash_slow",
         last.erase_us > ERASE_MAX_US),
        ("supply", f"{last.supply_mv} mV" if last.supply_mv else UNKNOWN, f"{low} to {high} mV", "supply",
         bool(last.supply_mv) and not low <= last.supply_mv <= high),
        ("temperature", UNKNOWN if last.die_centi_c == wire.INVALID_I16 else f"{last.die_centi_c / 100:.1f} degrees",
         "-20 to 85 degrees", "", False),
        ("clock against USB", UNKNOWN if ppm is None else f"{ppm:+.0f} ppm", f"within {CLOCK_PPM:g} ppm", "clock_off",
         ppm is not None and abs(ppm) > CLOCK_PPM),
        ("lost starts of frame", UNKNOWN if lost is None else "{} of {}".format(*lost), f"at most {LOST_STARTS}",
         "usb_frames", lost is not None and lost[0] > LOST_STARTS),
    ]  # fmt: skip
    if len(seen.frames):
        late_us = np.ptp(jitter_us(seen.rows_of(seen.frames["finger"][0])))
        expected = f"at most {JITTER_US:g} us"
        found.append(("jitter of rounds", f"{late_us:.0f} us", expected, "slots_jitter", bool(late_us > JITTER_US)))
    return [Measure(name, text, expected, code if is_bad else "") for name, text, expected, code, is_bad in found]


def check(seen: Bringup, facts: Facts) -> Iterator[Finding]:
    """The values out of range, the board's first; beside the findings of ``diagnose``."""
    for measured in measures(seen):
        if measured.code:
            yield Finding(measured.code, f"{measured.name}: {measured.seen}; expected {measured.expected}")
    for k, restart in enumerate(seen.restarts, 1):
        if restart.present != seen.restarts[0].present or restart.faults != wire.FaultFlags.STARTED:
            state = f"sensors {restart.present:#07b}, faults {wire.FaultFlags(restart.faults)!r}"
            yield Finding("restart", f"after restart {k}: {state}; after the first {seen.restarts[0].present:#07b}")
    if facts.board is not None:
        yield from crossed(facts.board, seen.serials)
        for finger in range(sensor.MAX_SENSORS):
            rate = clean_khz(seen, finger)
            if rate is not None and len(seen.words) > 1 and rate[0] < MARGIN * rate[1]:
                usual = f"{rate[1] / 1000:.2f} MHz; expected {MARGIN:g} times that"
                yield Finding(
                    "bus_margin", f"finger {finger} is clean up to {rate[0] / 1000:.2f} MHz, of usually {usual}"
                )
        for finger in facts.board.present:
            yield from _finger(seen, finger)


def _finger(seen: Bringup, finger: int) -> Iterator[Finding]:
    gain, most_n = pdc_per_n(seen.rows_of(finger))
    if np.isnan(gain):
        yield Finding("not_pressed", f"finger {finger} was not pressed with {TOUCHED_N:g} N")
    elif gain < PDC_PER_N:
        yield Finding(
            "pressure_flat", f"finger {finger}: {gain:.1f} counts/N, up to {most_n:.1f} N; fingers have 62 to 111"
        )
    drift = pdc_per_c(seen.rows_of(finger))
    if abs(drift) > PDC_PER_C:
        yield Finding("pdc_warm", f"finger {finger}: {drift:+.0f} counts a degree; expected up to {PDC_PER_C:.0f}")


def crossed(board: ExaminedBoard, serials: tuple[str, ...]) -> Iterator[Finding]:
    """Of sensors with known serial numbers by finger: those that answer at another's select."""
    for info in board.sensors:
        serial = ascii_text(info.serial)
        if serial in serials and serial != serials[info.finger]:
            ends = serials.index(serial)
            yield Finding("lead_crossed", f"the select of finger {info.finger} ends at the sensor of finger {ends}")
