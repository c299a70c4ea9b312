"""Which finger a sensor is, where messages name its position in the hand."""

from __future__ import annotations

from collections.abc import Iterable

from ...wire.sensor_gen import MAX_SENSORS
from .message import Counts, Message

NAMES = ("index", "middle", "ring", "little", "thumb")


class Positions:
    """Of those that are ``known``, the first is finger 0, and so on; one that is seen later is the next finger."""

    def __init__(self, known: Iterable[int]) -> None:
        self.order = sorted(set(known))

    def fingers(self, message: Message) -> tuple[Counts | None, ...]:
        """The message's, MAX_SENSORS of them."""
        if not message.positions:
            return message.fingers
        new = [position for position in message.positions if position not in self.order]
        self.order += new[: max(0, MAX_SENSORS + 1 - len(self.order))]
        by_position = dict(zip(message.positions, message.fingers, strict=True))
        return tuple(by_position.get(p) for p in [*self.order, *[-1] * MAX_SENSORS][:MAX_SENSORS])

    def notes(self) -> list[str]:
        return [
            f"position {p} is {NAMES[f]}" if f < MAX_SENSORS else f"position {p} is one sensor too many, and left out"
            for f, p in enumerate(self.order)
            if p != f
        ]
