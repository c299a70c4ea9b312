"""A world of two wired boards: a program loads the fingers that a sensor board plays to a gateway."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack

from biotac.errors import InputError
from biotac.hand.hand import Hand
from biotac.hand.opening import open as open_hand
from biotac.hand.rounds import Round
from biotac.link import open_link
from biotac.sim.live import LiveFingers
from biotac.sim.physics import SimFinger
from biotac.sim.touch import Load
from biotac.sim.world import STREAMS, World

from .sensor_board import SensorBoard

AHEAD_ROUNDS = 2
CHECK_ROUNDS = 20  # after which a tape's message that was lost is sent again
ROUND_S = 1.0  # until one must have come
ROOM_ROUNDS = 40  # of a sensor board's memory, by which a program may be ahead


class WiredWorld(World):
    """A world in real time, on a sensor board wired to a gateway.

    A load acts some rounds after its step. Where a program is late the sensors feel the round before once more.
    """

    def __init__(self, fingers: LiveFingers, sensors: SensorBoard, hand: Hand, closes: ExitStack) -> None:
        super().__init__(fingers, hand, closes)
        self.sensors = sensors
        self._last: Round | None = None
        self._steps = 0

    @property
    def rounds_late(self) -> int:  # type: ignore[override]
        """Rounds that had not come when the gateway began them. Asks the sensors."""
        return self.sensors.status().rounds_late

    def step(self, **loads: Load) -> Round:
        self.sensors.put(self._fingers.read(loads))
        self._steps += 1
        if self._steps % CHECK_ROUNDS == 0:
            self.sensors.send_lost()
        self._last = self.hand.next_round(self._last, ROUND_S * self.hand.link.patience)
        return self._last


def wired_world(
    fingers: Mapping[str, SimFinger],
    *,
    port: str,
    sensor_port: str,
    ahead: int = AHEAD_ROUNDS,
    streams: Sequence[str] = STREAMS,
) -> WiredWorld:
    """Load simulated fingers through the sensor board at ``sensor_port``, and read them at the gateway's ``port``.

    The program is ``ahead`` rounds ahead of the gateway, 1 to 40. Raises PortError and InputError.
    """
    if not 1 <= ahead <= ROOM_ROUNDS:
        raise InputError(f"ahead is {ahead}, expected 1 to {ROOM_ROUNDS} rounds")
    feed = LiveFingers(fingers)
    with ExitStack() as closes:
        sensors = SensorBoard(open_link(sensor_port))
        closes.callback(sensors.close)
        hand = closes.enter_context(open_hand(port, fingers=feed.names))
        sensors.plug(feed.at_rest(ahead))
        sensors.play(by_time=True, live=True)
        sensors.feed()
        hand.stream(*streams)
        return WiredWorld(feed, sensors, hand, closes.pop_all())
