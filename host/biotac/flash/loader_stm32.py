"""The STM32's boot loader in ROM, over the UART that is the board's link (AN3155), by the package stm32loader.

Its flash is erased in sectors: the first has but where to begin; settings are between it and the image's, and nothing
here touches them. A board's flash.json says what is where. The package, GPL-3 and optional, is imported because its
command line counts pages of 1 KiB from address 0, which are no sectors, or erases everything, settings included.
"""

from __future__ import annotations

import contextlib
import io
from itertools import pairwise
from typing import Any

from ..errors import BiotacError, DeviceLostError, FlashError, NotAGatewayError, installing
from ..hand.hand import Hand
from ..link.ports import open_link
from ..link.serial_port import open_error
from .image import Image
from .interfaces import Loader, Show, Target
from .waiting import wait_for

LOADER_BAUD = 115_200  # it finds the rate by the first byte; the chip's own oscillator is good for this one
BACK_S = 10.0
FIRST_WORDS = 8  # stack and reset, the first of the image, again where the flash begins


class UartTarget(Target):
    """A board on a serial port without USB: ``uart:DEVICE?baud=N``."""

    def __init__(self, port: str) -> None:
        self.port = port

    def port_exists(self) -> bool:
        """False: whether it runs or is in its loader, the port is there."""
        return False

    def open(self) -> Hand:
        try:
            return Hand(open_link(self.port))
        except NotAGatewayError as error:
            rate = "baud= has to be the board's uart_bits_per_s, 921600 unless another was saved"
            raise NotAGatewayError(f"{error}; {rate}") from error

    def touch(self) -> None:
        raise FlashError(f"{self.port} does not enter its loader: hold BOOT0 high, reset it, and flash again")

    def reopen(self) -> Hand:
        hand = wait_for(self._try, BACK_S)
        if hand is None:
            raise DeviceLostError(f"{self.port} does not answer after {BACK_S:.0f} s; reset it with BOOT0 low")
        return hand

    def _try(self) -> Hand | None:
        try:
            return self.open()
        except BiotacError:
            return None


class Stm32Loader(Loader):
    """The loader at the other end of ``device``."""

    def __init__(self, device: str) -> None:
        self.name = f"STM32's loader on {device}"
        self._device = device
        self._board: Any = None

    def ready(self) -> bool:
        try:
            from stm32loader import bootloader, uart
        except ImportError as error:
            raise FlashError(f"an STM32 is flashed by the package stm32loader: {installing('stm32')}") from error
        self.close()
        connection = uart.SerialConnection(self._device, LOADER_BAUD, "E")
        try:
            connection.connect()
        except OSError as error:
            raise open_error(self._device, error) from error
        connection.timeout = 0.5
        self._error: type[Exception] = bootloader.Stm32LoaderError
        board = bootloader.Stm32Bootloader(connection, device_family="F4", verbosity=0)
        self._board = board
        board.write(board.Command.SYNCHRONIZE)
        # One that was asked before says that it did not understand.
        if bytes(connection.read()) in (bytes([board.Reply.ACK]), bytes([board.Reply.NACK])):
            connection.timeout = 5
            return True
        self.close()
        return False

    def cure(self) -> str:
        usb = "feed it by a charger (with a computer at its USB it listens there, 0483:df11, and to no UART)"
        return f"connect {self._device} to the board's loader UART, {usb}, hold BOOT0 high and reset it"

    def write(self, image: Image, show: Show) -> None:
        """Write and read back; where the chip begins comes last, so that half an image never starts."""
        data = b"".join(image.blocks)
        data += b"\xff" * (-len(data) % 4)
        assert image.chip is not None  # a .bin has one
        known = image.chip
        from_, to = known.image_at - known.flash_at, known.image_at - known.flash_at + len(data)
        sectors = [k for k, (at, end) in enumerate(pairwise(known.sectors)) if k == 0 or (end > from_ and at < to)]
        try:
            self._board.get()
            chip = self._board.get_id()
            if chip != known.id:
                raise FlashError(
                    f"{self.name} says that its chip is 0x{chip:03X}; {image.path} is for "
                    f"0x{known.id:03X}: nothing was written; connect that board"
                )
            with contextlib.redirect_stderr(io.StringIO()):  # the package says there that it takes ten seconds
                self._board.erase_memory(sectors)
            for k, block in enumerate(image.blocks):
                self._put(known.image_at + k * len(image.blocks[0]), block)
                show(k + 1, len(image.blocks))
            self._put(known.flash_at, data[:FIRST_WORDS])
            self._board.go(known.flash_at)
        except (OSError, ValueError, IndexError, self._error) as error:
            cure = "reset the board with BOOT0 high, and flash again"
            raise FlashError(f"{self.name} stopped: {error}; {cure}") from error
        finally:
            self.close()

    def _put(self, address: int, data: bytes) -> None:
        self._board.write_memory_data(address, data)
        if bytes(self._board.read_memory_data(address, len(data))) != data:
            raise FlashError(f"{self.name} reads back other bytes at 0x{address:08X} than were written; flash again")

    def close(self) -> None:
        """Let go of the port. Safe to call twice."""
        if self._board is not None:
            self._board.connection.disconnect()
            self._board = None
