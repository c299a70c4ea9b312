"""A board on USB: the port's name may change, the serial number does not."""

from __future__ import annotations

from pathlib import Path

import serial

from ..errors import BiotacError, DeviceLostError, PortError
from ..hand.hand import Hand
from ..link.discovery import boards
from ..link.serial_port import SerialLink, open_error
from .interfaces import Target
from .waiting import wait_for

BACK_S = 20.0
TOUCH_BAUD = 1200


class SerialTarget(Target):
    """A board on a serial port. ``port`` is None for a board already in a loader: the new port is then the board's."""

    def __init__(self, port: str | None) -> None:
        self._device = port
        self._before = gateway_ports()
        self._serial_number = self._before.get(port or "")
        self.port = port or "the board in its loader"

    def port_exists(self) -> bool:
        return self._device is not None and (self._device in gateway_ports() or Path(self._device).exists())

    def open(self) -> Hand:
        if self._device is None:
            raise PortError("a board in its loader has no port to open; plug it in again without BOOTSEL")
        return Hand(SerialLink(self._device))

    def touch(self) -> None:
        assert self._device is not None
        try:
            serial.Serial(self._device, TOUCH_BAUD).close()
        except (serial.SerialException, OSError, ValueError) as error:
            raise open_error(self._device, error) from error

    def reopen(self) -> Hand:
        self._failed = f"no port with serial number {self._serial_number}" if self._serial_number else "no new port"
        hand = wait_for(self._try, BACK_S)
        if hand is None:
            raise DeviceLostError(
                f"the board did not come back within {BACK_S:.0f} s ({self._failed}); plug it in again; "
                "`biotac list` then shows what it runs"
            )
        return hand

    def _try(self) -> Hand | None:
        device = self._find()
        if device is None:
            return None
        try:
            hand = Hand(SerialLink(device))
        except BiotacError as error:
            self._failed = str(error)  # for example, udev has not set permissions yet
            return None
        self.port = device
        return hand

    def _find(self) -> str | None:
        ports = gateway_ports()
        if self._serial_number:
            return next((device for device, number in ports.items() if number == self._serial_number), None)
        if self._device is None:
            return next((device for device in ports if device not in self._before), None)
        return self._device if Path(self._device).exists() else None


def gateway_ports() -> dict[str, str | None]:
    """Serial numbers of boards with our USB ids, by port."""
    return {port.device: port.serial_number for port in boards()}


def only_port() -> str | None:
    """The port of the only board plugged in; None without any. Raises PortError when there are several."""
    ports = sorted(gateway_ports())
    if len(ports) > 1:
        raise PortError(f"{len(ports)} boards are plugged in ({', '.join(ports)}); say which PORT to flash")
    return ports[0] if ports else None
