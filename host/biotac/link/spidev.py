"""Sensors on this computer's own SPI bus: the board is a thread of this process.

The firmware's sampler, session and framing run here (host/binding/sbc.c); Python provides the bus through ``spidev``,
the time and the link. The differences from a microcontroller:

- spidev talks to one sensor at a time, so the fingers of a slot are sampled one after the other, not simultaneously.
  The slot's time is that of the first.
- Linux and the interpreter guarantee no deadline. A late slot is omitted and counted, as on a board
  (``Status.slots_late``), and its channel is missing from the frame. Electrodes and PAC alternate: a bus that is a
  little too slow for every slot loses one of the two kinds throughout.
"""

from __future__ import annotations

import secrets
import time
from contextlib import ExitStack, suppress
from typing import Any

from ..errors import PortError, installing
from ..wire import sensor_gen as sensor
from ..wire.counters import nearest
from ..wire.native import lib
from .in_process import InProcessLink

# Linux wakes a sleeping thread some 60 us late, even from sleep(0), so the end of each wait is spent awake. Other
# threads get the interpreter whenever the board's C code runs, several times per slot.
AWAKE_NS = 100_000


class MonotonicClock:
    """Device time: the computer's monotonic clock. Tests have another."""

    def now_ns(self) -> int:
        return time.monotonic_ns()

    def delay_ns(self, ns: int) -> None:
        self.wait_until(time.monotonic_ns() + ns)

    def wait_until(self, t_ns: int) -> bool:
        """Wait for t_ns; false if it returns before, for a command of the host. Here the next slot is near."""
        while (left_ns := t_ns - time.monotonic_ns()) > 0:
            if left_ns > AWAKE_NS:
                time.sleep((left_ns - AWAKE_NS) / 1e9)
        return True


def parse_spidev(port: str) -> list[tuple[int, int]]:
    """Bus and device of each finger of ``spidev:0.0,0.1``. Raises PortError for any other form."""
    devices: list[tuple[int, int]] = []
    for text in port.removeprefix("spidev:").split(","):
        bus, dot, device = text.partition(".")
        if not (dot and bus.isdecimal() and device.isdecimal() and text.isascii()):
            raise PortError(f"{port}: {text!r} is not an SPI device; expected BUS.DEVICE per finger: spidev:0.0,0.1")
        if (int(bus), int(device)) in devices:
            raise PortError(f"{port}: {text} is listed twice; each finger needs its own chip select")
        devices.append((int(bus), int(device)))
    if len(devices) > sensor.MAX_SENSORS:
        raise PortError(f"{port}: {len(devices)} devices; expected at most {sensor.MAX_SENSORS}")
    return devices


def open_devices(port: str) -> list[Any]:
    """A ``spidev.SpiDev`` for each finger of the port. Raises PortError when one cannot be opened."""
    devices = parse_spidev(port)
    try:
        import spidev
    except ImportError as error:
        raise PortError(f"{port} needs spidev ({error}); on Linux: {installing('bus')}") from error
    opened = [spidev.SpiDev() for _ in devices]
    with ExitStack() as on_failure:
        for spi, (bus, device) in zip(opened, devices, strict=True):
            path = f"/dev/spidev{bus}.{device}"
            try:
                spi.open(bus, device)
                on_failure.callback(spi.close)
                spi.mode = 0
                spi.max_speed_hz = sensor.SPI_HZ
                spi.bits_per_word = 8  # two bytes per 16-bit word: the Raspberry Pi's bus cannot do 16 bits
            except FileNotFoundError as error:
                cure = "enable SPI (raspi-config, Interface Options) and check ls /dev/spidev*"
                raise PortError(f"no SPI device {path}; {cure}") from error
            except PermissionError as error:
                cure = "sudo usermod -aG spi $USER, and log in again"
                raise PortError(f"no permission to open {path}; {cure}") from error
            except OSError as error:
                cure = f"check that it is an SPI device of mode 0 and up to {sensor.SPI_HZ / 1e6} MHz"
                raise PortError(f"{path} cannot be used ({error}); {cure}") from error
        on_failure.pop_all()
    return opened


class SpidevLink(InProcessLink):
    """A Link to the gateway that runs in this process."""

    cure = "check the SPI bus and open it again"

    def __init__(self, port: str) -> None:
        super().__init__(port)
        self._devices = open_devices(port)
        self._clock = MonotonicClock()
        self._start_ns = self._clock.now_ns()
        self.begin(lib.bt_sbc_new(self._handle, len(self._devices), True, secrets.randbits(32)))

    def close(self) -> None:
        super().close()
        for spi in self._devices:
            with suppress(OSError):  # a device that is gone needs no closing
                spi.close()
        self._devices = []

    def _run(self) -> None:
        """The main loop of firmware/app/main.c, but with an end."""
        lib.bt_sbc_start(self._board)
        while not self._closing and self._failure is None:
            lib.bt_sbc_poll(self._board)
            if self._clock.wait_until(self._due_ns()):
                lib.bt_sbc_alarm(self._board)

    def _due_ns(self) -> int:
        """When the board is due next: its 32-bit time in us, unwrapped around now, as ns of the clock."""
        return self._start_ns + nearest(lib.bt_sbc_due_us(self._board), self._us()) * 1000

    def _us(self) -> int:
        return (self._clock.now_ns() - self._start_ns) // 1000

    def _delay(self, us: int) -> None:
        self._clock.delay_ns(us * 1000)

    def _exchange(self, finger: int, data: Any) -> None:
        # After a failure the rest of the slot reads as zeros; then the loop ends.
        data[:] = bytes(len(data)) if self._failure else bytes(self._devices[finger].xfer2(list(bytes(data))))
