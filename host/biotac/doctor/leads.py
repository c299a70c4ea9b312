"""Finds which lead between a gateway and a sensor board is wrong, from what each end heard."""

from __future__ import annotations

from collections.abc import Iterator

from ..wire.identity import ascii_text
from .catalogue import Finding
from .facts import BoardFacts, Facts
from .sensors import WORDS


def check(facts: Facts) -> Iterator[Finding]:
    """At most one finding about the leads that all sensors share; if those are right, one for each chip select."""
    board, pair = facts.board, facts.pair
    if board is None or pair is None:
        return
    # More than half of its words were good; one or two may date from before a lead came off.
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


def crossed(board: BoardFacts, serials: tuple[str, ...]) -> Iterator[Finding]:
    """Of sensors whose serial numbers by finger are known: those that answer at another's select."""
    for sensor in board.sensors:
        serial = ascii_text(sensor.serial)
        if serial in serials and serial != serials[sensor.finger]:
            ends = serials.index(serial)
            yield Finding("lead_crossed", f"the select of finger {sensor.finger} ends at the sensor of finger {ends}")
