"""A hand on a scripted board, for the tests of this folder."""

import threading
from collections.abc import Callable, Iterator
from contextlib import suppress
from types import SimpleNamespace

import pytest
from live_board import Clock, Firmware, Live, point, until

import biotac
from biotac.board import recovery
from biotac.link.serial_port import SerialLink

SERIAL = (7,) * 12


@pytest.fixture
def live(scripted_board, hello, request: pytest.FixtureRequest) -> Iterator[Live]:
    """Of a hand with arguments by ``pytest.mark.parametrize("live", [{...}], indirect=True)``."""
    firmware = Firmware(hello)
    live = Live(scripted_board(firmware), firmware, **getattr(request, "param", {}))
    yield live
    with suppress(biotac.BiotacError, OSError):  # the test has already looked at the errors it is about
        live.hand.close()


@pytest.fixture
def look_every(monkeypatch: pytest.MonkeyPatch) -> Callable[[float], None]:
    """Lets the watch look so often, in s."""
    return lambda s: monkeypatch.setattr(recovery, "LOOK_S", s)  # 50 looks of a test would take 17 s


@pytest.fixture
def quick(look_every: Callable[[float], None]) -> None:
    """The watch looks all the time."""
    look_every(0.005)


@pytest.fixture
def world(scripted_board, hello, tmp_path) -> Iterator[SimpleNamespace]:
    """A port that is a symbolic link, boards that can be behind it, and a hand that was opened on it."""
    world = SimpleNamespace(path=tmp_path / "ttyBOARD", clock=Clock(), hand=None)

    def plug(**facts: object) -> SimpleNamespace:
        firmware = Firmware(hello, **({"board_serial": SERIAL} | facts))
        board = scripted_board(firmware)
        point(world.path, board.path)
        return SimpleNamespace(board=board, firmware=firmware)

    def unplug(plugged: SimpleNamespace) -> None:
        point(world.path, "")
        plugged.board.hang_up()  # as the kernel does: a program that reads the port gets an error from now on

    def away(plugged: SimpleNamespace, *steps: Callable[[], object]) -> None:
        """Unplug, and step in each pause of the search, on a thread as a program's, until the board is back."""

        def step(pauses: int) -> None:
            if pauses <= len(steps):
                thread = threading.Thread(target=steps[pauses - 1])
                thread.start()
                thread.join()

        world.clock.while_away = step
        unplug(plugged)
        until(lambda: world.hand.connected and world.clock.pauses == len(steps))

    def opened(plugged: SimpleNamespace, reconnect: bool = True) -> Live:
        link = SerialLink(str(world.path))
        live = Live(plugged.board, plugged.firmware, link, reconnect=reconnect, host_clock=world.clock)
        world.hand = live.hand
        return live

    world.plug, world.unplug, world.away, world.opened = plug, unplug, away, opened
    yield world
    if world.hand is not None:
        with suppress(biotac.BiotacError):
            world.hand.close()
