"""Zenoh sessions, the keys under which boards are shared, and finding shared boards."""

from __future__ import annotations

import hmac
import ipaddress
import json
import os
import re
import struct
import threading
from pathlib import Path
from typing import Any
from weakref import WeakSet

from ...documents import parse_json
from ...errors import InputError, PortError, imported, printable

ROOT = "biotac"
LOOPBACK = "127.0.0.1"
NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_.-]{0,63}")
WRITER = re.compile(r"[^\s/*$?#]{1,200}")
FIND_S = 1.0  # a board that has not replied by then is not there

LEASE_MS = 30_000  # a computer that is silent this long counts as gone; a program that ends is gone at once

INFO_BYTES = 4096  # largest description of a board
TEXTS = ("name", "epoch", "board", "serial_number", "firmware", "wire")
MESSAGE_BYTES = 1 << 20  # largest that Zenoh takes from others; a batch of ours has some kilobytes
CLAIM_BYTES = 200
COUNT = struct.Struct("<Q")  # of a writer's commands; begins a signature
SIGNATURE_BYTES = COUNT.size + 32
SECRET_BYTES = 32
GRANTED = b"\0"  # begins the answer to a claim, before the secret; no name does

_open: WeakSet[Any] = WeakSet()

#: Precedes each batch: its number, which tells a reader how many it missed.
NUMBER = struct.Struct("<Q")


def key(name: str, kind: str) -> str:
    """Key of a board's ``wire/EPOCH``, ``command``, ``claim`` or ``info``, or token ``live/EPOCH``, ``writer/ID``."""
    return f"{ROOT}/{name}/{kind}"


def checked_name(name: str) -> str:
    """``name``. Raises InputError if it is not a valid name for a board."""
    if not NAME.fullmatch(name):
        raise InputError(
            f"{name!r} cannot name a board; expected up to 64 letters, digits, '_', '-' and '.', the first a letter "
            "or digit"
        )
    return name


def open_session(
    where: str, *, connect: str | None = None, listen: str | None = None, config: str | os.PathLike[str] | None = None
) -> Any:
    """A zenoh.Session. ``connect`` and ``listen`` are Zenoh endpoints (tcp/HOST:7447); either turns off discovery.

    ``config`` is a Zenoh configuration file (users and passwords, TLS, access rules); by default the one that
    ZENOH_CONFIG names. Without one, nothing leaves this computer. Raises InputError if Zenoh is missing, the file is
    bad, or there is none for an endpoint elsewhere, and PortError, with a text that begins with ``where``, if the
    network cannot be reached.
    """
    zenoh = _zenoh()
    own = config or os.environ.get("ZENOH_CONFIG")
    outside = next((e for e in (connect, listen) if e is not None and not _is_loopback(e)), None)
    if outside is not None and not own:
        raise InputError(
            f"{outside} leaves this computer: expected a Zenoh configuration that says who may connect (--config FILE, "
            "?config=FILE or ZENOH_CONFIG); host/docs/guides/network.md shows one with passwords or TLS"
        )
    try:
        facts = zenoh.Config.from_file(str(own)) if own else zenoh.Config()
        if not own:
            # So that a program stopped for a while (debugger, laptop lid) can go on; Zenoh's default 10 s is too short.
            facts.insert_json5("transport/link/tx/lease", str(LEASE_MS))
            facts.insert_json5("transport/link/rx/max_message_size", str(MESSAGE_BYTES))
            facts.insert_json5("scouting/multicast/interface", json.dumps(LOOPBACK))
            facts.insert_json5("listen/endpoints", json.dumps([f"tcp/{LOOPBACK}:0"]))
        for option, endpoint in (("connect", connect), ("listen", listen)):
            if endpoint is not None:
                facts.insert_json5(f"{option}/endpoints", json.dumps([endpoint]))
        if connect is not None or listen is not None:
            facts.insert_json5("scouting/multicast/enabled", "false")
        if connect is not None and listen is None:
            facts.insert_json5("mode", '"client"')
    except zenoh.ZError as error:
        file = Path(own or "").name
        raise InputError(
            f"Zenoh rejects its endpoint or configuration file {file} ({_short(error)}); see zenoh.io/docs"
        ) from error
    try:
        return zenoh.open(facts)
    except zenoh.ZError as error:
        raise PortError(
            f"{where}: cannot reach Zenoh ({_short(error)}); check the endpoint, that `biotac share` is running, and, "
            "if it asks for a password or a certificate, your Zenoh configuration"
        ) from error


def close_at_exit(user: Any) -> None:
    """Close ``user`` of a session when the program ends, before Python waits for the threads that Zenoh calls."""
    _open.add(user)


def _close_open() -> None:
    for user in list(_open):
        user.close()


threading._register_atexit(_close_open)  # type: ignore[attr-defined]  # atexit's own come after that wait


def shared(session: Any, name: str = "*") -> list[dict[str, Any]]:
    """Descriptions of the boards shared, all or those of one name, sorted by name."""
    found = []
    for reply in session.get(key(name, "info"), target=_zenoh().QueryTarget.ALL, timeout=FIND_S):
        facts = _facts(reply.ok.payload) if reply.ok is not None else None
        if facts is not None:
            found.append(facts)
    return sorted(found, key=lambda facts: facts["name"])


def signature(secret: bytes, count: int, command: bytes) -> bytes:
    """A writer's signature of the ``count``-th command. The secret itself goes only from the share to the writer."""
    return COUNT.pack(count) + hmac.digest(secret, COUNT.pack(count) + command, "sha256")


def bytes_of(payload: Any, most: int) -> bytes:
    """A query's or sample's bytes; none when there are more than ``most``."""
    return payload.to_bytes() if payload is not None and len(payload) <= most else b""


def _facts(payload: Any) -> dict[str, Any] | None:
    """A board's description of itself; None if the reply is invalid, as from another program that uses our key."""
    try:
        facts = parse_json(bytes_of(payload, INFO_BYTES))
    except ValueError:
        return None
    if not isinstance(facts, dict) or not all(isinstance(facts.get(key), str) for key in TEXTS):
        return None
    fingers, writer = facts.get("fingers"), facts.get("writer")
    known = isinstance(fingers, list) and all(type(finger) is int for finger in fingers)
    if not known or not isinstance(writer, str | None) or not NAME.fullmatch(facts["name"]):
        return None
    return {key: printable(value) if isinstance(value, str) else value for key, value in facts.items()}


def lives(session: Any, name: str, writer: str) -> bool:
    """True if a writer of that name is there, by its token."""
    if not WRITER.fullmatch(writer) or not writer.isprintable():
        return False
    replies = session.liveliness().get(key(name, f"writer/{writer}"), timeout=FIND_S)
    return any(reply.ok is not None for reply in replies)


def _is_loopback(endpoint: str) -> bool:
    host = endpoint.partition("/")[2].partition("?")[0].partition("#")[0].rpartition(":")[0].strip("[]")
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def _zenoh() -> Any:
    return imported("zenoh", "a board on a network", "zenoh")


def _short(error: Exception) -> str:
    """Zenoh's error text without the location in its source."""
    return str(error).partition("  at ")[0].strip().rstrip("!")
