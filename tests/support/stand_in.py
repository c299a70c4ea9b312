"""A thing to hand in, for a failure that no board or file shows."""

from typing import Any


class StandIn:
    """``thing``, but for the attributes that are given."""

    def __init__(self, thing: Any, **own: Any) -> None:
        self.thing = thing
        self.__dict__ |= own

    def __getattr__(self, name: str) -> Any:
        return getattr(self.thing, name)
