"""Things to hand in, for failures that no board or file shows."""

from __future__ import annotations

from typing import Any

from biotac.errors import DeviceLostError


class StandIn:
    """``thing``, but for the attributes that are given."""

    def __init__(self, thing: Any, **own: Any) -> None:
        self.thing = thing
        self.__dict__ |= own

    def __getattr__(self, name: str) -> Any:
        return getattr(self.thing, name)


class MortalLink(StandIn):
    """The link ``thing`` of a host that says nothing more once it is ``killed``. The port is then left open."""

    killed = False

    def write(self, data: bytes) -> None:
        if self.killed:
            raise DeviceLostError("the host was killed")
        self.thing.write(data)

    def close(self) -> None:
        if not self.killed:
            self.thing.close()
