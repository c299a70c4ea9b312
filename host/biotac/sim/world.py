"""Physics in the loop: a program gives the simulated fingers their load round by round, and gets what the board made of it.

    from biotac.sim import SimFinger, Touch, world

    with world({"index": SimFinger(1), "thumb": SimFinger(2, "worn")}) as w:
        now = w.step(index=Touch(normal_n=2.0, shear_n=(0.0, 0.5)), thumb=Touch(normal_n=2.0))
        print(now["index"].frame.force_n, now.events)

The firmware runs in lock-step: its time stands still until the next load has come, so the same loads give the same
bytes, however slow the program is. A controller of another rate steps so many rounds before each of its own.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from ..errors import DeviceLostError, InputError
from ..hand.hand import Hand
from ..hand.opening import shake_hands
from ..hand.rounds import FingerRound, Round, Rounds
from ..wire.messages_gen import Setting
from ..wire.slots import FRAME_HZ
from .live import LiveBoard, LiveFingers, LiveLink
from .physics import Finger
from .touch import Load

PATIENCE_S = 60.0
BOOT_S = 0.25  # of a board, until it samples again
WATCHDOG_S = 2.0
AWAY_S = 0.5  # until a computer has found a port that came back


class World:
    """Simulated fingers on a board of their own, and the hand that reads it. Made by ``world``."""

    def __init__(self, fingers: LiveFingers, board: LiveBoard, link: LiveLink | None, hand: Hand | None) -> None:
        #: The ordinary Hand, streaming; None when another program has ``port``.
        self.hand: Hand = hand  # type: ignore[assignment]
        #: The board's pty, for a C client, ROS or `biotac view` in place of ``hand``.
        self.port = board.board.path
        #: Rounds that were stepped since the start.
        self.rounds = 0
        self._fingers = fingers
        self._board = board
        self._link = link
        self._rounds = Rounds(hand._board.reader, hand._latest) if hand is not None else None
        self._dead = self._away = self._stalled = 0  # for so many more rounds

    def __enter__(self) -> World:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the board. Safe to call twice."""
        if self._link is not None:
            self._link.away = False
            self.hand.close()
        self._board.board.close()

    # ---- time ----------------------------------------------------------------------------------

    def step(self, **loads: Load) -> Round:
        """Let one round of 10 ms pass, with these loads by finger; whoever is not named is not touched.

        A load is what touches at the end of the round: a Touch, several at once, or a Course through the round. It is
        reached in a straight line from where the round before ended. Returns the frames and events of this round; of
        a board that is silent or whose cable is out, none. Raises InputError or KeyError for a wrong load, and then no
        time has passed; DeviceLostError when the board has ended.
        """
        words = self._fingers.read(loads)
        self.rounds += 1
        if self._link is not None and self._link.reopened and not self._link.away:
            self._come_back()  # the program itself restarted the board
        if self._dead:
            self._dead -= 1
            if self._dead == 0:
                self._reset()
        else:
            status = self._board.compute(words)
            if self._link is not None and not self._link.away:
                self._wait(lambda s: self._link.wait_passed_on(status, s))  # type: ignore[union-attr]
        if self._away:
            self._away -= 1
            if self._away == 0:
                self._come_back()
        if self._stalled:
            self._stalled -= 1
            return self._silence()
        if self._rounds is None or self._link is None or self._link.away:
            return self._silence()
        return self._rounds.take()

    def rest(self, seconds: float) -> Round:
        """Step without any touch; returns the last round, with the events of all."""
        return self.run(seconds)

    def run(self, seconds: float, **loads: Load) -> Round:
        """Step with the same loads for so long; returns the last round, with the events of all."""
        events: tuple[Any, ...] = ()
        now = self._silence()
        for _ in range(max(1, round(seconds * FRAME_HZ))):
            now = self.step(**loads)
            events += now.events
        return Round(now.seq, now.t_us, now.missed, now.fingers, events)

    # ---- what goes wrong -----------------------------------------------------------------------

    def fault(self, finger: str, kind: str | None, channel: str | None = None) -> None:
        """Lay a fault on a finger from the next round on; None ends all of that finger's.

        ``kind`` is one of biotac.sim.EVERY_FAULT; ``channel`` the electrode that breaks, "E17" by default, or for a fault of
        the bus the channel that it hits, by default all. Raises InputError for an unknown fault or channel.
        """
        self._fingers.fault(finger, kind, channel)

    def restart(self, *, boot_s: float = BOOT_S, away_s: float = AWAY_S) -> None:
        """Reset the board now: it boots for ``boot_s``, and its port is away for ``away_s`` in all.

        The hand connects again by itself. Settings and maps are restored as on a board, tares are not.
        """
        self._needs_process("restart")
        self._pull()
        self._dead, self._away = _rounds_of(boot_s), max(_rounds_of(away_s), _rounds_of(boot_s) + 1)

    def cut_power(self, seconds: float) -> None:
        """Take the board's power for so long; then it boots, and its port comes back."""
        self.restart(boot_s=seconds + BOOT_S, away_s=seconds + AWAY_S)

    def hang(self, seconds: float = WATCHDOG_S) -> None:
        """The board does nothing for so long, while its port stays; then its watchdog resets it."""
        self._needs_process("hang")
        self._dead = _rounds_of(seconds)
        self._away = self._dead + _rounds_of(AWAY_S)

    def unplug(self, seconds: float) -> None:
        """Take the cable to the host out for so long. The board has its power from elsewhere, and goes on."""
        self._pull()
        self._away = _rounds_of(seconds)

    def stall_host(self, seconds: float) -> None:
        """Let the program stand still for so long: steps return nothing, then all events that came meanwhile."""
        self._stalled = _rounds_of(seconds)

    # ------------------------------------------------------------------------------------------

    def _needs_process(self, what: str) -> None:
        if type(self._board.board).__name__ != "SimBoard" or self._link is None:
            raise InputError(
                f"{what} needs the board that is a process, and its hand: leave board and hand as they are"
            )

    def _pull(self) -> None:
        if self._link is None:
            raise InputError("this world has no hand whose cable could be out")
        self._link.away = True
        reader = self.hand._board.reader
        if not reader.wait_for(lambda: reader.parked or reader.failure, PATIENCE_S):
            raise DeviceLostError("the simulated hand did not notice that its cable is out; start another world")

    def _reset(self) -> None:
        if self._link is not None and not self._link.away:  # it hung until now
            self._pull()
        self._board.board.say("restart")
        self._board.control.status()  # which the new board answers

    def _come_back(self) -> None:
        assert self._link is not None
        self._link.away = False
        wanted, until_s = self.hand._stream.started, time.monotonic() + PATIENCE_S
        while time.monotonic() < until_s:
            self.hand.check()
            if self.hand.connected and wanted is not None and self.hand.status().streams == wanted.streams:
                break
            time.sleep(0.001)
        _count(self._link, self.hand, self._board)

    def _wait(self, passed_on: Callable[[float], bool]) -> None:
        until_s = time.monotonic() + PATIENCE_S
        while not passed_on(0.5):
            self.hand.check()
            if time.monotonic() > until_s:
                raise DeviceLostError("what the simulated board sent did not arrive; is the machine out of memory?")

    def _silence(self) -> Round:
        return Round(-1, -1, 0, {name: FingerRound(None, ()) for name in self._fingers.names}, ())


