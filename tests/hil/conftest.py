"""The board under test. Today the posix process; the rig is a fixture so that boards can join."""

from __future__ import annotations

from collections.abc import Callable, Iterator

import pytest

import biotac


@pytest.fixture
def board() -> Iterator[Callable[[str], biotac.Hand]]:
    """Opens simulated boards with a source; closes them after the test."""
    hands: list[biotac.Hand] = []

    def make(source: str) -> biotac.Hand:
        hands.append(biotac.open(f"sim:{source}"))
        return hands[-1]

    yield make
    for hand in hands:
        hand.close()
