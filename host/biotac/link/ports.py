"""Opening the link that a PORT string names."""

from __future__ import annotations

import importlib
import os
from collections.abc import Callable

from ..errors import PortError
from .base import Link
from .port_text import player

#: The kinds of port by their forms, and what opens each, as MODULE:FUNCTION. These are names, imported only when such a
#: port is opened: this folder does not depend on those above it, and the user of a real board does not wait for the
#: simulator to load.
FORMS = {
    "serial:NUMBER": "biotac.link.discovery:open_serial",
    "uart:DEVICE?baud=N": "biotac.link.serial_port:open_uart",
    "spidev:BUS.DEVICE": "biotac.link.spidev:SpidevLink",
    "socket://HOST:PORT": "biotac.link.serial_port:SerialLink",
    "rfc2217://HOST:PORT": "biotac.link.serial_port:SerialLink",
    "sim:SOURCE": "biotac.sim.ports:open_sim",
    "emu:pico": "biotac.sim.ports:open_sim",
    "replay:REC": "biotac.recording.replay.link:open_replay",
    "bag:FILE": "biotac.foreign.ports:open_bag",
    "csv:FILE": "biotac.foreign.ports:open_csv",
    "foxglove://HOST:PORT/TOPIC": "biotac.foreign.ports:open_foxglove",
    "zenoh:NAME": "biotac.fleet.zenoh_link:ZenohLink",
}
OPENERS = {form.partition(":")[0]: opener for form, opener in FORMS.items()}
PATH = "biotac.link.serial_port:SerialLink"
PACED = ("sim", "emu", "replay")  # their functions take the default pace; the others have a time of their own


def open_link(port: str, *, pace: float = 0.0) -> Link:
    """Open a PORT. ``pace`` applies to simulated boards and recordings that do not name one.

    Raises PortError for an unknown, missing, busy or forbidden port, InputError for a source that
    cannot be played.
    """
    scheme, colon, _ = port.partition(":")
    known = colon and scheme in OPENERS
    if not known and colon and os.sep not in port and not port.upper().startswith("COM") and len(scheme) > 1:
        *most, last = FORMS
        raise PortError(f"unknown kind of port {scheme!r}; expected a device path, {', '.join(most)} or {last}")
    cure = player(port)
    if cure and not known:
        raise PortError(f"{port} is a file, not a port; play it with {cure}:{port}")
    module, _, function = (OPENERS[scheme] if known else PATH).partition(":")
    opener: Callable[..., Link] = getattr(importlib.import_module(module), function)
    return opener(port, pace) if scheme in PACED else opener(port)
