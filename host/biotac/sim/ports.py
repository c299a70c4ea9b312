"""Simulated boards by PORT: ``sim:SOURCE``, and ``emu:BOARD?source=SOURCE`` of biotac-rig."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, cast

from .. import extra
from ..errors import InputError, PortError
from ..link.port_text import options_of, parse_pace
from .board import SimBoard, SimLink
from .loading import load_source
from .source import Source

SIM = "sim"  # the board in this process


@dataclass(frozen=True)
class SimPort:
    """A parsed ``sim:SOURCE?...`` or ``emu:BOARD?source=SOURCE&...``."""

    board: str  # SIM, or the name of an emulated board
    source: str
    pace: float
    fingers: int | None = None
    seconds: float | None = None
    clock_s: float = 0.0
    image: str | None = None
    verbs: tuple[str, ...] = ()  # done to an emulated board before it boots


FORMS = {
    "sim": "sim:SOURCE?pace=X&fingers=N&seconds=S&clock_s=T",
    "emu": "emu:pico?source=SOURCE&image=FILE&pace=X&fingers=N&seconds=S&do=VERB;VERB",
}


def _clock_s(text: str) -> float:
    if not 0 <= float(text) < 2**32 / 1e6:
        raise ValueError(f"clock_s is {text}, expected seconds from 0 to below 4294.967296, where the clock wraps")
    return float(text)


_READ: dict[str, Callable[[str], object]] = {"pace": parse_pace, "fingers": int, "seconds": float, "clock_s": _clock_s}
_OPTIONS = {
    "sim": {"pace", "fingers", "seconds", "clock_s"},
    "emu": {"pace", "fingers", "seconds", "source", "image", "do"},
}


def parse_sim(port: str, pace: float) -> SimPort:
    """Split a sim: or emu: port; ``pace`` is the default, in device seconds per second (0: unpaced)."""
    scheme = port.partition(":")[0]
    head, options = options_of(port, _OPTIONS[scheme], FORMS[scheme])
    board, source = (SIM, head) if scheme == "sim" else (head, options.pop("source", ""))
    if not source:
        raise PortError(f"{port}: no source: expected {FORMS[scheme]}")
    verbs = tuple(filter(None, options.pop("do", "").split(";")))
    try:
        given: dict[str, Any] = {name: _READ.get(name, str)(text) for name, text in options.items()}
    except ValueError as error:
        raise PortError(f"{port}: {error}; expected {FORMS[scheme]}") from error
    return SimPort(board, source, verbs=verbs, **{"pace": pace, **given})


def open_sim(port: str, pace: float) -> SimLink:
    """Open a sim: or emu: port. Raises PortError, or InputError for a source that cannot be played."""
    sim = parse_sim(port, pace)
    source = load_source(sim.source, fingers=sim.fingers, seconds=sim.seconds)
    board = start_board(sim.board, source, pace=sim.pace, clock_s=sim.clock_s, image=sim.image, verbs=sim.verbs)
    return board.link(port)


def start_board(
    board: str,
    source: Source,
    *,
    pace: float,
    live: bool = False,
    clock_s: float = 0.0,
    image: str | None = None,
    verbs: Sequence[str] = (),
) -> SimBoard:
    """Start a simulated board, held until released: SIM, the firmware in this process, or an emulated one.

    ``live``: ``source`` has the first rounds, and time stands still until the next ones have come to the sensors.
    Raises PortError with the missing part and how to get it.
    """
    if board == SIM:
        return SimBoard(source, pace=pace, live=live, clock_s=clock_s)
    if board == "posix":
        raise InputError(f"the board posix was a process; it is in this program now, and is called {SIM}")
    how: dict[str, Any] = {"pace": pace, "hold": True, "live": live, "image": image, "verbs": verbs}
    return extra.rig(f"a {board} in an emulator", lambda rig: cast(SimBoard, rig.start_board(board, source, **how)))
