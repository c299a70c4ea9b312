"""The first exchange on a port: whether a gateway answers, and which one."""

from __future__ import annotations

import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from ..errors import NotAGatewayError, WireVersionError
from ..link import Link
from ..wire import messages_gen as wire
from ..wire.batches import StreamDecoder

TRIES = 3


@dataclass(frozen=True)
class HandWarning:
    """Something that hinders the use of a board."""

    code: str
    text: str  # one line with the cure


def warnings(hello: wire.Hello, port: str, unknown_messages: int = 0) -> list[HandWarning]:
    """Where this board's firmware and this library do not fit together; empty when they fit."""
    found = []
    if hello.schema_hash != wire.SCHEMA_HASH:
        text = f"the firmware on {port} has schema {hello.schema_hash:08x}, this library {wire.SCHEMA_HASH:08x}"
        found.append(HandWarning("schema_differs", f"{text}; what only one side knows is ignored; {cure(hello)}"))
    if unknown_messages:
        text = f"{unknown_messages} messages of {port} are of kinds that this library does not know"
        found.append(HandWarning("unknown_messages", f"{text}; a recording keeps them; {cure(hello)}"))
    return found


def describe_mismatch(hello: wire.Hello) -> str:
    """Both wire versions, and the command that makes them the same."""
    library = f"{wire.WIRE_MAJOR}.{wire.WIRE_MINOR}"
    return f"wire {hello.wire_major}.{hello.wire_minor}, this library {library}; {cure(hello)}"


def cure(hello: wire.Hello) -> str:
    """The command that updates the older side; the firmware if both have the same wire version."""
    if (hello.wire_major, hello.wire_minor) > (wire.WIRE_MAJOR, wire.WIRE_MINOR):
        return "update this library: pip install -U biotac-gateway"
    return "update the firmware: biotac flash"


def handshake(link: Link, send: Callable[[Any], None], *, timeout_s: float) -> wire.Hello:
    """The board's HELLO, asked for up to TRIES times, ``timeout_s`` each; ``send`` numbers a command and writes it.

    A board may still be streaming to an earlier program: it is stopped, and everything is ignored except the HELLO
    that carries our nonce. Raises NotAGatewayError, WireVersionError or DeviceLostError.
    """
    nonce = secrets.randbits(32)
    decoder = StreamDecoder()
    # The known fields of HELLO never move, so that the version of any peer can be read.
    decoder.accept_newer_minor()
    seen = 0
    for _ in range(TRIES):
        deadline_s = time.monotonic() + timeout_s
        link.write(b"\0")  # ends a half packet of an earlier program
        send(wire.Stop(0))
        send(wire.HelloRequest(0, nonce))
        left_s = timeout_s
        while left_s > 0:
            # Read everything that has arrived before calling it a timeout: this side may have been late.
            left_s = deadline_s - time.monotonic()
            chunk = link.read(max(0.0, left_s))
            seen += len(chunk)
            for message in decoder.feed(chunk).messages:
                if isinstance(message, wire.Hello) and message.nonce == nonce:
                    if message.wire_major != wire.WIRE_MAJOR:
                        raise WireVersionError(f"the firmware on {link.port} speaks {describe_mismatch(message)}")
                    return message
    if seen == 0:
        found = "nothing answers"
    elif decoder.counts.good:
        found = f"{decoder.counts.good} frames of this protocol arrived, but no HELLO"
    else:
        found = f"{seen} bytes arrived that are not frames of this protocol"
    raise NotAGatewayError(
        f"no gateway on {link.port}: {found}; expected a HELLO within {timeout_s * TRIES:.0f} s; check that this is "
        "the board's port and that it runs our firmware"
    )
