"""Messages of ROS 2 types beside the rows, for other programs: in SI units, with a frame_id, fewer than on the wire.

They are derived from the wire, thinned so that a long recording stays small, and our own readers ignore them.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from itertools import chain
from typing import Any, NamedTuple, TypeVar

import numpy as np
from mcap.writer import Writer

from ..board.gap import Gap
from ..wire import messages_gen as wire
from ..wire.batches import Batch, StreamDecoder
from ..wire.events import event_age_s, kind_name
from ..wire.fields import INVALID_U32
from ..wire.frames import StructArray, electrode_signals
from . import plot_ros
from .labels import Label
from .stamps import Stamps

#: Type of each topic of a finger.
TOPICS = {
    "force": plot_ros.ARRAY,
    "torque": plot_ros.ARRAY,
    "flags": plot_ros.FLAGS,
    "contact": plot_ros.POSE,
    "counts": plot_ros.ARRAY,
    "signals": plot_ros.ARRAY,
    "pac": plot_ros.ARRAY,
    "log": plot_ros.LOG,
}
FORCE_US = 40_000  # 25 a second
CONTACT_US = 100_000  # 10 a second: seven numbers that hardly compress
COUNTS_US = 200_000  # 5 a second
_PERIOD_US = {"force": FORCE_US, "contact": CONTACT_US, "counts": COUNTS_US, "pac": COUNTS_US}
_LABELS = {
    "force": "force on the finger, N: x, y, z, and its magnitude from static pressure",
    "torque": "torque on the finger, N*m: x, y, z about the origin, and about the normal at the contact",
    "counts": "count: E1 to E19, PDC, TAC, TDC",
    "signals": "above rest, count: E1 to E19",
    "pac": "dynamic pressure, 1/2200 s apart, count",
}

#: Messages are built in steps of so many, about half a millisecond, with a pause after each.
STEP_MESSAGES, STEP_PAUSE_S = 16, 20e-6

_Item = TypeVar("_Item")


class _Message(NamedTuple):
    """A message to be written: its bytes, or what builds them from its stamp in ns."""

    topic: str
    finger: int
    t_us: int
    seq: int
    data: bytes | Callable[[int], bytes]


class Plots:
    """Writes the messages of all fingers; a finger's topics appear with its first message."""

    def __init__(self, writer: Writer) -> None:
        self._writer = writer
        self._stamps: Stamps | None = None
        self._begin_us = 0
        self._channels: dict[str, int] = {}
        self._schemas: dict[str, int] = {}
        self._due: dict[tuple[str, int], int] = {}

    def add(self, batch: Batch, decoder: StreamDecoder, arrived_ns: int, all_here_ns: int | None) -> None:
        """Write the messages for the next rows.

        ``decoder`` is the one that decoded them. Their first byte arrived at ``arrived_ns``, the last at
        ``all_here_ns`` (None if unknown).
        """
        begin_us, end_us = batch.first_t_us(), batch.last_t_us()
        if self._stamps is None and begin_us is not None:
            self._begin_us, self._stamps = begin_us, Stamps(begin_us, arrived_ns)
        if self._stamps is None:
            return
        if end_us is not None and all_here_ns is not None:
            self._stamps.arrived(end_us, all_here_ns)
        messages = [*_with_pauses(chain(self._row_messages(batch), _logs(batch, decoder)))]
        messages.sort(key=lambda message: message.t_us)
        stamps = self._stamps(np.array([message.t_us for message in messages], np.int64))
        for message, stamp_ns in _with_pauses(zip(messages, np.maximum(stamps, 0).tolist(), strict=True)):
            channel = self._channel(message.topic, f"/biotac/finger{message.finger}/{message.topic}")
            data = message.data if isinstance(message.data, bytes) else message.data(stamp_ns)
            self._writer.add_message(channel, stamp_ns, data, stamp_ns, message.seq)

    def log(self, gaps: Iterable[Gap], labels: Iterable[Label], arrived_ns: int) -> None:
        """Write logs: of gaps at the row after them, of labels where they begin; without any row, at ``arrived_ns``."""
        entries = [("biotac", gap.line(), gap.next_t_us or gap.last_t_us, plot_ros.WARN) for gap in gaps]
        for label in labels:
            name = "label" if label.finger is None else f"label of finger{label.finger}"
            entries.append((name, label.line(), label.t_us, plot_ros.INFO))
        for name, line, t_us, level in entries:
            at_us = np.array([self._begin_us if t_us is None else t_us])
            stamp_ns = max(0, int(self._stamps(at_us)[0])) if self._stamps else arrived_ns
            text = plot_ros.log(name, line, stamp_ns, level)
            self._writer.add_message(self._channel("log", "/biotac/log"), stamp_ns, text, stamp_ns, 0)

    def _row_messages(self, batch: Batch) -> Iterator[_Message]:
        frames = batch.frames
        rows = frames[self._thinned("force", frames)]
        yield from _arrays("force", rows, np.column_stack([rows["force_n"], rows["pressure_force_n"]]))
        yield from _arrays("torque", rows, np.column_stack([rows["torque_nmm"], rows["torsion_nmm"]]) / 1000)
        for row in rows:
            yield _Message("flags", *_origin(row), plot_ros.flags(int(row["flags"])))
        chosen = self._thinned("counts", frames)
        rows = frames[chosen]
        counts = np.column_stack([rows["counts"], rows["pdc"], rows["tac"], rows["tdc"]])
        yield from _arrays("counts", rows, _without_invalid(counts))
        yield from _arrays("signals", rows, electrode_signals(batch.wire[chosen]))
        pac = batch.pac[self._thinned("pac", batch.pac)]
        yield from _arrays("pac", pac, _without_invalid(pac["pac"]))
        for row in frames[self._thinned("contact", frames)]:
            if not np.isnan(row["poc_mm"]).any():
                pose = partial(plot_ros.contact, int(row["finger"]), row["poc_mm"] / 1000, row["force_n"])
                yield _Message("contact", *_origin(row), pose)

    def _thinned(self, topic: str, rows: StructArray) -> list[int]:
        """Indices of the rows to show: each finger's first row in every period of device time."""
        chosen: list[int] = []
        for finger in np.unique(rows["finger"]).tolist():
            at = np.flatnonzero(rows["finger"] == finger)
            period = rows["t_us"][at] // _PERIOD_US[topic]
            chosen += at[np.diff(period, prepend=self._due.get((topic, finger), -1)) != 0].tolist()
            self._due[topic, finger] = int(period[-1])
        return chosen

    def _channel(self, topic: str, name: str) -> int:
        if name not in self._channels:
            kind = TOPICS[topic]
            if kind not in self._schemas:
                text = plot_ros.SCHEMAS[kind].encode()
                self._schemas[kind] = self._writer.register_schema(kind, "ros2msg", text)
            self._channels[name] = self._writer.register_channel(name, "cdr", self._schemas[kind])
        return self._channels[name]


