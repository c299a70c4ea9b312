"""Who may tell a shared board what: everybody reads, one writes.

By the names in link.toml: GET_... and READ_... change nothing. START, STOP and PING are each reader's own affair, and
never reach the board, which streams to all.
"""

from __future__ import annotations

from typing import Any

from ..wire import messages_gen as wire

#: Answered for the reader alone, where the reader is.
OWN = frozenset({wire.Start.ID, wire.Stop.ID, wire.Ping.ID})
#: Anybody's.
READS = frozenset({wire.HelloRequest.ID} | {m.ID for m in wire.ANSWERS if m.__name__.startswith(("Get", "Read"))})
#: What comes as an answer to one who asked, and is not for the others.
_ANSWERS: list[type[Any]] = [wire.Reply, *wire.ANSWERS.values()]
ANSWERS = frozenset(m.ID for m in _ANSWERS)


def needs_writer(message_id: int) -> bool:
    """The command changes something, or nobody here knows what it does."""
    return message_id not in OWN | READS


def command_name(message_id: int) -> str:
    """For messages."""
    known = wire.MESSAGES.get(message_id)
    return known.__name__ if known is not None else f"command 0x{message_id:02X}"
