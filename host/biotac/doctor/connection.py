"""Checks everything from the plug to the first answer, and the firmware against the library."""

from __future__ import annotations

import re
from collections.abc import Iterator

from .. import errors
from ..link.holders import holders_text
from ..version import __version__
from ..wire.identity import version_text
from .catalogue import Finding
from .facts import Facts

#: The error that opening a port ended with, and the finding's code; any other error is ``port_failed``.
BY_ERROR: dict[type[errors.BiotacError], str] = {
    errors.NotAGatewayError: "not_a_gateway",
    errors.DeviceLostError: "board_lost",
    errors.WireVersionError: "wire_version",
    errors.CommandRefusedError: "refused",
}


def check(facts: Facts) -> Iterator[Finding]:
    """Boot loader, permission, other programs, ModemManager, whether a gateway answers, and of which release it is."""
    system, error = facts.system, facts.error
    for drive in system.loaders:
        yield Finding("in_loader", f"a board waits in its loader at {drive}")
    if facts.port is None:
        if len(system.boards) > 1:
            ports = ", ".join(f"serial:{port.serial_number} on {port.device}" for port in system.boards)
            yield Finding("several_boards", f"{len(system.boards)} boards: {ports}")
        elif system.usb_boards:
            yield Finding("no_serial_port", "a device with our USB ids is plugged in, but it has no serial port")
        elif not system.loaders:
            yield Finding("no_board", "no serial port has our USB ids")
        return
    if not system.permitted:
        yield Finding("no_permission", f"no permission to open {facts.port}; it is owned by {system.owner}")
    elif isinstance(error, errors.PortBusyError) or (isinstance(error, errors.PortError) and system.holders):
        yield Finding("port_busy", f"{facts.port} is in use by {holders_text(system.holders)}")
    elif error is not None and not isinstance(error, tuple(BY_ERROR)):
        yield Finding("port_failed", str(error))
    elif system.holders:
        yield Finding("port_shared", f"{facts.port} is also open in {holders_text(system.holders)}")
    if system.modem_manager and not system.left_alone:
        yield Finding("modem_manager", f"ModemManager is running, and udev has no ID_MM_DEVICE_IGNORE for {facts.port}")
    for kind, code in BY_ERROR.items():
        if isinstance(error, kind):
            yield Finding(code, str(error))
    if facts.board is not None:
        for warning in facts.board.warnings:
            yield Finding(warning.code, warning.text)
        hello = facts.board.hello
        if (hello.firmware_major, hello.firmware_minor, hello.firmware_patch) < release(__version__):
            yield Finding("firmware_older", f"firmware {version_text(hello)}, this package {__version__}")


def release(version: str) -> tuple[int, ...]:
    """The numbers of a version, without a development version's suffix."""
    numbers = re.match(r"\d+(\.\d+)*", version)
    return tuple(map(int, numbers[0].split("."))) if numbers else ()
