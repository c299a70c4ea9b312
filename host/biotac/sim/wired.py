"""A program's load on real time: a sensor board (firmware/sensor_board) wired to a gateway, fed some rounds ahead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..errors import InputError
from ..hand.hand import Hand
from ..hand.opening import open as open_hand
from ..hand.rounds import Round
from ..link import open_link
from .live import LiveFingers
from .physics import Finger
from .sensor_board import SensorBoard
from .source import Source
from .touch import Load

AHEAD_ROUNDS = 2
ROOM_ROUNDS = 40  # of the sensor board's memory, by which a program may be ahead


class WiredWorld:
    """Simulated fingers on a sensor board that is wired to a gateway. Made by ``wired_world``.

    Time is real: a load acts ``ahead`` rounds after its step, and where a program is late the sensors feel the round
    before once more.
    """

    def __init__(self, fingers: LiveFingers, sensors: SensorBoard, hand: Hand, ahead: int) -> None:
        self.hand = hand
        self.sensors = sensors
        self._fingers = fingers
        self._last: Round | None = None
        sensors.plug(Source("live", np.stack([fingers.read({}) for _ in range(ahead)]), serials=fingers.serials))
        sensors.play(by_time=True, live=True)
        sensors.feed()

    def __enter__(self) -> WiredWorld:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Close the hand, and give the sensor board's port back."""
        self.hand.close()
        self.sensors.close()

    @property
    def rounds_late(self) -> int:
        """Rounds that had not come when the gateway began them. Asks the sensor board."""
        return self.sensors.status().rounds_late

    def step(self, **loads: Load) -> Round:
        """Send the next round's load, and wait for the round that the gateway has computed meanwhile.

        Its ``missed`` counts the rounds for which this program was too slow. Raises as World.step, and TimeoutError
        when the gateway sends nothing.
        """
        self.sensors.put(self._fingers.read(loads))
        self._last = self.hand.next_round(self._last)
        return self._last

    def fault(self, finger: str, kind: str | None, channel: str | None = None) -> None:
        """See World.fault."""
        self._fingers.fault(finger, kind, channel)


def wired_world(
    fingers: Mapping[str, Finger],
    *,
    port: str,
    sensor_port: str,
    ahead: int = AHEAD_ROUNDS,
    streams: Sequence[str] = ("results", "events"),
) -> WiredWorld:
    """Load simulated fingers through the sensor board at ``sensor_port``, and read them at the gateway's ``port``.

    The program is ``ahead`` rounds ahead of the gateway, 1 to 40. Raises PortError and InputError.
    """
    if not 1 <= ahead <= ROOM_ROUNDS:
        raise InputError(f"ahead is {ahead}, expected 1 to {ROOM_ROUNDS} rounds")
    feed = LiveFingers(fingers)
    sensors = SensorBoard(open_link(sensor_port))
    try:
        hand = open_hand(port, fingers=feed.names)
    except BaseException:
        sensors.close()
        raise
    world = WiredWorld(feed, sensors, hand, ahead)
    hand.stream(*streams)
    return world
