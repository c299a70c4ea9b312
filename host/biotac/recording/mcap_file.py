"""The MCAP file below every recording, live, recomputed or imported.

Each second is a chunk with the packets, of simulated fingers one with the forces on them, and one with the head
(block.py). Each chunk is closed and handed to the operating system at once.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import BinaryIO

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer

from ..board.gap import NEXT_ROW_US, Gap
from ..link.base import AppliedN
from ..version import __version__
from ..wire.batches import StreamDecoder
from ..wire.counters import nearest
from . import layout
from .block import Head, pack_applied, rows_of
from .labels import Label
from .schema import own_schema

# Large enough that only flush() closes a chunk; the library would also close it by size.
_CHUNK_BYTES = 1 << 40


class RecordingFile:
    """A recording being written to ``stream``. Closing it closes ``stream``, as does a failure to begin it."""

    def __init__(self, stream: BinaryIO, metadata: dict[str, str]) -> None:
        self.stream = stream
        self._sequence = 0
        self._gaps: list[Gap] = []  # to be written with the next rows, and until then in the sender's times
        self._labels: list[Label] = []
        self._begins_us: dict[int, int] = {}  # of labels: one that is given again with an end has the same beginning
        #: Added to these times; None: the shift that brings them next to the rows.
        self.shift_us: int | None = None
        self._decoder = StreamDecoder()
        self._decoder.accept_newer_minor()
        self._last_us: int | None = None  # device time of the last row
        self._last_ns: int | None = None  # when the last block's bytes had all arrived
        self.frames = 0  #: FRAMEs written so far
        self._channels: dict[str, int] = {}
        self._metadata = layout.with_checksum(metadata)
        writer = self._writer = Writer(
            stream,
            chunk_size=_CHUNK_BYTES,
            compression=CompressionType.ZSTD,
            index_types=IndexType.ALL,
            enable_data_crcs=True,
        )
        try:
            writer.start(profile="", library=f"biotac-gateway {__version__}")
            names = layout.WIRE_SCHEMA, layout.WIRE_SCHEMA_ENCODING
            self._schema = writer.register_schema(*names, own_schema())
            writer.add_metadata(layout.METADATA_NAME, self._metadata)
            writer.flush()  # type: ignore[no-untyped-call]
        except OSError:
            with contextlib.suppress(OSError):  # the disk is still full
                stream.close()
            raise

    @property
    def frames_lost(self) -> int:
        """FRAMEs lost on the way, by their sequence numbers."""
        return self._decoder.lost

    def add(
        self,
        packets: bytes,
        arrived_ns: int,
        all_here_ns: int | None = None,
        applied_n: AppliedN = lambda *rows: None,
        rejected: Mapping[str, int] | None = None,
    ) -> None:
        """Append whole packets; ``arrived_ns`` is when the first of them arrived, in ns on the host's clock (Unix).

        ``all_here_ns`` is when all of them had arrived; None if unknown. ``applied_n`` gives the forces on their
        FRAMEs. ``rejected``: damaged packets of this block. Raises ValueError where a packet is cut off.
        """
        if not packets and not rejected:
            return
        decoder = self._decoder
        if all_here_ns is not None and self._last_ns is not None:
            decoder.passed((arrived_ns - self._last_ns) / 1e9)
        self._last_ns = all_here_ns
        clock_us, lost = decoder.clock_us, decoder.lost
        batch = decoder.feed_packets(packets)
        given = applied_n(batch.wire["finger"], batch.t_us)
        applied = b"" if given is None or np.isnan(given).all() else pack_applied(given)
        self.frames += len(batch.wire)
        of_block = clock_us, batch.first_t_us(), batch.last_t_us(), rows_of(batch)
        so_far = self.frames, decoder.lost, decoder.lost_pac, decoder.disordered
        head = Head(*of_block, *so_far, dict(rejected or {}), has_packets=bool(packets), has_applied=bool(applied))
        self._place(head, decoder.lost - lost)
        self._last_us = head.last_us if head.last_us is not None else self._last_us
        self._put({layout.PACKETS: packets, layout.APPLIED: applied}, head, arrived_ns, all_here_ns)

    def add_gap(self, gap: Gap) -> None:
        """Note that the board was away before the bytes that are added next."""
        self._gaps.append(gap)

    def add_label(self, label: Label) -> None:
        """Note a label that ends near the rows added last; the times may be unwrapped in any way."""
        self._labels.append(label)

    def _place(self, head: Head, lost: int, *, over: bool = False) -> None:
        """Give ``head`` the gaps and labels that can be placed now, in the file's own times, below 2**32 us at first.

        Labels wait for the first row and gaps for the next one, unless all is ``over``. ``lost``: frames lost in it.
        """
        has_row = self._last_us is not None or head.first_us is not None
        labels = [label for label in self._labels if over or has_row or label.t_us is None]
        self._labels = [label for label in self._labels if label not in labels]
        labels = [self._placed(label, head.first_us) if has_row else label for label in labels]
        gaps = [self._between_rows(gap, head, lost) for gap in self._gaps if over or head.first_us is not None]
        self._gaps = self._gaps[len(gaps) :]
        head.gaps.extend(map(asdict, gaps))
        head.labels.extend(map(asdict, labels))

    def _between_rows(self, gap: Gap, head: Head, lost: int) -> Gap:
        last_us, next_us = gap.last_t_us, gap.next_t_us
        if gap.reason == "slow" and next_us is None:  # of this file's writer
            fingers = sum(1 << finger for finger in head.fingers)
            return replace(gap, last_t_us=self._last_us, next_t_us=head.first_us, fingers=fingers, frames_missed=lost)
        near_us = head.first_us if head.first_us is not None else self._last_us
        if next_us is not None and near_us is not None:
            moved_us = self._near(next_us, near_us) - next_us
            next_us += moved_us
            # A gap of one finger: the others' rows went on meanwhile.
            of_one = gap.reason in ("lost", "finger", "hold") or self._last_us is None
            if last_us is not None and gap.reason != "rebooted":
                last_us = last_us + moved_us if of_one else self._near(last_us, self._last_us or 0)
        elif last_us is not None and self._last_us is not None:
            last_us = self._near(last_us, self._last_us)
        return replace(gap, last_t_us=last_us, next_t_us=next_us)

    def _placed(self, label: Label, first_us: int | None) -> Label:
        t_us, end_us = label.t_us, label.end_us
        if t_us is None:
            return label
        latest_us = t_us if end_us is None else end_us
        is_after = any(gap.next_t_us is not None and latest_us >= gap.next_t_us for gap in self._gaps)
        near_us = first_us if self._last_us is None or (is_after and first_us is not None) else self._last_us
        assert near_us is not None
        moved_us = 0 if latest_us == NEXT_ROW_US else self._near(latest_us, near_us) - latest_us
        begin_us = near_us if t_us == NEXT_ROW_US else t_us + moved_us
        if self._last_us is None:
            begin_us = max(begin_us, near_us)
        begin_us = self._begins_us.setdefault(t_us, begin_us)
        return replace(label, t_us=begin_us, end_us=None if end_us is None else max(begin_us, end_us + moved_us))

    def _near(self, t_us: int, near_us: int) -> int:
        return nearest(t_us & 0xFFFFFFFF, near_us) if self.shift_us is None else t_us + self.shift_us

    def _put(self, parts: Mapping[str, bytes], head: Head, arrived_ns: int, all_here_ns: int | None) -> None:
        """Write a block, each part as a chunk of its own, so that a reader need not open the others."""
        for topic, data in {**parts, layout.HEAD: head.pack()}.items():
            if not data:
                continue
            if topic not in self._channels:
                self._channels[topic] = self._writer.register_channel(topic, layout.ENCODINGS[topic], self._schema)
            self._writer.add_message(self._channels[topic], all_here_ns or arrived_ns, data, arrived_ns, self._sequence)
            self._writer.flush()  # type: ignore[no-untyped-call]
        self._sequence += 1

    def close(self) -> None:
        """Write the index. Safe to call twice."""
        if self.stream.closed:
            return
        try:
            if self._gaps or self._labels:
                at_ns = self._gaps[-1].back_at_ns if self._gaps else self._last_ns or 0
                head = Head(self._decoder.clock_us, has_packets=False)
                head.frames, head.frames_lost = self.frames, self._decoder.lost
                head.pac_lost, head.disordered = self._decoder.lost_pac, self._decoder.disordered
                self._place(head, 0, over=True)
                self._put({}, head, at_ns, at_ns)
            self._writer.add_metadata(layout.METADATA_AGAIN, self._metadata)
            self._writer.flush()  # type: ignore[no-untyped-call]  # finish() forgets its own flush in the checksum
            self._writer.finish()  # type: ignore[no-untyped-call]
        finally:
            self.stream.close()  # also on a full disk, or the interpreter would try again at exit
