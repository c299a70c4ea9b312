"""A stand-in at spidev's API, backed by the compiled emulated sensor (firmware/emu), with a simulated clock."""

import sys
import threading
from pathlib import Path
from types import ModuleType

import pytest

from biotac.link import spidev as spidev_link
from biotac.sim.source import Source
from biotac.wire.native import ffi, lib
from biotac.wire.sensor_gen import LISTEN_WORD, SPI_HZ
from biotac_rig.tape import write_tape


class HeldClock:
    """Time passes as it is used up, up to a limit that the test moves; it stands still there, with the host served."""

    def __init__(self) -> None:
        self.ns = 5_000_000_000_123  # the computer was on before
        self.limit_ns = 0
        self._moved = threading.Event()
        self._rests = threading.Event()
        self._lock = threading.Lock()

    def now_ns(self) -> int:
        return self.ns

    def delay_ns(self, ns: int) -> None:
        self.ns += ns

    def wait_until(self, t_ns: int) -> bool:
        with self._lock:
            over = t_ns > self.limit_ns
            if over:
                self._rests.set()
        if over:
            self._moved.wait(0.001)  # the host's bytes are looked for this often; device time stands still
            self._moved.clear()
            return False
        self.ns = max(self.ns, t_ns)
        return True

    def run(self, seconds: float) -> None:
        with self._lock:
            self.limit_ns = self.ns + round(seconds * 1e9)
            self._rests.clear()
        self._moved.set()

    def wait(self) -> None:
        """Until the time given by run() is used up."""
        assert self._rests.wait(600)


class Bus:
    """The sensors of one source, a device each on bus 0, and the words that went over the wire."""

    def __init__(self, source: Source, folder: Path, absent: frozenset[int] = frozenset()) -> None:
        write_tape(folder / "counts.tape", source)
        tape_bytes = (folder / "counts.tape").read_bytes()
        self.clock = HeldClock()
        self.transfer_ns = 16 * 10**9 // SPI_HZ
        self.overhead_ns = 0  # of each call
        self.fault: OSError | None = None
        self.opened: list[FakeSpi] = []
        self.log: list[tuple[int, int, int]] = []  # device, first word, when; the latest calls
        self._stream = ffi.new("bt_emu_stream *")
        self._tape_bytes = ffi.new("uint8_t[]", tape_bytes)
        assert lib.bt_emu_stream_open(self._stream, self._tape_bytes, len(tape_bytes)) == ffi.NULL
        self.sensors = []
        for f in range(source.samples.shape[1]):
            serial = source.serials[f] if source.serials else f"BTEMU0000000{f + 1:04}"
            emu = ffi.new("bt_emu_device *")
            count = ffi.addressof(lib, "bt_emu_stream_by_clock")
            lib.bt_emu_init(emu, f, f not in absent, serial.encode(), count, self._stream)
            self.sensors.append(emu)

    def module(self) -> ModuleType:
        """The module that ``import spidev`` shall give."""
        module = ModuleType("spidev")
        module.SpiDev = lambda: FakeSpi(self)  # type: ignore[attr-defined]
        return module

    def install(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """Let ports on this bus be opened, and live by its clock."""
        monkeypatch.setitem(sys.modules, "spidev", self.module())
        monkeypatch.setattr(spidev_link, "MonotonicClock", lambda: self.clock)  # emulated sensors are slower than real

    def commands(self) -> list[tuple[int, int]]:
        """Device and time of the sample commands among the calls."""
        return [(device, t_ns) for device, word, t_ns in self.log if word != LISTEN_WORD and word >> 8 & 0x80]


class FakeSpi:
    """spidev.SpiDev, the part in use, and as strict as the kernel."""

    def __init__(self, bus: Bus) -> None:
        self._bus = bus
        self.mode = 3
        self.max_speed_hz = 125_000_000
        self.bits_per_word = 8
        self.closed = False

    def open(self, bus: int, device: int) -> None:
        if bus != 0 or device >= len(self._bus.sensors):
            raise FileNotFoundError(2, "No such file or directory")
        self.device = device
        self._bus.opened.append(self)

    def xfer2(self, values: list[int]) -> list[int]:
        bus, emu = self._bus, self._bus.sensors[self.device]
        if not isinstance(values, list) or not values:
            raise TypeError("expected a sequence, not empty")
        if self.closed:
            raise OSError(9, "Bad file descriptor")
        assert (self.mode, self.max_speed_hz, self.bits_per_word) == (0, SPI_HZ, 8)
        assert len(values) in (1, 2)
        assert all(type(v) is int and 0 <= v <= 255 for v in values)
        if bus.fault is not None:
            raise bus.fault
        bus.log.append((self.device, values[0] << 8 | values[-1], bus.clock.ns))
        lib.bt_emu_select(emu, True, bus.clock.ns)
        answer = []
        for value in values:
            answer.append(lib.bt_emu_transfer8(emu, value, bus.clock.ns))
            bus.clock.ns += bus.transfer_ns // 2
        lib.bt_emu_select(emu, False, bus.clock.ns)
        bus.clock.ns += bus.overhead_ns
        return answer

    def close(self) -> None:
        self.closed = True
