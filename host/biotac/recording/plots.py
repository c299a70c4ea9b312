"""Messages stored beside the wire for other programs: in SI units, with a frame_id, fewer than on the wire.

They are derived from the wire, thinned so that a long recording stays small, and our own readers ignore them. JSON
messages (plot_json.py) name every value; messages of ROS 2 types (plot_ros.py) are drawn without setup.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from mcap.writer import Writer

from ..wire import messages_gen as wire
from ..wire.batches import Batch, StreamDecoder
from ..wire.frames import StructArray, electrode_signals
from . import plot_json, plot_ros
from .stamps import Stamps

RESULTS_US = 40_000  # 25 a second
CONTACT_US = 100_000  # 10 a second: seven numbers that hardly compress
COUNTS_US = 200_000  # 5 a second
_PERIOD_US = {"results": RESULTS_US, "contact": CONTACT_US, "counts": COUNTS_US, "pac": COUNTS_US}
_ROS = {"force": plot_ros.ARRAY, "signals": plot_ros.ARRAY, "contact": plot_ros.POSE}


@dataclass(frozen=True)
class _Message:
    """A message to be written; ``encode`` builds its bytes, given its stamp in ns."""

    topic: str
    finger: int
    t_us: int
    seq: int
    encode: Callable[[int], bytes]


class Plots:
    """Writes the messages of all fingers; a finger's topics appear with its first message."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._stamps: Stamps | None = None
        self._channels: dict[tuple[str, int], int] = {}
        self._schemas: dict[str, int] = {}
        self._due_us: dict[tuple[str, int], int] = {}

    def add(self, batch: Batch, decoder: StreamDecoder, arrived_ns: int, all_here_ns: int | None) -> bool:
        """Write the messages for the next rows; return True if there were any.

        ``decoder`` is the one that decoded them. Their first byte arrived at ``arrived_ns``, the last at
        ``all_here_ns`` (None if unknown).
        """
        begin_us, end_us = batch.first_t_us(), batch.last_t_us()
        if self._stamps is None and begin_us is not None:
            self._stamps = Stamps(begin_us, arrived_ns)
        if self._stamps is None:
            return False
        if end_us is not None and all_here_ns is not None:
            self._stamps.arrived(end_us, all_here_ns)
        messages = [*_results(batch, self._thinned("results", batch.frames))]
        messages += _contacts(batch, self._thinned("contact", batch.frames))
        messages += _counts(batch, self._thinned("counts", batch.frames), self._thinned("pac", batch.pac))
        for told in batch.messages:
            if isinstance(told, wire.Tare):
                t_us = decoder.unwrap_t_us(told.t_us)
                messages.append(_json("tare", told.finger, t_us, told.seq, plot_json.tare_change(told)))
            elif isinstance(told, wire.Event):
                t_us = decoder.unwrap_t_us(told.t_us)
                messages.append(_json("events", told.finger, t_us, told.seq, plot_json.event(told)))
        messages.sort(key=lambda message: message.t_us)
        stamps = self._stamps(np.array([message.t_us for message in messages], np.int64))
        for message, stamp_ns in zip(messages, np.maximum(stamps, 0).tolist(), strict=True):
            channel = self._channel(message.topic, message.finger)
            self._writer.add_message(channel, stamp_ns, message.encode(stamp_ns), stamp_ns, message.seq)
        return bool(messages)

    def _thinned(self, what: str, rows: StructArray) -> list[int]:
        """Indices of the rows to show: each finger's first row in every period of device time."""
        period_us = _PERIOD_US[what]
        chosen: list[int] = []
        for finger in np.unique(rows["finger"]):
            mine = np.flatnonzero(rows["finger"] == finger)
            slot = rows["t_us"][mine] // period_us
            fresh = np.diff(slot, prepend=self._due_us.get((what, int(finger)), -1)) != 0
            self._due_us[what, int(finger)] = int(slot[-1])
            chosen += mine[fresh].tolist()
        return chosen

    def _channel(self, topic: str, finger: int) -> int:
        if (topic, finger) not in self._channels:
            encoding = "cdr" if topic in _ROS else "json"
            name = f"/biotac/finger{finger}/{topic}"
            self._channels[topic, finger] = self._writer.register_channel(name, encoding, self._schema(topic))
        return self._channels[topic, finger]

    def _schema(self, topic: str) -> int:
        title = _ROS.get(topic) or str(plot_json.SCHEMAS[topic]["title"])
        if title not in self._schemas:
            encoding, text = (
                ("ros2msg", plot_ros.SCHEMAS[title])
                if topic in _ROS
                else ("jsonschema", json.dumps(plot_json.SCHEMAS[topic]))
            )
            self._schemas[title] = self._writer.register_schema(title, encoding, text.encode())
        return self._schemas[title]


def _results(batch: Batch, chosen: list[int]) -> Iterator[_Message]:
    for k in chosen:
        row = batch.frames[k]
        whose = int(row["finger"]), int(row["t_us"]), int(row["seq"])
        yield _json("results", *whose, plot_json.results(batch.wire[k]))
        yield _array("force", *whose, "force on the finger, N: x, y, z", row["force_n"])


def _contacts(batch: Batch, chosen: list[int]) -> Iterator[_Message]:
    for row in batch.frames[chosen]:
        whose = int(row["finger"]), int(row["t_us"]), int(row["seq"])
        poc_m = row["poc_mm"] / 1000
        if not np.isnan(poc_m).any():
            yield _Message("contact", *whose, partial(plot_ros.contact, whose[0], poc_m, row["force_n"]))


def _counts(batch: Batch, chosen: list[int], pacs: list[int]) -> Iterator[_Message]:
    pac = {(int(row["finger"]), int(row["seq"])): row["pac"] for row in batch.pac[pacs]}
    signals = electrode_signals(batch.wire[chosen])
    for row, its in zip(batch.frames[chosen], signals, strict=True):
        whose = int(row["finger"]), int(row["t_us"]), int(row["seq"])
        yield _json("counts", *whose, plot_json.counts(row, pac.get((whose[0], whose[2]))))
        yield _array("signals", *whose, "above rest, count: E1 to E19", its)


def _json(topic: str, finger: int, t_us: int, seq: int, body: dict[str, Any]) -> _Message:
    return _Message(topic, finger, t_us, seq, partial(plot_json.encoded, body, finger, seq))


def _array(topic: str, finger: int, t_us: int, seq: int, label: str, values: Any) -> _Message:
    return _Message(topic, finger, t_us, seq, lambda stamp_ns: plot_ros.array(label, values))
