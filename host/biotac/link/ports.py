"""PORT strings to links."""

from __future__ import annotations

import math
import os
from dataclasses import dataclass
from typing import TYPE_CHECKING
from urllib.parse import parse_qsl

from ..errors import PortError
from .base import Link
from .serial_port import SerialLink

if TYPE_CHECKING:
    from ..sim.process import SimBoard
    from ..sim.source import Source


@dataclass(frozen=True)
class SimPort:
    """A parsed ``sim:SOURCE?...`` or ``emu:BOARD?source=SOURCE&...``."""

    board: str  # "posix", or what is emulated
    source: str
    pace: float
    fingers: int | None
    seconds: float | None
    image: str | None


FORMS = {
    "sim": "sim:SOURCE?pace=X&fingers=N&seconds=S",
    "emu": "emu:pico?source=SOURCE&image=FILE&pace=X&fingers=N&seconds=S",
}
EXAMPLES = {
    "sim": "sim:press.toml?pace=real&fingers=2&seconds=5",
    "emu": "emu:pico?source=press.toml&pace=real&fingers=2&seconds=5",
}
COMMON_OPTIONS = {"pace", "fingers", "seconds"}


def parse_sim(port: str, pace: float) -> SimPort:
    """Split a sim: or emu: port; ``pace`` is the default, in device seconds per second (0: unpaced)."""
    scheme, _, rest = port.partition(":")
    head, _, query = rest.partition("?")
    options = dict(parse_qsl(query))
    board, source = ("posix", head) if scheme == "sim" else (head, options.pop("source", ""))
    unknown = set(options) - COMMON_OPTIONS - ({"image"} if scheme == "emu" else set())
    if unknown or not source:
        seen = f"option {sorted(unknown)[0]!r}" if unknown else "no source"
        raise PortError(f"{port}: {seen}; expected {FORMS[scheme]}")
    try:
        return SimPort(
            board,
            source,
            parse_pace(options["pace"]) if "pace" in options else pace,
            int(options["fingers"]) if "fingers" in options else None,
            float(options["seconds"]) if "seconds" in options else None,
            options.get("image"),
        )
    except ValueError as error:
        raise PortError(f"{port}: {error}; an example is {EXAMPLES[scheme]}") from error


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
    """Open a PORT. ``pace`` applies to simulated boards and recordings that do not name one.

    Raises PortError for an unknown, missing, busy or forbidden port, InputError for a source that
    cannot be played.
    """
    scheme, colon, _ = port.partition(":")
    if scheme in FORMS and colon:
        # Imported here: a user of a real board needs neither the physics nor its import time.
        from ..sim.process import SimLink
        from ..sim.source import load_source

        sim = parse_sim(port, pace)
        source = load_source(sim.source, fingers=sim.fingers, seconds=sim.seconds)
        return SimLink(port, start_board(sim.board, source, pace=sim.pace, image=sim.image))
    if scheme == "replay" and colon:
        from ..recording.replay_link import open_replay

        return open_replay(port, pace)
    if scheme == "spidev" and colon:
        from .spidev import SpidevLink

        return SpidevLink(port)
    if colon and os.sep not in port and not port.upper().startswith("COM") and len(scheme) > 1:
        raise PortError(
            f"no kind of port is called {scheme!r}; expected a device path, serial:NUMBER, "
            "spidev:BUS.DEVICE, sim:SOURCE, emu:pico or replay:REC"
        )
    return SerialLink(port)


def start_board(board: str, source: Source, *, pace: float, image: str | None = None) -> SimBoard:
    """Start a board that is a program, held until its release: ``posix`` or an emulated one.

    Raises PortError naming what is missing and how to get it.
    """
    from ..sim.emulated import EmulatedBoard
    from ..sim.process import SimBoard

    if board == "posix":
        return SimBoard(source, pace=pace, hold=True)
    return EmulatedBoard(board, source, pace=pace, hold=True, image=image)
