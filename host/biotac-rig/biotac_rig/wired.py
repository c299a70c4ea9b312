"""A world of two wired boards: a program loads the fingers that a sensor board plays to a gateway."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import ExitStack

from biotac.errors import InputError
from biotac.hand.opening import open as open_hand
from biotac.link import open_link
from biotac.sim.live import LiveFingers
from biotac.sim.physics import Finger
from biotac.sim.world import AHEAD_ROUNDS, ROOM_ROUNDS, STREAMS, World

from .sensor_board import SensorBoard


def wired_world(
    fingers: Mapping[str, Finger],
    *,
    port: str,
    sensor_port: str,
    ahead: int = AHEAD_ROUNDS,
    streams: Sequence[str] = STREAMS,
) -> World:
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
        return World(feed, sensors, hand, closes.pop_all())
