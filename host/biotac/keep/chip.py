"""A 24Cxx EEPROM on this computer's own I2C bus, through ``smbus2``.

A write must stay within one page, or it wraps to the page's beginning. While the chip stores a page, for up to 10 ms,
it acknowledges nothing. So the next page waits until it does; the chip is polled a bounded number of times rather than
given a guessed time.
"""

from __future__ import annotations

import errno
import re
from contextlib import suppress
from typing import Any, NamedTuple

from ..errors import InputError, PortError, installing


class ChipType(NamedTuple):
    """Size, page size (the largest write) and address length of one type of chip."""

    size_bytes: int
    page_bytes: int
    address_bytes: int


# From the data sheets. Microchip and Atmel agree, except that a few 24C02 have pages of 16; 8 works with those too.
KINDS = {
    "24c01": ChipType(128, 8, 1),
    "24c02": ChipType(256, 8, 1),
    "24c04": ChipType(512, 16, 1),
    "24c08": ChipType(1024, 16, 1),
    "24c16": ChipType(2048, 16, 1),
    "24c32": ChipType(4096, 32, 2),
    "24c64": ChipType(8192, 32, 2),
    "24c128": ChipType(16384, 64, 2),
    "24c256": ChipType(32768, 64, 2),
    "24c512": ChipType(65536, 128, 2),
}
FIRST_ADDRESS, LAST_ADDRESS = 0x50, 0x57  # of every 24Cxx
REACH_BYTES = 256  # chips with one address byte have the rest at further bus addresses, which are not needed here
# A poll takes 2 bytes on the bus, 18 us at 1 MHz, and a system call: over 20 ms for all, twice as long as a write.
QUESTIONS = 1000
# Errors that drivers report when nothing acknowledged.
NOT_ACKNOWLEDGED = {errno.ENXIO, errno.EREMOTEIO, errno.EIO}


def parse_address(text: str) -> tuple[int, int]:
    """Bus and address from text such as ``1:0x50``. Raises PortError for anything else."""
    match = re.fullmatch(r"(\d{1,3}):(0[xX][0-9a-fA-F]{1,2}|\d{1,3})", text, re.ASCII)
    if match is None:
        raise PortError(f"{text!r} is not an I2C address; expected BUS:ADDRESS, such as 1:0x50 (see i2cdetect -l)")
    address = int(match[2], 0) if match[2][:2].lower() == "0x" else int(match[2])
    if not FIRST_ADDRESS <= address <= LAST_ADDRESS:
        raise PortError(f"{text}: a 24Cxx is at 0x{FIRST_ADDRESS:x} to 0x{LAST_ADDRESS:x}; check its address pins")
    return int(match[1]), address


def parse_chip(text: str) -> tuple[str, str]:
    """Address and kind from text such as ``1:0x50:24c32``. Raises PortError for anything else."""
    address, _, kind = text.rpartition(":")
    if kind not in KINDS:
        raise PortError(f"{text!r} names no known EEPROM ({', '.join(KINDS)}); expected one such as 1:0x50:24c32")
    parse_address(address)
    return address, kind


class _SilentError(PortError):
    """Nothing acknowledged."""


class Chip:
    """One EEPROM; use it as a context manager."""

    def __init__(self, address: str, kind: str) -> None:
        self.name = f"EEPROM {address}"
        self.kind = KINDS[kind]
        if self.kind.size_bytes < REACH_BYTES:
            raise InputError(
                f"{self.name}: a {kind} has {self.kind.size_bytes} bytes, expected {REACH_BYTES} or more; use a 24c02"
            )
        bus, self._address = parse_address(address)
        try:
            import smbus2
        except ImportError as error:
            raise PortError(f"{self.name} needs smbus2 ({error}); on Linux: {installing('bus')}") from error
        self._message: Any = smbus2.i2c_msg
        try:
            self._bus = smbus2.SMBus(bus)
        except FileNotFoundError as error:
            cure = "enable I2C (raspi-config, Interface Options), then see ls /dev/i2c-*"
            raise PortError(f"no I2C bus {bus}; {cure}") from error
        except PermissionError as error:
            cure = "sudo usermod -aG i2c $USER, and log in again"
            raise PortError(f"no permission to open /dev/i2c-{bus}; {cure}") from error
        except OSError as error:
            raise PortError(f"/dev/i2c-{bus} cannot be opened ({error}); see ls /dev/i2c-*") from error

    def __enter__(self) -> Chip:
        return self

    def __exit__(self, *error: object) -> None:
        self._bus.close()

    def read(self, at: int, count: int) -> bytes:
        """``count`` bytes from address ``at``. Raises PortError when the chip does not answer or the bus fails."""
        answer = self._message.read(self._address, count)
        self._transfer(self._message.write(self._address, self._pointer(at)), answer)
        return bytes(answer)

    def write(self, at: int, data: bytes) -> None:
        """Write page by page; returns once the chip has stored the last. Raises PortError as read() does."""
        while data:
            room = self.kind.page_bytes - at % self.kind.page_bytes
            self._transfer(self._message.write(self._address, [*self._pointer(at), *data[:room]]))
            self._wait()
            at, data = at + room, data[room:]

    def _pointer(self, at: int) -> list[int]:
        assert 0 <= at < REACH_BYTES
        return list(at.to_bytes(self.kind.address_bytes, "big"))

    def _transfer(self, *messages: Any) -> None:
        try:
            self._bus.i2c_rdwr(*messages)
        except OSError as error:
            if error.errno in NOT_ACKNOWLEDGED:
                raise _SilentError(
                    f"{self.name}: no acknowledge ({error.strerror}); check power, SDA, SCL and the address "
                    "(see i2cdetect)"
                ) from error
            raise PortError(f"{self.name}: the bus failed ({error}); check its wires and try again") from error

    def _wait(self) -> None:
        """Wait until a write is stored. It polls with reads, which change nothing on any chip."""
        for _ in range(QUESTIONS):
            with suppress(_SilentError):
                self._transfer(self._message.read(self._address, 1))
                return
        raise PortError(
            f"{self.name} did not acknowledge any of {QUESTIONS} polls after a page write; check its power and "
            "store again; the previous calibration is intact"
        )