def world(
    fingers: Mapping[str, Finger],
    *,
    maps: Mapping[str, Any] | None = None,
    settings: Mapping[str, int] | None = None,
    streams: Sequence[str] = ("results", "events"),
    board: str = "posix",
    image: str | None = None,
    hand: bool = True,
) -> World:
    """Start a board with these simulated fingers, each named, in the order of their chip selects.

    ``maps`` are wrench maps by finger (Hand.board.set_map), ``settings`` by their names in link.toml, and ``streams``
    what the hand streams (Hand.stream). ``board`` is "posix", the firmware as a process, or "pico", the Pico's flash
    image in the emulator. With ``hand=False`` another program opens ``World.port``, and has to: the board waits for its
    reader. A HOLD does not lapse here, because time waits for the program. Raises PortError when the board does not
    start, InputError or CommandRefusedError for a wrong setting or map.
    """
    feed = LiveFingers(fingers)
    live = LiveBoard(feed, board, image)
    if not hand:
        live.board.release()
        live.control.wait_still()
        return World(feed, live, None, None)
    link = LiveLink(live.board)
    opened = shake_hands(link, fingers=feed.names, reconnect=True)
    try:
        opened.board.set_setting(Setting.HOLD_TIMEOUT_MS, 0)
        for name, value in (settings or {}).items():
            opened.board.set_setting(Setting[name.upper()], value)
        for name, board_map in (maps or {}).items():
            opened.board.set_map(name, board_map, force=True)
        opened._reading.set_aside()
        _count(link, opened, live)
        made = World(feed, live, link, opened)
        opened.stream(*streams)
        status = live.control.wait_still()
        made._wait(lambda timeout_s: link.wait_passed_on(status, timeout_s))
    except BaseException:
        opened.close()
        raise
    return made


def _count(link: LiveLink, hand: Hand, board: LiveBoard) -> None:
    """Count the link's bytes from here: the reply to a ping is the last that has come."""
    hand.ping()
    link.count_from(board.control.status())


def _rounds_of(seconds: float) -> int:
    return max(1, round(seconds * FRAME_HZ))
