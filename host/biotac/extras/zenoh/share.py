"""Sharing a board of this computer on the network: the other end of ``zenoh:NAME``."""

from __future__ import annotations

import hmac
import json
import secrets
import struct
import threading
from contextlib import suppress
from dataclasses import replace
from typing import Any

from ...board.gap import Gap
from ...board.reader import Tap
from ...errors import BiotacError, CommandRefusedError, PortError
from ...hand.hand import Hand
from ...wire import messages_gen as wire
from ...wire.batches import Batch
from ...wire.framing import ENCODED_MAX_BYTES, encode, open_frame
from ...wire.identity import board_name, serial_text, version_text
from . import network, rights

PAUSE_S = 0.5  # how long the stream stays stopped after a command that needed it stopped


class Share(Tap):
    """Shares ``hand`` as ``name`` on ``session`` until closed.

    Does not close ``hand`` or ``session``. The hand streams from now on, whether or not anybody listens. Raises
    PortError when the name is taken.
    """

    def __init__(self, hand: Hand, session: Any, name: str) -> None:
        self.name = network.checked_name(name)
        self.batches = 0  #: published so far
        self.writer: str | None = None  #: ID of the writer
        self._hand, self._session = hand, session
        self._secret = b""  # the writer's
        self._count = 0  # of the writer's last command: each is accepted once
        self._deciding = threading.Lock()
        self._commanding = threading.Lock()
        self._publishing = threading.Lock()  # Zenoh objects must not be undeclared while in use
        self._paused: threading.Timer | None = None
        self._pauses = 0
        self._tail = b""
        self.epoch = ""  #: in the keys of what is published, another after each loss of the board
        self._epoch_entities: list[Any] = []
        if network.shared(session, name):
            raise PortError(f"a board is already shared as {name}; choose another name, or stop that one")
        self._declared = [
            session.declare_queryable(network.key(name, kind), answer)
            for kind, answer in (("info", self._answer_info), ("claim", self._claim), ("command", self._command))
        ]
        self._declared.append(
            session.liveliness().declare_subscriber(network.key(name, "writer/*"), self._writer_changed)
        )
        self._new_epoch()
        network.close_at_exit(self)
        hand.add(self)
        hand.stream()

    def _new_epoch(self) -> None:
        """Publish under a new key from now on: readers follow one, so none goes on as if the board were unchanged.

        The publisher drops batches for readers that are too slow.
        """
        self._end_epoch()
        self.epoch = secrets.token_hex(8)
        self._wire = self._session.declare_publisher(network.key(self.name, f"wire/{self.epoch}"))
        token = self._session.liveliness().declare_token(network.key(self.name, f"live/{self.epoch}"))
        self._epoch_entities = [self._wire, token]

    def _end_epoch(self) -> None:
        """Tell readers that the board is gone: later rows are of another epoch."""
        before, self._epoch_entities = self._epoch_entities, []
        for entity in before:
            entity.undeclare()

    # ---- the board's stream, on the reading thread ---------------------------------------------

    def put(self, batch: Batch) -> None:
        for message in batch.messages:
            if isinstance(message, Gap) and message.reason in ("unplugged", "silence", "rebooted"):
                with self._publishing:
                    self._new_epoch()

    def wake(self) -> None:
        if not self._hand.connected:
            with self._publishing:
                self._end_epoch()

    def put_raw(self, chunk: bytes, batch: Batch) -> None:
        """Publish whole messages only, so that no message is lost in part. Answers to requests are omitted."""
        data = self._tail + chunk
        end = data.rfind(b"\0") + 1
        data, self._tail = data[:end], data[end:]
        # COBS: the second byte after a delimiter is the message's id, as no id is 0.
        kept = [
            part for part in data.split(b"\0") if len(part) > 1 and not (part[1] in rights.ANSWERS and _asked(part))
        ]
        with self._publishing:
            if kept and self._epoch_entities:
                self._wire.put(network.NUMBER.pack(self.batches) + b"\0".join(kept) + b"\0")
                self.batches += 1

    # ---- queries -------------------------------------------------------------------------------

    def _answer_info(self, query: Any) -> None:
        if not self.epoch:  # asked while this is being made; a reader that finds nobody says so
            return
        hello = self._hand.info
        facts = {
            "name": self.name,
            "epoch": self.epoch,
            "board": board_name(hello),
            "serial_number": serial_text(hello),
            "firmware": version_text(hello),
            "wire": f"{hello.wire_major}.{hello.wire_minor}",
            "fingers": self._hand.fingers,
            "connected": self._hand.connected,
            "writer": self.writer,
        }
        query.reply(network.key(self.name, "info"), json.dumps(facts).encode())

    def _claim(self, query: Any) -> None:
        """Answer a claim to write, which is the name of a token: with a secret to sign commands with, or the writer."""
        name = network.bytes_of(query.payload, network.CLAIM_BYTES).decode(errors="replace")
        with self._deciding:
            # Without a token, the writer could never be seen to leave, and nobody else could ever write.
            if self.writer is None and network.lives(self._session, self.name, name):
                self.writer, self._secret, self._count = name, secrets.token_bytes(network.SECRET_BYTES), 0
                answer = network.GRANTED + self._secret
            else:
                answer = (self.writer or "nobody").encode()
        query.reply(network.key(self.name, "claim"), answer)

    def _writer_changed(self, sample: Any) -> None:
        token = str(sample.key_expr).rpartition("/")[2]
        with self._deciding:
            if "DELETE" in str(sample.kind) and token == self.writer:
                self.writer, self._secret = None, b""

    def _command(self, query: Any) -> None:
        """Answer a command. There is no answer while the board is away, so that the reader looks for it again."""
        command = network.bytes_of(query.payload, ENCODED_MAX_BYTES)
        frame = open_frame(command)
        if frame is None:
            return
        message_id, payload = frame
        may = message_id in rights.READS
        if rights.needs_writer(message_id):
            may = self._is_signed(command, network.bytes_of(query.attachment, network.SIGNATURE_BYTES))
        try:
            answer = self._asked_for(message_id, payload) if may else _refusal(message_id, payload, wire.Error.NOT_HERE)
        except BiotacError:
            return
        query.reply(network.key(self.name, "command"), answer)

    def _is_signed(self, command: bytes, signature: bytes) -> bool:
        """True if it is the writer's, and new."""
        if len(signature) != network.SIGNATURE_BYTES:
            return False
        (count,) = network.COUNT.unpack_from(signature)
        with self._deciding:
            expected = network.signature(self._secret, count, command)
            if self.writer is None or count <= self._count or not hmac.compare_digest(signature, expected):
                return False
            self._count = count
            return True

    def _asked_for(self, message_id: int, payload: bytes) -> bytes:
        kind = wire.MESSAGES.get(message_id)
        answers = wire.ANSWERS.get(kind) if kind is not None else None
        if kind is None or answers is None:
            return _refusal(message_id, payload, wire.Error.UNKNOWN_COMMAND)
        try:
            request = kind.unpack(payload)
        except struct.error:
            return _refusal(message_id, payload, wire.Error.BAD_LENGTH)
        if isinstance(request, wire.HelloRequest):
            self._hand.check()
            if not self._hand.connected:
                return b""
            hello = replace(self._hand.info, req_id=request.req_id, nonce=request.nonce)
            return encode(hello.ID, hello.pack())
        with self._commanding:
            try:
                answer = self._ask(request, answers)
            except CommandRefusedError as error:
                return _refusal(message_id, payload, error.error)
        answer = replace(answer, req_id=request.req_id)
        return encode(answer.ID, answer.pack())

    def _ask(self, request: Any, answers: type[Any]) -> Any:
        """Ask the board; if it is too busy while streaming (maps, saving), pause the stream for all, for a while."""
        # Readers ask for STATUS all the time, which does not make the pause longer.
        if self._paused is None or request.ID == wire.GetStatus.ID:
            try:
                return self._hand.board.ask(request, answers)
            except CommandRefusedError as error:
                if error.error != wire.Error.BUSY:
                    raise
            self._hand.stop()
        if self._paused is not None:
            self._paused.cancel()
        try:
            return self._hand.board.ask(request, answers)
        finally:
            self._pauses += 1
            self._paused = threading.Timer(PAUSE_S, self._resume, [self._pauses])
            self._paused.daemon = True
            self._paused.start()

    def _resume(self, pause: int) -> None:
        with self._commanding:
            if pause != self._pauses:
                return  # another command came in between
            self._paused = None
            with suppress(BiotacError):  # a board that is away is started when it is back
                self._hand.start()

    def close(self) -> None:
        """Take the board off the network. The hand goes on streaming. Safe to call twice."""
        self._hand.remove(self)
        if self._paused is not None:
            self._paused.cancel()
        with self._publishing:
            declared, self._declared = self._declared, []
            for entity in declared:
                entity.undeclare()
            self._end_epoch()


def _asked(part: bytes) -> bool:
    """True if the message answers a request (its req_id is not 0). Boards also send STATUS on their own."""
    frame = open_frame(part)
    if frame is None:
        return False
    try:
        return bool(wire.MESSAGES[frame[0]].unpack(frame[1]).req_id)
    except struct.error:
        return True


def _refusal(message_id: int, payload: bytes, error: int) -> bytes:
    return encode(wire.Reply.ID, wire.Reply(payload[0] if payload else 0, message_id, error).pack())
