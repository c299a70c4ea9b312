"""Simulated fingers that a program loads round by round: each load becomes words, and these go to a board."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from itertools import chain

import numpy as np

from ..errors import InputError
from ..wire.sensor_gen import MAX_SENSORS
from ..wire.slots import SLOTS_PER_FRAME
from . import touch
from .faults import BETWEEN_FINGERS, EXCHANGED, begin
from .physics import SimFinger
from .sampling import Sampler, Words
from .scenario import default_serial
from .source import Source
from .touch import Load

#: A fault on a finger: its number, that of the finger beside it, and a function of both fingers' words.
Laid = tuple[int, int, Callable[[Words, Words], Words]]


class LiveFingers:
    """Fingers by name, read a round at a time: chip select k is the k-th. Faults go on until they are ended."""

    def __init__(self, fingers: Mapping[str, SimFinger]) -> None:
        if not 1 <= len(fingers) <= MAX_SENSORS:
            raise InputError(f"{len(fingers)} fingers are given, expected 1 to {MAX_SENSORS}")
        for name, finger in fingers.items():
            if not isinstance(finger, SimFinger):
                raise InputError(f"finger {name!r} is {finger!r}, expected a SimFinger")
        self.names = {name: number for number, name in enumerate(fingers)}
        self._fingers = tuple(fingers.values())
        self._samplers = [Sampler(finger) for finger in self._fingers]
        self._rest = [finger.rest_counts(np.zeros(1))[0] for finger in self._fingers]
        self._faults: dict[str, tuple[Laid, ...]] = {}

    def at_rest(self, rounds: int = 1) -> Source:
        """The next rounds, untouched."""
        serials = tuple(default_serial(finger.seed) for finger in self._fingers)
        return Source("live", self.read({}, rounds), serials=serials, emulated=self._fingers)

    def read(self, loads: Mapping[str, Load], rounds: int = 1) -> Words:
        """The words of the next rounds, (rounds, fingers, 44). A finger that is not named is not touched."""
        for name in loads:
            self.number(name)
        states = [touch.states(loads.get(name)) for name in self.names]
        words = np.empty((len(states), rounds, SLOTS_PER_FRAME), np.uint16)
        for number, felt in enumerate(states):
            words[number] = self._samplers[number].steps(rounds, *felt)
        spoilt = words.copy() if self._faults else words
        for number, beside, lay in chain(*self._faults.values()):
            spoilt[number] = lay(spoilt[number], words[beside])
        return np.ascontiguousarray(spoilt.swapaxes(0, 1))

    def number(self, name: str) -> int:
        """The chip select of a finger. Raises KeyError for an unknown name."""
        if name not in self.names:
            raise KeyError(f"no finger {name!r}, expected one of {', '.join(self.names)}")
        return self.names[name]

    def fault(self, name: str, kind: str | None, channel: str | None = None) -> None:
        """Lay a fault on a finger from the next round on; None ends all of that finger's. See World.fault."""
        number = self.number(name)
        if kind is None:
            self._faults = {
                key: all_laid for key, all_laid in self._faults.items() if all(laid[0] != number for laid in all_laid)
            }
            return
        if kind in BETWEEN_FINGERS and len(self.names) == 1:
            raise InputError(f"{kind!r} needs a second finger, and there is only {name!r}; add one")
        beside, seed = (number + 1) % len(self.names), [self._fingers[number].seed, 7]
        hit = [(number, beside), (beside, number)] if kind == EXCHANGED else [(number, beside)]
        self._faults[f"{number} {kind} {channel}"] = tuple(
            (one, other, begin(kind, channel, self._rest[one], self._rest[other], seed)) for one, other in hit
        )
