"""This computer's knowledge of boards and ports, without opening any: USB, permissions, other programs."""

from __future__ import annotations

import os
from collections.abc import Iterable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

from serial.tools.list_ports_common import ListPortInfo

from ..link.discovery import SERIAL_PREFIX, boards, same_serial
from ..link.holders import holders
from ..wire import messages_gen as wire
from .facts import SystemFacts

#: Where the boot loader's drive is mounted, an RP2040's or an RP2350's: macOS, then Linux desktops.
PLACES, LABELS = ("Volumes", "media/*", "run/media/*"), ("RPI-RP2", "RP2350")
DRIVES = tuple(f"{place}/{label}" for place in PLACES for label in LABELS)


def look(port: str | None, *, root: Path = Path("/"), entries: Iterable[Any] | None = None) -> SystemFacts:
    """Facts about this computer and ``port``; ``root`` is where /sys, /proc, /run and /dev are.

    Windows has none of these trees; there only the boards are found.
    """
    found = boards(entries)
    device = device_of(port, found)
    usb = list(usb_ids(root))
    loaders = [name for name, ids in usb if ids == (wire.USB_LOADER_VENDOR, wire.USB_LOADER_PRODUCT)]
    if not loaders:
        loaders = [str(drive) for pattern in DRIVES for drive in sorted(root.glob(pattern))]
    facts = SystemFacts(
        boards=found,
        usb_boards=sum(ids == (wire.USB_VENDOR, wire.USB_PRODUCT) for _, ids in usb),
        loaders=loaders,
    )
    if device is None or not device.startswith("/dev/"):
        return facts
    path = root / device.lstrip("/")
    return replace(
        facts,
        permitted=not path.exists() or os.access(path, os.R_OK | os.W_OK),
        owner=owner(path),
        holders=[h for h in holders(device, root / "proc") if h.pid != os.getpid()],
        modem_manager=modem_manager_runs(root) and Path(device).name.startswith("ttyACM"),
        left_alone=left_alone(device, root),
    )


def device_of(port: str | None, found: list[ListPortInfo]) -> str | None:
    """The device of ``port``, or of the only board if ``port`` is None; None if no board or several match."""
    if port is not None and not port.startswith(SERIAL_PREFIX):
        return port
    number = None if port is None else port.removeprefix(SERIAL_PREFIX)
    fitting = [board.device for board in found if number is None or same_serial(board.serial_number, number)]
    return fitting[0] if len(fitting) == 1 else None


def usb_ids(root: Path) -> Iterable[tuple[str, tuple[int, int]]]:
    """Name on the bus, vendor id and product id of each USB device (Linux)."""
    for folder in sorted((root / "sys/bus/usb/devices").glob("*")):
        with suppress(OSError, ValueError):
            vendor, product = (int((folder / name).read_text(), 16) for name in ("idVendor", "idProduct"))
            yield f"USB {folder.name}", (vendor, product)


def owner(path: Path) -> str:
    """The port's owner, in words."""
    with suppress(OSError, KeyError, NotImplementedError):  # Path.owner() raises the last on Windows
        return f"{path.owner()}, group {path.group()}, mode {path.stat().st_mode & 0o777:o}"
    return "another user"


def modem_manager_runs(root: Path) -> bool:
    for name in (root / "proc").glob("[0-9]*/comm"):
        with suppress(OSError):
            if name.read_text().strip() == "ModemManager":
                return True
    return False


def left_alone(device: str, root: Path) -> bool:
    """Whether udev's database has ID_MM_DEVICE_IGNORE or ID_MM_PORT_IGNORE for the port."""
    with suppress(OSError):
        number = (root / "sys/class/tty" / Path(device).name / "dev").read_text().strip()
        lines = (root / f"run/udev/data/c{number}").read_text().splitlines()
        return any(line in lines for line in ("E:ID_MM_DEVICE_IGNORE=1", "E:ID_MM_PORT_IGNORE=1"))
    return False
