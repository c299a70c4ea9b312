"""Physics in the loop: a program gives the simulated fingers their load round by round, and gets the board's answer.

    from biotac.sim import SimFinger, SimTouch, world

    with world({"index": SimFinger(1), "thumb": SimFinger(2, "worn")}) as w:
        now = w.step(index=SimTouch(normal_n=2.0, shear_n=(0.0, 0.5)), thumb=SimTouch(normal_n=2.0))
        print(now["index"].frame.force_n, now.events)

The firmware runs in lock-step: device time stands still until the next load has come, so the same loads give the same
bytes, however slow the program is. On boards of silicon time is real (biotac_rig's ``wired_world``). A controller of
another rate steps so many rounds before each of its own.
"""

from __future__ import annotations

import math
import threading
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from typing import Any, TypeVar

from .. import extra
from ..errors import DeviceLostError, InputError
from ..hand.hand import Hand
from ..hand.opening import shake_hands
from ..hand.rounds import FingerRound, Round
from ..wire.messages_gen import Setting
from ..wire.slots import FRAME_HZ
from .board import STEP_ROUNDS, SimBoard, SimLink
from .live import LiveFingers
from .physics import SimFinger
from .ports import SIM, start_board
from .sampling import Words
from .serve import Served
from .touch import Load

PATIENCE_S = 60.0
BOOT_S = 0.25  # of a board, until it samples again
WATCHDOG_S = 2.0
AWAY_S = 0.5  # until a computer has found a port that came back
STREAMS = ("results", "events")
AnyWorld = TypeVar("AnyWorld", bound="World")


