"""A scale or balance on a serial port, read from the lines that it prints.

It reads two formats that many makers' scales use: MT-SICS (``S S     123.4 g``, and ``S D`` while it moves) and A&D's
(``ST,+00123.4  g``, ``US,`` while it moves; indicators add ``GS,`` or ``NT,`` after that). Both answer the command SI
with a line; a scale that prints by itself may ignore it. Written from published formats and tested with an emulated
scale, never with hardware.
"""

from __future__ import annotations

import re
import time
from collections.abc import Iterator
from urllib.parse import parse_qsl

import serial

from ...errors import InputError, PortError
from ...link.serial_port import open_error

STANDARD_GRAVITY = 9.80665  # m/s2; the local value differs by up to 0.3 %
UNITS_N = {"N": 1.0, "g": 1e-3 * STANDARD_GRAVITY, "kg": STANDARD_GRAVITY}
ASK = b"SI\r\n"
ASK_S = 0.25  # time between requests
PATIENCE_S = 5.0  # a kitchen scale settles in one or two
LEAST_N = 0.1  # less is an empty pan
MAX_LINE_BYTES = 64
_OPTIONS = {"baud": "9600", "bits": "8", "parity": "N", "stop": "1"}
_FORM = "PORT[?baud=9600&bits=8&parity=N&stop=1]"
_WEIGHT = re.compile(
    r"(?:S[IR]*\s+(?P<moving>[SD])|(?P<settled>ST|US),(?:(?:GS|NT),)?)\s*"
    r"(?P<number>[-+]?\s*\d+(?:\.\d*)?)\s*(?P<unit>[A-Za-z]+)"
)
_BEYOND = re.compile(r"S[IR]*\s+[-+]|OL,.*")


class SerialScale:
    """The scale at ``port``, opened with its options (``?baud=`` etc.)."""

    def __init__(self, port: str, patience_s: float = PATIENCE_S) -> None:
        device, _, query = port.partition("?")
        options = _OPTIONS | dict(parse_qsl(query, keep_blank_values=True))
        self._port, self._patience_s = device, patience_s
        try:
            if set(options) != set(_OPTIONS):
                raise ValueError(f"unknown option {', '.join(set(options) - set(_OPTIONS))}")
            baud, bits, stop = (int(options[key]) for key in ("baud", "bits", "stop"))
            self._serial = serial.serial_for_url(device, do_not_open=True, timeout=0.05, write_timeout=1.0)
            self._serial.baudrate, self._serial.bytesize, self._serial.stopbits = baud, bits, stop
            self._serial.parity = options["parity"].upper()
        except ValueError as error:
            raise InputError(f"{port}: {error}: expected {_FORM}, with the values from the scale's menu") from None
        try:
            self._serial.open()
        except (serial.SerialException, OSError) as error:
            raise open_error(device, error) from error

    def __enter__(self) -> SerialScale:
        return self

    def __exit__(self, *error: object) -> None:
        self._serial.close()

    def force_n(self) -> float:
        """The force in N that the scale shows, once it has settled."""
        seen: list[str] = []
        try:
            self._serial.read(self._serial.in_waiting)  # discards lines from before the press
            for line in self._lines():
                seen.append(line)
                value_n = self._settled_n(line)
                if value_n is not None:
                    return value_n
        except (serial.SerialException, OSError) as error:
            raise PortError(f"{self._port}: lost the connection to the scale ({error}); check its cable") from error
        if not seen:
            raise InputError(
                f"{self._port}: no data from the scale in {self._patience_s:g} s; turn on its output, and give its "
                f"baud rate: {_FORM}"
            )
        if any(_WEIGHT.fullmatch(line) for line in seen):
            raise InputError(
                f"{self._port}: the scale did not settle in {self._patience_s:g} s, its last line was {seen[-1]!r}; "
                "hold still, and start again"
            )
        raise InputError(
            f"{self._port}: {seen[-1]!r} is not a weight: expected lines like 'S S  123.4 g' or 'ST,+0123.4  g'; set "
            f"that format on the scale, or give its baud rate: {_FORM}"
        )

    def _lines(self) -> Iterator[str]:
        """Whole lines for ``patience_s``; asks for one every ASK_S."""
        end = time.monotonic() + self._patience_s
        ask, data = 0.0, b""
        while (now := time.monotonic()) < end:
            if now >= ask:
                self._serial.write(ASK)
                ask = now + ASK_S
            data += self._serial.read(MAX_LINE_BYTES)
            *lines, data = re.split(rb"[\r\n]+", data)
            data = data[-MAX_LINE_BYTES:]
            yield from (line.decode("ascii", "replace").strip() for line in lines if line.strip())

    def _settled_n(self, line: str) -> float | None:
        if _BEYOND.fullmatch(line):
            raise InputError(f"{self._port}: {line!r}: the scale is out of range; press less, or check its pan")
        found = _WEIGHT.fullmatch(line)
        if found is None or found["moving"] == "D" or found["settled"] == "US":
            return None
        unit = found["unit"]
        if unit not in UNITS_N:
            raise InputError(
                f"{self._port}: {line!r}: expected a unit of {', '.join(UNITS_N)}; choose one on the scale"
            )
        value_n = float(found["number"].replace(" ", "")) * UNITS_N[unit]
        if value_n < LEAST_N:
            raise InputError(
                f"{self._port}: {line!r} while a finger should press: expected more; keep pressing until told"
            )
        return value_n
