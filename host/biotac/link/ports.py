"""PORT strings to links."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from urllib.parse import parse_qsl

from ..errors import PortError
from .base import Link
from .serial_port import SerialLink


@dataclass(frozen=True)
class SimPort:
    """A parsed ``sim:SOURCE?pace=X&fingers=N&seconds=S``."""

    source: str
    pace: float
    fingers: int | None
    seconds: float | None


def parse_sim(port: str, pace: float) -> SimPort:
    """Split a sim: port; ``pace`` is the default, in device seconds per second (0: unpaced)."""
    source, _, query = port.removeprefix("sim:").partition("?")
    options = dict(parse_qsl(query))
    unknown = set(options) - {"pace", "fingers", "seconds"}
    if unknown or not source:
        seen = f"option {sorted(unknown)[0]!r}" if unknown else "no source"
        raise PortError(f"{port}: {seen}; expected sim:SOURCE?pace=X&fingers=N&seconds=S")
    try:
        return SimPort(
            source,
            parse_pace(options["pace"]) if "pace" in options else pace,
            int(options["fingers"]) if "fingers" in options else None,
            float(options["seconds"]) if "seconds" in options else None,
        )
    except ValueError as error:
        raise PortError(f"{port}: {error}; an example is sim:press.toml?pace=real&fingers=2&seconds=5") from error


def parse_pace(text: str) -> float:
    """``real``, ``fast`` or device seconds per second."""
    named = {"real": 1.0, "fast": 0.0}
    try:
        pace = named[text] if text in named else float(text)
    except ValueError:
        pace = math.nan
    if not 0 <= pace < math.inf:
        raise ValueError(f"pace is {text!r}, expected real, fast or device seconds per second")
    return pace


def open_link(port: str, *, pace: float = 0.0) -> Link:
    """Open a PORT. ``pace`` applies to simulated boards that do not name one.

    Raises PortError for an unknown, missing, busy or forbidden port, InputError for a source that
    cannot be played.
    """
    scheme, colon, _ = port.partition(":")
    if scheme == "sim" and colon:
        # Imported here: a user of a real board needs neither the physics nor its import time.
        from ..sim.source import load_source
        from .sim_process import SimLink

        sim = parse_sim(port, pace)
        source = load_source(sim.source, fingers=sim.fingers, seconds=sim.seconds)
        return SimLink(port, source, pace=sim.pace)
    if scheme == "spidev" and colon:
        from .spidev_link import SpidevLink

        return SpidevLink(port)
    if colon and os.sep not in port and not port.upper().startswith("COM") and len(scheme) > 1:
        raise PortError(
            f"no kind of port is called {scheme!r}; expected a device path, spidev:BUS.DEVICE or sim:SOURCE"
        )
    return SerialLink(port)
