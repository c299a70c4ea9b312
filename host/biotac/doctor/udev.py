"""The udev rule that lets the user at a Linux computer open our boards, and makes ModemManager ignore them."""

from __future__ import annotations

from pathlib import Path

from ..errors import InputError, PortError
from ..wire import messages_gen as wire

# Must come before 73-seat-late.rules, or uaccess has no effect.
RULES = Path("/etc/udev/rules.d/70-biotac.rules")


def rule() -> str:
    ours = f'ATTRS{{idVendor}}=="{wire.USB_VENDOR:04x}", ATTRS{{idProduct}}=="{wire.USB_PRODUCT:04x}"'
    loader = f'ATTRS{{idVendor}}=="{wire.USB_LOADER_VENDOR:04x}", ATTRS{{idProduct}}=="{wire.USB_LOADER_PRODUCT:04x}"'
    groups = 'MODE="0660", GROUP'  # a login over ssh has no seat, and so no uaccess
    ignore = 'ENV{ID_MM_DEVICE_IGNORE}="1", ENV{ID_MM_PORT_IGNORE}="1"'
    return "\n".join(
        [
            "# BioTac gateway boards: for whoever sits here or is in dialout and plugdev, not for ModemManager.",
            "# Written by `biotac doctor --udev-rule install`.",
            f'SUBSYSTEM=="tty", {ours}, {groups}="dialout", TAG+="uaccess", {ignore}',
            f'SUBSYSTEM=="usb", {ours}, {groups}="plugdev", TAG+="uaccess", {ignore}',
            "# The same boards in their loader.",
            f'SUBSYSTEM=="usb", {loader}, {groups}="plugdev", TAG+="uaccess"',
            "",
        ]
    )


def install(path: Path = RULES) -> None:
    """Write the rule. Raises PortError without the permission to, InputError where there is no udev."""
    if not path.parent.is_dir():
        raise InputError(f"no folder {path.parent}: this system has no udev; udev rules are for Linux")
    try:
        path.write_text(rule())
    except PermissionError as error:
        cure = "run it as root: sudo biotac doctor --udev-rule install"
        raise PortError(f"no permission to write {path}; {cure}") from error
