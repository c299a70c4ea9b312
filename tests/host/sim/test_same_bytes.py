"""What the board in this process sends is what the board sent that was a process, byte for byte, from START on.

Until that move is taken for done; before.json was made by the release before it. STATUS counts the host's commands, of
which a world sent one more, so these two numbers are left out.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from deframer import Deframer

import biotac
from biotac.board.reader import Consumer
from biotac.sim import SimFinger, Touch, bundled_scenarios, world
from biotac.wire import messages_gen as wire

BEFORE = json.loads(Path(__file__).with_name("board_before.json").read_text())


class Tap(Consumer):
    def __init__(self, hand: biotac.Hand) -> None:
        self._data = bytearray()
        hand.add(self)

    def put(self, batch: Any) -> None:
        return

    def put_raw(self, chunk: bytes, batch: Any) -> None:
        self._data += chunk

    def digest(self) -> dict[str, list[Any]]:
        """Of each kind of message after the answer to START how many there are, and their hash."""
        kinds: dict[str, list[Any]] = {}
        began = False
        for message_id, payload in Deframer().feed(bytes(self._data)):
            began = began or (message_id == wire.Reply.ID and payload[1] == wire.Start.ID)
            name = wire.MESSAGES[message_id].__name__
            if not began or name in ("Reply", "Hello"):
                continue
            if name == "Status":
                status = wire.Status.unpack(payload)
                if status.req_id:
                    continue
                payload = replace(status, rx_frames=0, messages_sent=0).pack()
            kind = kinds.setdefault(name, [0, hashlib.sha256()])
            kind[0] += 1
            kind[1].update(payload)
        return {name: [count, digest.hexdigest()[:20]] for name, (count, digest) in sorted(kinds.items())}


@pytest.mark.parametrize("scenario", bundled_scenarios())
def test_a_scenario(scenario: str) -> None:
    with biotac.open(f"sim:{scenario}?seconds=15&fingers=3") as hand:
        tap = Tap(hand)
        hand.stream("results", "events", "raw", "pac", "touch", rest=True)
        for _ in hand.batches():
            pass
        assert tap.digest() == BEFORE[scenario]


@pytest.mark.parametrize("disturbed", [False, True])
@pytest.mark.parametrize("seed", [1, 5])
def test_a_world(seed: int, disturbed: bool) -> None:
    draw = np.random.default_rng(seed)

    def touch() -> Touch:
        normal_n = float(draw.uniform(0.2, 8))
        return Touch(normal_n=normal_n, shear_n=(float(draw.normal(0, 0.5)), float(draw.normal(0, 0.5))))

    streams = ("results", "events", "pac")
    with world({"index": SimFinger(seed), "thumb": SimFinger(seed + 1)}, streams=streams) as w:
        tap, loads = Tap(w.hand), dict[str, Touch]()
        w.hand.stream(*streams)
        does: dict[int, Callable[[], None]] = {
            100: lambda: w.fault("index", "stuck"),
            150: lambda: w.fault("index", None),
            180: lambda: w.unplug(0.3),
            230: w.restart,
        }
        for step in range(300):
            if step % 37 == 0:
                loads = {"index": touch(), "thumb": touch()}
            if step % 37 == 25:
                loads = {}
            w.step(**loads)
            if disturbed and step in does:
                does[step]()
        assert tap.digest() == BEFORE[f"live {seed} {disturbed}"]
