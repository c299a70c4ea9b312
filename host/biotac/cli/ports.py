"""The port that is meant when none is named."""

from __future__ import annotations

from serial.tools import list_ports

from ..errors import PortError


def only_port() -> str:
    """The one serial port of this computer; PortError when there is none or a choice."""
    ports = sorted(port.device for port in list_ports.comports())
    if len(ports) == 1:
        return str(ports[0])
    seen = f"{len(ports)} serial ports: {', '.join(ports)}" if ports else "no serial port"
    cure = "name one" if ports else "plug a board in, or try a simulated one: sim:press.toml"
    raise PortError(f"{seen}; {cure}")
