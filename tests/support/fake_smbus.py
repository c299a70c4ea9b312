"""A stand-in at smbus2's API: 24Cxx EEPROMs as in their data sheets, on a supply that may fail."""

from __future__ import annotations

import errno
import random
from types import ModuleType


class PowerFailsError(Exception):
    """The chip lost the supply; the program that was writing is gone too."""


class Eeprom:
    """One chip. ``memory`` outlives the supply; nothing else does."""

    def __init__(self, size: int, page: int, address_bytes: int) -> None:
        self.memory = bytearray(b"\xff" * size)
        self.page = page
        self.address_bytes = address_bytes
        self.busy_for = 3  # questions that are not acknowledged after each write
        self.protected = False  # the WP pin: writes are acknowledged and kept from the memory
        self.bytes_left: int | None = None  # until the supply fails; None: it holds
        self.ragged: random.Random | None = None  # the byte at which power fails has some bits done
        self.bytes_kept = 0
        self._pointer = 0
        self.busy = 0

    def acknowledge(self) -> bool:
        if self.busy:
            self.busy -= 1
            return False
        return True

    def write(self, data: bytes, *, stop: bool) -> None:
        head, rest = data[: self.address_bytes], data[self.address_bytes :]
        if len(head) < self.address_bytes:
            return  # the address is not whole: nothing is begun
        self._pointer = int.from_bytes(head, "big") % len(self.memory)
        if not rest or not stop:
            return  # a write begins with the stop condition, and with data
        base = self._pointer - self._pointer % self.page
        latch = {}
        for k, value in enumerate(rest):  # the address counts within the page and begins anew at the end
            latch[base + (self._pointer + k) % self.page] = value
        self.busy = self.busy_for
        for at, value in sorted(latch.items()):
            self._keep(at, value)

    def _keep(self, at: int, value: int) -> None:
        if self.bytes_left == 0:
            if self.ragged is not None:
                self.memory[at] ^= (self.memory[at] ^ value) & self.ragged.randrange(256)
            raise PowerFailsError
        if self.bytes_left is not None:
            self.bytes_left -= 1
        self.bytes_kept += 1
        if not self.protected:
            self.memory[at] = value

    def read(self, count: int) -> bytes:
        ring = bytes(self.memory) * (2 + count // len(self.memory))
        out = ring[self._pointer : self._pointer + count]
        self._pointer = (self._pointer + count) % len(self.memory)
        return out


class Message:
    """smbus2.i2c_msg."""

    def __init__(self, address: int, *, data: bytes = b"", count: int = 0) -> None:
        self.address, self.data, self.count = address, data, count

    @classmethod
    def write(cls, address: int, data: list[int]) -> Message:
        assert all(type(v) is int and 0 <= v <= 255 for v in data)
        return cls(address, data=bytes(data))

    @classmethod
    def read(cls, address: int, count: int) -> Message:
        return cls(address, count=count)

    def __bytes__(self) -> bytes:
        return self.data


class Wires:
    """Bus 1, with chips at addresses."""

    def __init__(self, chips: dict[int, Eeprom]) -> None:
        self.chips = chips
        self.fault: OSError | None = None
        self.open_fault: OSError | None = None
        self.open_buses = 0

    def module(self) -> ModuleType:
        """The module that ``import smbus2`` shall give."""
        module = ModuleType("smbus2")
        module.SMBus = lambda bus: Bus(self, bus)  # type: ignore[attr-defined]
        module.i2c_msg = Message  # type: ignore[attr-defined]
        return module


class Bus:
    """smbus2.SMBus."""

    def __init__(self, wires: Wires, bus: int) -> None:
        if wires.open_fault is not None:
            raise wires.open_fault
        if bus != 1:
            raise FileNotFoundError(errno.ENOENT, "No such file or directory")
        self._wires = wires
        wires.open_buses += 1

    def i2c_rdwr(self, *messages: Message) -> None:
        if self._wires.fault is not None:
            raise self._wires.fault
        for k, message in enumerate(messages):
            chip = self._wires.chips.get(message.address)
            if chip is None or not chip.acknowledge():
                raise OSError(errno.EREMOTEIO, "Remote I/O error")
            if message.count:
                message.data = chip.read(message.count)
            else:
                chip.write(message.data, stop=k == len(messages) - 1)

    def close(self) -> None:
        self._wires.open_buses -= 1
