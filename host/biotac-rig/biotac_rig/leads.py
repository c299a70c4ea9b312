"""Two wired boards examined at once: which lead between them is wrong, by the words heard at each end."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import closing
from dataclasses import dataclass, replace
from typing import Any

from biotac.doctor.bringup import crossed
from biotac.doctor.catalogue import Finding
from biotac.doctor.facts import Facts, grown
from biotac.doctor.listening import examine
from biotac.doctor.sensors import WORDS
from biotac.link import open_link
from biotac.sim.loading import load_source
from biotac.wire.sensor_gen import MAX_SENSORS

from . import emu_gen as emu
from .sensor_board import SensorBoard

PLAYED, PLAYED_S = "press.toml", 60.0


@dataclass(frozen=True)
class PairFacts:
    """The facts of the sensor board at the other end of the leads; all five of its sensors are plugged in."""

    before: emu.EmuStatus
    after: emu.EmuStatus
    serials: tuple[str, ...]  #: by finger, as they were plugged in

    def more(self, counter: str) -> int:
        """Increase of one of the sensor board's 32-bit counters."""
        return grown(self.before, self.after, counter)


def examine_pair(port: str | None, sensor_port: str, **how: Any) -> Facts:
    """Facts about a gateway with a sensor board of ours as sensors, which plays meanwhile."""
    with closing(SensorBoard(open_link(sensor_port))) as sensors:
        sensors.plug(load_source(PLAYED, fingers=MAX_SENSORS, seconds=PLAYED_S))
        with sensors.feeding() as before:
            facts = examine(port, expected_fingers=MAX_SENSORS, **how)
        return paired(facts, PairFacts(before, sensors.status(), sensors.serials))


def paired(facts: Facts, pair: PairFacts) -> Facts:
    """A gateway's facts with those of the sensor board, and findings about the leads between."""
    return replace(facts, pair=pair, leads=tuple(check(facts, pair)))


def check(facts: Facts, pair: PairFacts) -> Iterator[Finding]:
    """At most one finding about the leads that all sensors share; if those are right, one for each chip select."""
    board = facts.board
    if board is None:
        return
    # More than half of the words were good; one or two may date from before a lead came off.
    bad = [sum(board.more(finger, kind) for kind in WORDS) for finger in range(board.hello.fingers)]
    good = [finger for finger in range(board.hello.fingers) if board.more(finger, "words_good") > bad[finger]]
    if good:
        others = ", ".join(map(str, good))
        for finger in range(board.hello.fingers):
            if finger not in good:
                yield Finding("lead_select", f"finger {finger} gives few good words or none, unlike fingers {others}")
        yield from crossed(board, pair.serials)
    elif not (words := pair.more("words")):
        yield Finding("lead_clock", "the sensor board saw no clock while any of its selects was low")
    elif sum(board.more(finger, "words_error") for finger in range(board.hello.fingers)):
        yield Finding("lead_mosi", f"{words} words were read, but the sensors understood no command")
    else:
        yield Finding("lead_miso", f"the sensors sent {words} words, but none reached the gateway")
