"""The EEPROMs on the harnesses of sensors on this computer's own bus: ``spidev:0.0,0.1?calibration=...``.

Such a board has no flash of its own; what its fingers' harnesses hold is given to it when it is opened.
"""

from __future__ import annotations

from ..errors import PortError
from . import eeprom
from .chip import KINDS, Chip, parse_place
from .values import Calibration

FORM = "spidev:0.0,0.1?calibration=1:0x50:24c02,1:0x51:24c02"


def parse(port: str) -> tuple[str, dict[int, tuple[str, str]]]:
    """The port without its option, and each finger's (place, kind); PortError for what is neither.

    Places stand in the order of the fingers; a finger whose place is empty has none.
    """
    bare, _, option = port.partition("?")
    key, _, texts = option.partition("=")
    if option and key != "calibration":
        raise PortError(f"{port}: option {key!r} is unknown; expected {FORM}")
    places: dict[int, tuple[str, str]] = {}
    for finger, text in enumerate(texts.split(",")):
        if not text:
            continue
        place, _, kind = text.rpartition(":")
        if kind not in KINDS:
            raise PortError(f"{port}: {text!r} names no kind of EEPROM ({', '.join(KINDS)}); expected {FORM}")
        parse_place(place)
        places[finger] = (place, kind)
    fingers = bare.count(",") + 1
    if places and max(places) >= fingers:
        raise PortError(f"{port}: {max(places) + 1} EEPROMs for {fingers} finger(s); expected one for each at most")
    return bare, places


def load(port: str) -> tuple[str, dict[int, Calibration]]:
    """The port without its option, and what each finger's EEPROM holds.

    Raises PortError for an EEPROM that cannot be reached, InputError for one without a calibration.
    """
    bare, places = parse(port)
    own = {}
    for finger, (place, kind) in places.items():
        with Chip(place, kind) as chip:
            own[finger] = eeprom.load(chip)
    return bare, own
