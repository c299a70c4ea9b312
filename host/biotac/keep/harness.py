"""EEPROMs on the harnesses of sensors that are on this computer's own bus: ``spidev:0.0,0.1?calibration=...``.

Such a port has no flash. The calibrations in the fingers' harnesses are loaded when it is opened.
"""

from __future__ import annotations

from ..errors import PortError
from . import eeprom
from .calibration import Calibration
from .chip import Chip, parse_chip

FORM = "spidev:0.0,0.1?calibration=1:0x50:24c02,1:0x51:24c02"


def parse(port: str) -> tuple[str, dict[int, tuple[str, str]]]:
    """The port without the option, and each finger's EEPROM as (address, kind). Raises PortError for anything else.

    EEPROMs are listed in the order of the fingers; an empty entry is a finger without one.
    """
    bare, _, option = port.partition("?")
    key, _, texts = option.partition("=")
    if option and key != "calibration":
        raise PortError(f"{port}: option {key!r} is unknown; expected {FORM}")
    eeproms: dict[int, tuple[str, str]] = {}
    for finger, text in enumerate(texts.split(",")):
        if text:
            eeproms[finger] = parse_chip(text)
    fingers = bare.count(",") + 1
    if eeproms and max(eeproms) >= fingers:
        raise PortError(f"{port}: {max(eeproms) + 1} EEPROMs for {fingers} finger(s); expected at most one per finger")
    return bare, eeproms


def load(port: str) -> tuple[str, dict[int, Calibration]]:
    """The port without the option, and the calibration in each finger's EEPROM."""
    bare, eeproms = parse(port)
    own = {}
    for finger, (address, kind) in eeproms.items():
        with Chip(address, kind) as chip:
            own[finger] = eeprom.load(chip)
    return bare, own
