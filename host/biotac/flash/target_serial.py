"""A board on USB: its port may have another name each time, its serial number stays."""

from __future__ import annotations

from pathlib import Path

import serial

from ..errors import BiotacError, DeviceLostError, PortError
from ..hand.hand import Hand
from ..link.discovery import boards
from ..link.serial_port import SerialLink, describe_open_error
from .waiting import wait_for

BACK_S = 20.0
TOUCH_BAUD = 1200


class SerialTarget:
    """``port`` is None for a board that is in its loader already: its port is then the one that comes."""

    def __init__(self, port: str | None) -> None:
        self._device = port
        self._before = gateway_ports()
        self._serial_number = self._before.get(port or "")
        self.port = port or "the board in its loader"

    def there(self) -> bool:
        """See Target.there."""
        return self._device is not None and (self._device in gateway_ports() or Path(self._device).exists())

    def open(self) -> Hand:
        """See Target.open."""
        if self._device is None:
            raise PortError("no port is known of a board in its loader")
        return Hand(SerialLink(self._device))

    def touch(self) -> None:
        """See Target.touch."""
        assert self._device is not None
        try:
            serial.Serial(self._device, TOUCH_BAUD).close()
        except (serial.SerialException, OSError, ValueError) as error:
            raise PortError(describe_open_error(self._device, error)) from error

    def reopen(self) -> Hand:
        """See Target.reopen."""
        self._failed = f"no port with serial number {self._serial_number}" if self._serial_number else "no new port"
        hand = wait_for(self._try, BACK_S)
        if hand is None:
            raise DeviceLostError(
                f"the board did not come back within {BACK_S:.0f} s ({self._failed}); plug it in again, "
                "`biotac list --probe` then tells what it runs"
            )
        return hand

    def _try(self) -> Hand | None:
        device = self._find()
        if device is None:
            return None
        try:
            hand = Hand(SerialLink(device))
        except BiotacError as error:
            self._failed = str(error)  # such as permissions that udev has not set yet
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

    def close(self) -> None:
        """See Target.close."""


def gateway_ports() -> dict[str, str | None]:
    """Ports of boards with our USB ids, and their serial numbers."""
    return {port.device: port.serial_number for port in boards()}


def only_port() -> str | None:
    """The port of the one board that is plugged in, None without any; PortError when there are several."""
    ports = sorted(gateway_ports())
    if len(ports) > 1:
        raise PortError(f"{len(ports)} boards are plugged in ({', '.join(ports)}); say which PORT to flash")
    return ports[0] if ports else None
