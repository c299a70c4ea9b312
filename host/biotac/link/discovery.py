"""Finding boards by USB ids, and choosing one by serial number. Looking for boards opens no port."""

from __future__ import annotations

from collections.abc import Iterable

from serial.tools import list_ports
from serial.tools.list_ports_common import ListPortInfo

from ..errors import PortError
from ..wire import messages_gen as wire
from .serial_port import SerialLink

SERIAL_PREFIX = "serial:"


def is_board(port: ListPortInfo) -> bool:
    """Whether it has the USB ids of our firmware."""
    return (port.vid, port.pid) == (wire.USB_VENDOR, wire.USB_PRODUCT)


def serial_ports(entries: Iterable[ListPortInfo] | None = None) -> list[ListPortInfo]:
    """All serial ports as pyserial describes them, COM3 before COM10; ``entries`` by default those of this computer.

    On macOS a port has two names; /dev/cu.* is chosen, because opening /dev/tty.* waits for a modem's carrier.
    """
    ports = sorted(list_ports.comports() if entries is None else entries)
    calling = {port.device for port in ports if port.device.startswith("/dev/cu.")}
    return [port for port in ports if port.device.replace("/dev/tty.", "/dev/cu.", 1) not in calling - {port.device}]


def boards(entries: Iterable[ListPortInfo] | None = None) -> list[ListPortInfo]:
    return [port for port in serial_ports(entries) if is_board(port)]


def choose(serial_number: str | None = None, entries: Iterable[ListPortInfo] | None = None) -> str:
    """Device path of the board with this serial number; None: of the only board.

    Raises PortError, naming the boards that are there, when none or several fit.
    """
    found = boards(entries)
    fitting = [p for p in found if serial_number is None or same_serial(p.serial_number, serial_number)]
    if len(fitting) == 1:
        return str(fitting[0].device)
    named = ", ".join(f"{SERIAL_PREFIX}{p.serial_number} on {p.device}" for p in found)
    if not found:
        wanted = "no board" if serial_number is None else f"no board with serial number {serial_number}"
        raise PortError(f"{wanted} on any USB port; plug one in and run `biotac doctor`, or try `biotac demo`")
    if not fitting:
        raise PortError(f"no board has serial number {serial_number}; expected one of {named}")
    raise PortError(f"found {len(fitting)} boards: {named}; name one of them as PORT")


def open_serial(port: str) -> SerialLink:
    """Open a ``serial:`` port, the board with that serial number."""
    return SerialLink(choose(port.removeprefix(SERIAL_PREFIX)))


def same_serial(seen: str | None, wanted: str) -> bool:
    """Whether two serial numbers are the same, ignoring case, in which some systems change them."""
    return seen is not None and seen.upper() == wanted.upper()
