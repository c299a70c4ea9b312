"""The MCAP file below every recording, live, recomputed or imported.

Each second is stored as one chunk per finger, one chunk with the other messages and the order of all, which cannot be
recovered from elsewhere, and one chunk for plotting. Each chunk is closed and handed to the operating system at once.
"""

from __future__ import annotations

import contextlib
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict, replace
from typing import BinaryIO

import numpy as np
from mcap.writer import CompressionType, IndexType, Writer

from ..board.gap import NEXT_ROW_US, Gap
from ..link.base import AppliedN
from ..version import __version__
from ..wire.batches import StreamDecoder, join
from ..wire.counters import nearest
from ..wire.decoder import STEP_BYTES
from ..wire.native import BUILT
from . import layout
from .block import Rest, encode_block, schema
from .labels import Label
from .plots import Plots

# Large enough that only flush() closes a chunk; the library would also close it by size.
_CHUNK_BYTES = 1 << 40


class RecordingFile:
    """A recording being written to ``stream``. Closing it closes ``stream``, as does a failure to begin it."""

    def __init__(self, stream: BinaryIO, metadata: dict[str, str]) -> None:
        self.stream = stream
        self._sequence = 0
        self._gaps: list[Gap] = []  # to be written with the next rows, and until then in the times of who gave them
        self._labels: list[Label] = []
        self._begins_us: dict[int, int] = {}  # of labels: one that is given again with its end begins where it did
        #: To be added to these times; None: what brings them next to the rows.
        self.shift_us: int | None = None
        self._decoder = StreamDecoder()
        self._decoder.accept_newer_minor()
        self._last_us: int | None = None  # device time of the last row
        self._last_ns: int | None = None  # when the last block's bytes had all arrived
        self.frames = 0  #: FRAMEs written so far
        self._channels: dict[str, int] = {}
        self._metadata = layout.with_checksum(metadata)
        wire_schema = (BUILT / "schema.json").read_bytes()
        writer = self._writer = Writer(
            stream,
            chunk_size=_CHUNK_BYTES,
            compression=CompressionType.ZSTD,
            index_types=IndexType.ALL,
            enable_data_crcs=True,
        )
        self._plots = Plots(writer)
        try:
            writer.start(profile="", library=f"biotac-gateway {__version__}")
            names = layout.WIRE_SCHEMA, layout.WIRE_SCHEMA_ENCODING
            self._wire_schema = writer.register_schema(*names, wire_schema)
            self._table_schema = writer.register_schema(layout.TABLE_SCHEMA, layout.TABLE_ENCODING, schema())
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
        data: bytes,
        arrived_ns: int,
        all_here_ns: int | None = None,
        applied_n: AppliedN = lambda *rows: None,
        rejected: Mapping[str, int] | None = None,
    ) -> None:
        """Append wire bytes; ``arrived_ns`` is when their first byte arrived, in ns on the host's clock (Unix).

        ``all_here_ns`` is when all of them had arrived; None if unknown. Bytes after the last delimiter wait for the
        next block. ``applied_n`` is asked about its FRAMEs. ``rejected``: what else of this block came damaged.
        """
        decoder = self._decoder
        if all_here_ns is not None and self._last_ns is not None:
            decoder.passed((arrived_ns - self._last_ns) / 1e9)
        self._last_ns = all_here_ns
        losses, before, lost = len(decoder.lost_after), decoder.counts, decoder.lost
        batches, ids, others = [], b"", b""
        for at in range(0, len(data), STEP_BYTES):
            batches.append(decoder.feed(data[at : at + STEP_BYTES]))
            step_ids, step_others = decoder.completed()
            ids, others = ids + step_ids, others + step_others
        damaged = Counter(rejected or {}) + Counter(vars(decoder.counts)) - Counter(vars(before))
        del damaged["good"]
        if not ids and not damaged:
            return
        batch = join(batches)
        tables, order = encode_block(batch, ids, applied_n(batch.wire["finger"], batch.t_us))
        self.frames += len(batch.wire)
        of_block = batch.first_t_us(), batch.last_t_us(), decoder.lost_after[losses:], dict(damaged)
        so_far = self.frames, decoder.lost, decoder.lost_pac, decoder.disordered
        rest = Rest(order, others, sorted(tables), *of_block, *so_far)
        gaps, labels = self._place(rest, decoder.lost - lost)
        self._last_us = rest.last_us if rest.last_us is not None else self._last_us
        self._put(tables, rest, arrived_ns, all_here_ns)
        self._plots.add(batch, decoder, arrived_ns, all_here_ns)
        self._plots.log(gaps, labels, arrived_ns)
        self._writer.flush()  # type: ignore[no-untyped-call]

    def add_gap(self, gap: Gap) -> None:
        """Note that the board was away before the bytes that are added next."""
        self._gaps.append(gap)

    def add_label(self, label: Label) -> None:
        """Note a label whose last time is near that of the rows added last; its times may be unwrapped in any way."""
        self._labels.append(label)

    def _place(self, rest: Rest, lost: int, *, over: bool = False) -> tuple[list[Gap], list[Label]]:
        """Give ``rest`` the gaps and labels that can be placed now, in the file's own times, below 2**32 us at first.

        Labels wait for the first row and gaps for the next one, unless all is ``over``. ``lost``: frames lost in it.
        """
        has_row = self._last_us is not None or rest.first_us is not None
        labels = [label for label in self._labels if over or has_row or label.t_us is None]
        self._labels = [label for label in self._labels if label not in labels]
        labels = [self._placed(label, rest.first_us) if has_row else label for label in labels]
        gaps = [self._between_rows(gap, rest, lost) for gap in self._gaps if over or rest.first_us is not None]
        self._gaps = self._gaps[len(gaps) :]
        rest.gaps.extend(map(asdict, gaps))
        rest.labels.extend(map(asdict, labels))
        return gaps, labels

    def _between_rows(self, gap: Gap, rest: Rest, lost: int) -> Gap:
        last_us, next_us = gap.last_t_us, gap.next_t_us
        if gap.reason == "slow" and next_us is None:  # of who writes this file
            fingers = sum(1 << finger for finger in rest.fingers)
            return replace(gap, last_t_us=self._last_us, next_t_us=rest.first_us, fingers=fingers, frames_missed=lost)
        near_us = rest.first_us if rest.first_us is not None else self._last_us
        if next_us is not None and near_us is not None:
            moved_us = self._near(next_us, near_us) - next_us
            next_us += moved_us
            of_one = gap.reason in ("lost", "finger") or self._last_us is None  # the others' rows went on meanwhile
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

    def _put(self, tables: dict[int, bytes], rest: Rest, arrived_ns: int, all_here_ns: int | None) -> None:
        """Write a block, each part as a chunk of its own, so that a reader need not open the others."""
        parts = {f"{layout.TABLE}{finger}": data for finger, data in sorted(tables.items())}
        for topic, data in (parts | {layout.REST: rest.pack()}).items():
            if topic not in self._channels:
                of_rest = layout.REST_ENCODING, self._wire_schema
                of_table = layout.TABLE_ENCODING, self._table_schema
                encoding, schema_id = of_rest if topic == layout.REST else of_table
                self._channels[topic] = self._writer.register_channel(topic, encoding, schema_id)
            self._writer.add_message(self._channels[topic], all_here_ns or arrived_ns, data, arrived_ns, self._sequence)
            self._writer.flush()  # type: ignore[no-untyped-call]
        self._sequence += 1

    def close(self) -> None:
        """Write the file's index. Safe to call twice."""
        if self.stream.closed:
            return
        try:
            if self._gaps or self._labels:
                at_ns = self._gaps[-1].back_at_ns if self._gaps else self._last_ns or 0
                rest = Rest(np.empty(0, np.uint16), b"")
                gaps, labels = self._place(rest, 0, over=True)
                self._put({}, rest, at_ns, at_ns)
                self._plots.log(gaps, labels, at_ns)
                self._writer.flush()  # type: ignore[no-untyped-call]
            self._writer.add_metadata(layout.METADATA_AGAIN, self._metadata)
            self._writer.flush()  # type: ignore[no-untyped-call]  # finish() leaves what it flushes itself out of its checksum
            self._writer.finish()  # type: ignore[no-untyped-call]
        finally:
            self.stream.close()  # also on a full disk, or the interpreter would try again at exit
