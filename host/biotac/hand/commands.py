"""The commands of a board, one method each; hand.py has the stream."""

from __future__ import annotations

import operator
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Any, SupportsIndex, TypeAlias, TypeVar

import numpy as np

from ..board.board import Board
from ..board.lasting import Subject
from ..board.stream import ALL_FINGERS
from ..errors import DeviceLostError
from ..wire import messages_gen as wire
from ..wire.frames import age_ms, tare_to_q4
from .views import Latest, finger_index

Finger: TypeAlias = str | SupportsIndex
Answer = TypeVar("Answer")
#: How long a board reserves the link for a host that took it and has fallen silent.
TAKE_LINK_S = 10.0


class Requests:
    """Commands to ``board`` from a hand and the hand's parts.

    Errors since the last call (of a callback, a recording) are raised once the command is done.
    """

    def __init__(self, board: Board, latest: Latest) -> None:
        self._board = board
        self._latest = latest
        self.names = latest.names

    def ask(self, request: Any, reply: type[Answer]) -> Answer:
        answer = self._board.ask(request, reply)
        self._latest.report()
        return answer

    def command(self, request: Any, *, lasting: Subject | None = None) -> None:
        self._board.command(request, lasting=lasting)
        self._latest.report()

    def index(self, finger: Finger) -> int:
        # Numbers are not checked here: the board knows which ones there are.
        return finger_index(self.names, finger) if isinstance(finger, str) else operator.index(finger)


class Commands:
    """Each command raises CommandRefusedError with the board's reason, or DeviceLostError.

    A finger is a name or a chip select; an unknown name raises KeyError.
    """

    _board: Board
    _latest: Latest
    _requests: Requests

    def ping(self) -> None:
        """Wait for the board; on return, everything that it sent before the reply has arrived."""
        self._requests.command(wire.Ping(0))

    def status(self) -> wire.Status:
        """Counters of the board and the link. The round trip also feeds ``clock``."""
        return self._requests.ask(wire.GetStatus(0), wire.Status)

    def sync(self, round_trips: int = 5) -> None:
        """Feed ``clock`` with round trips: they bound the clock's error, and later ones give the drift."""
        for _ in range(round_trips):
            self.status()

    def take_link(self) -> None:
        """Take the board over from the host at the other port. That host's stream ends; the holds stay.

        Both hosts are told, and the other is refused (LINK_BUSY) until this hand stops or is silent for TAKE_LINK_S.
        """
        self._requests.command(wire.TakeLink(0, round(1000 * TAKE_LINK_S)))

    def sensor_status(self, finger: Finger) -> wire.SensorStatus:
        """Counters and tare state of one sensor."""
        return self._requests.ask(wire.GetSensorStatus(0, self._requests.index(finger)), wire.SensorStatus)

    def sensor_info(self, finger: Finger) -> wire.SensorInfo:
        """The sensor's description of itself."""
        return self._requests.ask(wire.GetSensorInfo(0, self._requests.index(finger)), wire.SensorInfo)

    def point(self, finger: Finger) -> wire.Point:
        """Where ``finger`` is touched right now (``poc_um``), without waiting for the end of a round.

        Noise gives an untouched finger a point too: the finger's frames say whether it is touched. All INVALID_I16
        without a tare, or while no electrode has a weight. Raises CommandRefusedError when no sensor answers there.
        """
        return self._requests.ask(wire.GetPoint(0, self._requests.index(finger)), wire.Point)

    def tare(self, finger: Finger) -> None:
        """Tare now. A finger that pressure shows to be pressed is tared too, and flagged TARE_UNSURE.

        Raises CommandRefusedError while the signals move, KeyError for a finger that is not there.
        """
        self._requests.command(wire.TareNow(0, self._latest.present(finger)))

    def set_tare(
        self, finger: Finger, tare_counts: Any, pdc_counts: float | None = None, *, age_s: float | None = None
    ) -> None:
        """Use a stored tare: ``tare_counts`` (19,) in counts 0..4095, rounded to 1/16 count; ``pdc_counts`` likewise.

        ``age_s`` is the tare's age in s; None: unknown. The board compares the tare with the present counts, and flags
        it until a release has confirmed it: TARE_LIKELY if they agree, else TARE_UNSURE.

        Raises ValueError for another shape or range.
        """
        tare = np.asarray(tare_counts, dtype=np.float64)
        if tare.shape != (19,):
            raise ValueError(f"tare_counts has shape {tare.shape}, expected (19,)")
        tare_q4 = tuple(tare_to_q4(tare).tolist())
        pdc_q4 = wire.INVALID_COUNT if pdc_counts is None else int(tare_to_q4(np.float64(pdc_counts)))
        self._requests.command(wire.TareSet(0, self._requests.index(finger), tare_q4, pdc_q4, age_ms(age_s)))

    def hold(self, *fingers: Finger) -> None:
        """Say that these fingers (names or chip selects; none: all) hold something: no new tare until ``release``.

        A streaming hand keeps the hold alive. It lapses when the board has heard nothing for ``hold_timeout_ms`` (2 s
        by default), when the board restarts, and when the sensor is exchanged. The finger's first row without HELD
        comes with a ``Gap`` that says so, and nothing renews the hold. While nothing streams, only ``ping`` and other
        commands keep it alive. Raises KeyError for a finger that is not there, and then changes nothing.
        """
        self._board.hold(self._mask(fingers))
        self._latest.report()

    def release(self, *fingers: Finger) -> None:
        """Say that these fingers hold nothing any more, so that a press's residue is tared. See ``hold``.

        A board that could not be reached is told once it is back (``reconnect``), unless ``hold`` is called before.
        """
        self._board.release(self._mask(fingers))
        self._latest.report()

    @contextmanager
    def grasp(self, *fingers: Finger) -> Iterator[None]:
        """``with hand.grasp("thumb", "index"):`` calls ``hold`` and, however the block ends, ``release``.

        An exception of the block does not wait for the board, and goes before errors since the last call,
        which the next call raises. A board that is away is told once it is back.
        """
        mask = self._mask(fingers)  # an absent finger is refused before anything is held
        try:
            self.hold(*fingers)
            yield
        except BaseException:
            self._board.release_unanswered(mask)
            raise
        with suppress(DeviceLostError):  # the watch repeats RELEASE
            self.release(*fingers)

    def _mask(self, fingers: tuple[Finger, ...]) -> int:
        named = [f if isinstance(f, str) else operator.index(f) for f in fingers]
        return self._latest.mask(named) if named else ALL_FINGERS
