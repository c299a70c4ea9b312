"""A fixture for tests of a hand's controller: simulated fingers, loaded by the test round by round."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import ExitStack
from typing import Any

import pytest


@pytest.fixture
def biotac_world() -> Iterator[Any]:
    """Start worlds (biotac.sim.world), which end with the test.

    ``biotac_world(index=1, thumb=2)`` has a separate finger for each name, drawn by the seed, or given as a
    SimFinger; other arguments of biotac.sim.world go in ``options``.
    """
    from biotac.sim import SimFinger, World, world

    with ExitStack() as worlds:

        def start(options: Mapping[str, Any] | None = None, **fingers: Any) -> World:
            drawn = {name: SimFinger(value) if isinstance(value, int) else value for name, value in fingers.items()}
            return worlds.enter_context(world(drawn or {"index": SimFinger(1)}, **(options or {})))

        yield start