class World(ABC):
    """Simulated fingers and the hand that reads them."""

    #: Rounds that had not come when the gateway began them: none where time waits for them.
    rounds_late = 0

    def __init__(self, fingers: LiveFingers, hand: Hand | None, closes: ExitStack) -> None:
        #: The ordinary Hand, streaming; None when another program has the board's port.
        self.hand: Hand = hand  # type: ignore[assignment]
        self._fingers = fingers
        self._closes = closes

    def __enter__(self: AnyWorld) -> AnyWorld:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End it. Safe to call twice."""
        self._closes.close()

    @abstractmethod
    def step(self, **loads: Load) -> Round:
        """Let one round of 10 ms pass, with these loads by finger; a finger without one is not touched.

        A load is the contact at the end of the round: a SimTouch, several at once, or a Course through the round. It is
        reached in a straight line from where the round before ended. Returns the frames and events of this round, on
        real time those of the newest that has come; of a board that is silent or unplugged, none. Raises
        InputError or KeyError for a wrong load, and then no time has passed; DeviceLostError when the board has ended,
        and TimeoutError when on real time nothing comes.
        """

    def run(self, seconds: float, **loads: Load) -> Round:
        """Step with the same loads for so long, or without any; the last round, with the events of all.

        So are ``missed`` and ``events_lost``. Raises InputError unless seconds is above 0.
        """
        return _as_one([self.step(**loads) for _ in range(_rounds_of(seconds))])

    def fault(self, finger: str, kind: str | None, channel: str | None = None) -> None:
        """Lay a fault on a finger from the next round on; None ends all of that finger's.

        ``kind`` is one of biotac.sim.EVERY_FAULT; ``channel`` the electrode that breaks, "E17" by default, or for a
        fault of the bus the channel that it hits, by default all. Raises InputError for an unknown fault or channel.
        """
        self._fingers.fault(finger, kind, channel)


class LockStep(World):
    """Simulated fingers on a simulated board; device time passes only in ``step``. Made by ``world``."""

    def __init__(
        self, fingers: LiveFingers, board: SimBoard, hand: Hand | None, closes: ExitStack, port: str = ""
    ) -> None:
        super().__init__(fingers, hand, closes)
        #: The board's pty, for a C client, ROS or `biotac view` in place of ``hand``; empty where there is a hand.
        self.port = port
        self._board = board
        self._rounds = hand.rounds() if hand is not None else None
        self._dead = self._away = self._stalled = 0  # for so many more rounds
        self._turn = threading.Lock()

    @property
    def _link(self) -> SimLink | None:
        link = self.hand.link if self.hand is not None else None
        return link if isinstance(link, SimLink) else None

    def step(self, **loads: Load) -> Round:
        return self._step(1, loads)

    def run(self, seconds: float, **loads: Load) -> Round:
        left, rounds = _rounds_of(seconds), list[Round]()
        while left:
            link, is_disturbed = self._link, self._dead or self._away or self._stalled
            count = 1 if is_disturbed or (link is not None and link.reopened) else min(left, STEP_ROUNDS)
            now, left = self._step(count, loads), left - count
            rounds.append(replace(now, missed=max(0, now.missed - count + 1)))
        return _as_one(rounds)

    def _step(self, rounds: int, loads: Mapping[str, Load]) -> Round:
        if not self._turn.acquire(blocking=False):
            raise InputError("another thread is stepping this world, expected one thread; give each a world of its own")
        try:
            return self._next(rounds, loads)
        finally:
            self._turn.release()

    def _next(self, rounds: int, loads: Mapping[str, Load]) -> Round:
        words, link = self._fingers.read(loads, rounds), self._link
        if link is not None and link.reopened and not link.away:
            self._reconnect()  # the program itself restarted the board
        if self._dead:
            self._dead -= 1
            if self._dead == 0:
                self._reset()
        else:
            self._advance(words)
        if self._away:
            self._away -= 1
            if self._away == 0:
                self._reconnect()
        self._stalled = max(0, self._stalled - 1)
        if self._stalled or self._rounds is None or link is None or link.away:
            return Round(-1, -1, 0, {name: FingerRound(None, ()) for name in self._fingers.names}, ())
        return self._rounds.pop()

    # ---- faults of the board -------------------------------------------------------------------

    def restart(self, *, boot_s: float = BOOT_S, away_s: float = AWAY_S) -> None:
        """Reset the board now: it boots for ``boot_s``, and the port is away for ``away_s`` in all.

        The hand connects again by itself. Settings and maps are restored as on a board, tares are not.
        """
        dead, away = _rounds_of(boot_s), _rounds_of(away_s)
        link = self._checked_link()
        before = self._away if link.away else 0  # while it hung, the port was to go
        self._pull()
        self._dead, self._away = dead, max(before, away, dead + 1)

    def cut_power(self, seconds: float) -> None:
        """Cut the board's power for so long; then it boots, and the port comes back."""
        _rounds_of(seconds)  # also refuses a negative time that BOOT_S would make positive
        self.restart(boot_s=seconds + BOOT_S, away_s=seconds + AWAY_S)

    def hang(self, seconds: float = WATCHDOG_S) -> None:
        """The board does nothing for so long, while the port stays; then the watchdog resets it."""
        dead = _rounds_of(seconds)
        self._checked_link()
        self._dead, self._away = dead, max(self._away, dead + _rounds_of(AWAY_S))

    def unplug(self, seconds: float) -> None:
        """Pull the cable to the host for so long. The board has another power supply, and goes on."""
        away = _rounds_of(seconds)
        if not self._checked_link().away:
            self.hand.ping()  # as the keep-alive of a stream in real time: a HOLD lapses no sooner here
        self._pull()
        self._away = max(self._away, away)

    def stall_host(self, seconds: float) -> None:
        """Let the program stand still for so long: steps return nothing, then all events that came meanwhile."""
        stalled = _rounds_of(seconds) + 1
        self._checked_link()
        self._stalled = stalled

    def _checked_link(self) -> SimLink:
        if self._link is None:
            raise InputError("this needs a hand on a board in this process; leave `hand` and `board` out")
        if self.hand.closed:
            raise InputError("the world was closed, expected one that runs; start another")
        return self._link

    def _pull(self) -> None:
        self._checked_link().pull()
        until_s = time.monotonic() + PATIENCE_S
        while self.hand.connected:
            if time.monotonic() > until_s:
                raise DeviceLostError("the simulated hand did not notice that its cable is out; start another world")
            time.sleep(0.001)

    def _reset(self) -> None:
        if self._link is not None and not self._link.away:  # it hung until now
            self._pull()
        self._board.restart()

    def _reconnect(self) -> None:
        link, wanted, until_s = self._link, self.hand.streaming, time.monotonic() + PATIENCE_S
        assert link is not None
        if link.away:
            link.push()
        while time.monotonic() < until_s:
            self.hand.check()
            if self.hand.connected and (not wanted or self.hand.status().streams):
                break
            time.sleep(0.001)
        link.reopened = False

    def _advance(self, words: Words) -> None:
        """Let these rounds pass, and pass the board's bytes on to the hand, or to another program."""
        if self._link is None or self._link.away:
            self._board.put(words)
        else:
            self.hand.check()
            self.hand.take(lambda: self._board.step(words))


