"""Opening the link that a PORT string names."""

from __future__ import annotations

import importlib
import os
import re
from collections.abc import Callable

from .. import extra
from ..errors import PortError
from .base import Link
from .port_text import player

#: The kinds of port by form, and MODULE:FUNCTION that opens each. These are names, imported only when such a port is
#: opened: this folder does not depend on those above it, and the user of a real board does not wait for the simulator
#: to load. Other kinds are extras (biotac.extra).
FORMS = {
    "serial:NUMBER": "biotac.link.discovery:open_serial",
    "uart:DEVICE?baud=N": "biotac.link.serial_port:open_uart",
    "spidev:BUS.DEVICE": "biotac.link.spidev:SpidevLink",
    "socket://HOST:PORT": "biotac.link.serial_port:SerialLink",
    "rfc2217://HOST:PORT": "biotac.link.serial_port:SerialLink",
    "sim:SOURCE": "biotac.sim.ports:open_sim",
    "replay:REC": "biotac.recording.replay.link:open_replay",
}
OPENERS = {form.partition(":")[0]: opener for form, opener in FORMS.items()}
_KIND = re.compile(r"(?!COM\d*$)[A-Za-z][A-Za-z0-9_-]+", re.IGNORECASE)  # COM3: is a device's on Windows
PATH = "biotac.link.serial_port:SerialLink"
PACED = ("sim", "replay")  # their functions need the default pace; the others have a pace themselves


def open_link(port: str, *, pace: float = 0.0) -> Link:
    """Open a PORT. ``pace`` applies to simulated boards and recordings that do not name one.

    Raises PortError for an unknown, missing, busy or forbidden port, InputError for a source that
    cannot be played, or an extra that fails.
    """
    scheme, colon, _ = port.partition(":")
    known = colon and scheme in OPENERS
    if not known and colon and _KIND.fullmatch(scheme):
        try:
            opened: Link = extra.call(extra.PORTS, scheme, lambda open_port: open_port(port, pace))
            return opened
        except OSError as error:
            raise PortError(
                f"{port} cannot be opened ({error.strerror or error}); see what `{scheme}:` needs"
            ) from error
        except KeyError:
            if needed := extra.missing(scheme):
                raise PortError(f"{port} needs {needed}") from None
            if os.sep not in port:
                more = ", ".join(f"{name}:" for name in extra.names(extra.PORTS))
                raise PortError(
                    f"unknown kind of port {scheme!r}; expected a device path, {', '.join(FORMS)}; or {more}"
                ) from None
    cure = player(port)
    if cure and not known:
        raise PortError(f"{port} is a file, not a port; play it with {cure}:{port}")
    module, _, function = (OPENERS[scheme] if known else PATH).partition(":")
    opener: Callable[..., Link] = getattr(importlib.import_module(module), function)
    return opener(port, pace) if scheme in PACED else opener(port)
