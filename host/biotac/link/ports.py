"""PORT strings to links."""

from __future__ import annotations

import importlib
import os

from ..errors import PortError
from .base import Link

#: Who opens which kind of port: MODULE:FUNCTION of the port and the default pace. By name, and imported when a port
#: of that kind is opened: this room knows none of those above it, and a user of a real board waits for no physics.
OPENERS = {
    "serial": "biotac.link.discovery:open_serial",
    "uart": "biotac.link.serial_port:open_uart",
    "spidev": "biotac.link.spidev:open_spidev",
    "socket": "biotac.link.url_port:open_url",
    "rfc2217": "biotac.link.url_port:open_url",
    "sim": "biotac.sim.ports:open_sim",
    "emu": "biotac.sim.ports:open_sim",
    "replay": "biotac.recording.replay_link:open_replay",
    "zenoh": "biotac.fleet.zenoh_link:open_zenoh",
}
PATH = "biotac.link.serial_port:open_path"


def open_link(port: str, *, pace: float = 0.0) -> Link:
    """Open a PORT. ``pace`` applies to simulated boards and recordings that do not name one.

    Raises PortError for an unknown, missing, busy or forbidden port, InputError for a source that
    cannot be played.
    """
    scheme, colon, _ = port.partition(":")
    known = colon and scheme in OPENERS
    if not known and colon and os.sep not in port and not port.upper().startswith("COM") and len(scheme) > 1:
        raise PortError(
            f"no kind of port is called {scheme!r}; expected a device path, serial:NUMBER, "
            "uart:DEVICE?baud=N, spidev:BUS.DEVICE, socket://HOST:PORT, rfc2217://HOST:PORT, sim:SOURCE, emu:pico, "
            "replay:REC or zenoh:NAME"
        )
    module, _, function = (OPENERS[scheme] if known else PATH).partition(":")
    link: Link = getattr(importlib.import_module(module), function)(port, pace)
    return link
