"""A recording for the page, played at the pace at which it was recorded."""

from __future__ import annotations

import threading
import time
from collections.abc import Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import InputError
from ..recording import Recording
from ..wire.batches import Batch, LinkStats
from ..wire.counters import nearest
from ..wire.frames import StructArray
from .live import describe
from .player import Player, Recorded

TICK_S = 1 / 60


class RecordedPlayer(Player):
    """Plays ``recording`` once at ``pace`` recorded seconds per second; 0 plays all of it at once."""

    live = False

    def __init__(self, recording: Recording, pace: float = 1.0) -> None:
        self._recording = recording
        self._pace = pace
        self._tick = threading.Event()  # waiting for it is a sleep that close() ends
        self.paused = False
        self.board = f"{describe(recording.info)}, recorded from {recording.metadata['port']}"
        self._frames = 0
        parts = [rows["t_us"] for rows in (recording.frames, recording.pac, recording.idle) if len(rows)]
        if not parts:
            raise InputError(f"{recording.path} holds no frames; record it again")
        self._begin_us = min(int(t.min()) for t in parts)
        # Messages carry 32-bit times; rows carry unwrapped ones.
        self._messages = sorted(
            ((nearest(m.t_us, self._begin_us), k, m) for k, m in enumerate(recording.messages) if hasattr(m, "t_us")),
            key=lambda item: item[:2],
        )
        self._end_us = max([int(t.max()) for t in parts] + [t_us for t_us, _, _ in self._messages]) + 1

    def batches(self) -> Iterator[Batch]:
        orders = [np.argsort(rows["t_us"], kind="stable") for rows in self._rows()]
        done = [0] * len(orders)
        said = 0
        now_us = float(self._begin_us)
        before_s = time.monotonic()
        while now_us < self._end_us:
            self._tick.wait(TICK_S if self._pace or self.paused else 0)
            passed_s, before_s = time.monotonic() - before_s, time.monotonic()
            if not self.paused:
                now_us = now_us + passed_s * 1e6 * self._pace if self._pace else float(self._end_us)
            picked: list[NDArray[Any]] = []
            for k, (rows, order) in enumerate(zip(self._rows(), orders, strict=True)):
                until = int(np.searchsorted(rows["t_us"][order], now_us))
                picked.append(order[done[k] : until])
                done[k] = until
            begin = said
            while said < len(self._messages) and self._messages[said][0] < now_us:
                said += 1
            self._frames += len(picked[0])
            recording = self._recording
            yield Batch(
                recording.wire[picked[0]],
                recording.frames["seq"][picked[0]].astype(np.int64),
                recording.frames["t_us"][picked[0]],
                recording.pac[picked[1]],
                recording.idle[picked[2]],
                [m for _, _, m in self._messages[begin:said]],
            )

    def _rows(self) -> tuple[StructArray, StructArray, StructArray]:
        return self._recording.frames, self._recording.pac, self._recording.idle

    def stats(self) -> LinkStats:
        """Statistics of the whole recording, except ``frames``: the number shown so far."""
        recording = self._recording
        return LinkStats(
            bytes_received=recording.path.stat().st_size,
            frames=self._frames,
            frames_lost=recording.frames_lost,
            pac_lost=recording.pac_lost,
            disordered=recording.disordered,
            crc_errors=recording.counts.bad_crc,
            other_errors=recording.counts.bad - recording.counts.bad_crc,
        )

    def recording(self) -> Recorded | None:
        return None  # nothing is written

    def do(self, command: str, finger: int | None) -> str:
        if command in ("pause", "resume"):
            self.paused = command == "pause"
            return "paused" if self.paused else "playing"
        what = {"tare": "tared", "record": "recorded again", "stop": "stopped"}.get(command, command)
        raise InputError(f"a recording cannot be {what}; open a board for that")

    def close(self) -> None:
        self._tick.set()