def _with_pauses(items: Iterable[_Item]) -> Iterator[_Item]:
    """These, with pauses for other threads, which otherwise wait 5 ms each time for the interpreter's lock."""
    for n, item in enumerate(items):
        if n % STEP_MESSAGES == 0:
            time.sleep(STEP_PAUSE_S)
        yield item


def _origin(row: Any) -> tuple[int, int, int]:
    return int(row["finger"]), int(row["t_us"]), int(row["seq"])


def _arrays(topic: str, rows: StructArray, values: Any) -> Iterator[_Message]:
    for row, own in zip(rows, values, strict=True):
        yield _Message(topic, *_origin(row), plot_ros.array(_LABELS[topic], own))


def _without_invalid(counts: Any) -> Any:
    return np.where(counts == wire.INVALID_COUNT, np.nan, counts)


def _logs(batch: Batch, decoder: StreamDecoder) -> Iterator[_Message]:
    for message in batch.messages:
        if isinstance(message, (wire.Tare, wire.Event)):
            text = _tare_text(message) if isinstance(message, wire.Tare) else _event_text(message)
            log = partial(plot_ros.log, f"finger{message.finger}", text)
            yield _Message("log", message.finger, decoder.unwrap_t_us(message.t_us), message.seq, log)


def _tare_text(tare: wire.Tare) -> str:
    values = " ".join("-" if q16 == INVALID_U32 else f"{q16 / 65536:.1f}" for q16 in tare.tare_q16)
    return f"tare {_name(wire.TareReason, tare.reason)}, {_name(wire.TareState, tare.tare_state)}: {values}"


def _event_text(event: wire.Event) -> str:
    parts = [kind_name(event), f"{event_age_s(event):.4f} s ago"]
    if event.energy_count2 != INVALID_U32:
        parts.append(f"energy {event.energy_count2} count^2")
    if event.peak_count != wire.INVALID_COUNT:
        parts.append(f"peak {event.peak_count} count")
    return ", ".join(parts)


def _name(kind: Any, value: int) -> str:
    return str(kind(value).name) if value in list(kind) else str(value)