def world(
    fingers: Mapping[str, SimFinger],
    *,
    maps: Mapping[str, Any] | None = None,
    settings: Mapping[str, int] | None = None,
    streams: Sequence[str] = STREAMS,
    board: str = SIM,
    image: str | None = None,
    hand: bool = True,
) -> LockStep:
    """Start a board with these simulated fingers, each named, in the order of their chip selects.

    ``maps`` are wrench maps by finger (Hand.board.set_map), ``settings`` by name in link.toml, and ``streams`` the
    hand's (Hand.stream). ``board`` is "sim", the firmware in this process, or "pico", the Pico's flash image in the
    emulator. With ``hand=False`` another program must open ``LockStep.port``: the board waits for a reader. A HOLD does
    not lapse here, because time waits for the program. Raises PortError when the board does not
    start, InputError or CommandRefusedError for a wrong setting or map.
    """
    feed = LiveFingers(fingers)
    maps, settings = dict(maps or {}), {name.upper(): value for name, value in (settings or {}).items()}
    if wrong := [*(settings.keys() - Setting.__members__.keys()), *(maps.keys() - feed.names.keys())]:
        raise InputError(f"{wrong[0]!r} is none of them, expected a setting of link.toml, or a finger for a map")
    if not hand and (maps or settings):
        raise InputError("maps and settings are given with hand=False, expected a hand that sends them; leave them out")
    with ExitStack() as closes:
        started = start_board(board, feed.at_rest(), pace=0.0, live=True, image=image)
        closes.callback(started.close)
        opened, port = None, ""
        if hand:
            opened = closes.enter_context(shake_hands(started.link("sim:live"), fingers=feed.names, reconnect=True))
            for name, value in settings.items():
                opened.board.set_setting(Setting[name], value)
            for name, board_map in maps.items():
                opened.board.set_map(name, board_map, force=True)
            opened.stream(*streams)
        else:
            served: Any = closes.enter_context(closing(Served(started))) if board == SIM else started
            port = served.path
            started.release()
        kind = LockStep if board == SIM else extra.rig(board, lambda rig: rig.EmulatedWorld)
        made: LockStep = kind(feed, started, opened, closes, port)
        made._advance(started.source.samples[:0])
        made._closes = closes.pop_all()
    return made


def _as_one(rounds: Sequence[Round]) -> Round:
    """The last of these rounds, with the events of all."""
    return replace(
        rounds[-1],
        missed=sum(now.missed for now in rounds),
        events=tuple(event for now in rounds for event in now.events),
        events_lost=sum(now.events_lost for now in rounds),
    )


def _rounds_of(seconds: float) -> int:
    if not 0.0 < seconds < math.inf:  # NaN too
        raise InputError(f"seconds is {seconds!r}, expected a number above 0")
    return max(1, round(seconds * FRAME_HZ))
