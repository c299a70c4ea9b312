"""Ways to reach a board; a PORT string names one.

``/dev/ttyACM0``, ``COM3``   a serial port
``serial:NUMBER``            the board with that serial number
``uart:DEVICE?baud=N``       a board's UART, at its setting uart_bits_per_s
``socket://HOST:PORT``       a serial port that another computer shares over TCP
``rfc2217://HOST:PORT``      the same, with its line settings
``spidev:0.0,0.1``           sensors on this computer's own SPI bus, one device per finger
``sim:SOURCE``               a simulated board playing a scenario or a recording
``emu:pico?source=SOURCE``   the same, with a board's flash image in an emulator
``replay:REC``               a recording, which answers as its board did
``zenoh:NAME``               a board that another computer shares (biotac share)
"""

from __future__ import annotations

from .base import Link
from .ports import open_link

__all__ = ["Link", "open_link"]
