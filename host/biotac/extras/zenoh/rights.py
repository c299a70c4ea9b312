"""Who may send a shared board which commands: everybody may read, one may write.

Commands named GET_... and READ_... in link.toml change nothing. START, STOP and PING concern only the reader that sends
them and never reach the board, which streams to all.
"""

from __future__ import annotations

from typing import Any

from ...wire import messages_gen as wire

#: Answered locally, for the reader alone.
OWN = frozenset({wire.Start.ID, wire.Stop.ID, wire.Ping.ID})
#: Allowed to everybody.
READS = frozenset({wire.HelloRequest.ID} | {m.ID for m in wire.ANSWERS if m.__name__.startswith(("Get", "Read"))})
#: Answers to a request, which are not passed on to others.
_ANSWERS: list[type[Any]] = [wire.Reply, *wire.ANSWERS.values()]
ANSWERS = frozenset(m.ID for m in _ANSWERS)


def needs_writer(message_id: int) -> bool:
    """True if the command changes something, or is unknown."""
    return message_id not in OWN | READS
