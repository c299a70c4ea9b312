"""A hand on a scripted board, for the tests of this folder."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import suppress

import pytest
from live_board import Firmware, Live

import biotac
from biotac.board import watch
from biotac.link.serial_port import SerialLink


@pytest.fixture
def live(scripted_board, hello) -> Iterator[Live]:
    firmware = Firmware(hello)
    live = Live(scripted_board(firmware), firmware)
    yield live
    with suppress(biotac.BiotacError, OSError):  # what a test is about, it has looked at
        live.hand.close()


@pytest.fixture
def quick(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    """The watch looks all the time, and waits for answers as long as ever."""
    monkeypatch.setattr(watch, "LOOK_S", 0.005)
    monkeypatch.setattr(SerialLink, "patience", 12_000.0)
    return lambda: None
