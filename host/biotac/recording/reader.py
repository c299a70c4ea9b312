"""Reading a recording, whole or cut off."""

from __future__ import annotations

import json
import os
import struct
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
from mcap.exceptions import InvalidMagic, McapError
from mcap.records import Channel, Chunk, McapRecord, Message, Metadata
from mcap.stream_reader import StreamReader, breakup_chunk

from ..clock import LAST_SAMPLE_US, DeviceClock
from ..errors import InputError, RecordingError
from ..hand.gap import GAP, Gap
from ..keep.calibration_file import from_dict
from ..keep.map_blob import as_blob
from ..keep.values import own_settings
from ..wire import messages_gen as wire
from ..wire.batches import StreamDecoder, join
from ..wire.frames import StructArray
from ..wire.identity import NO_IMAGE
from . import layout


class Recording:
    """A recording in memory.

    ``frames`` (FRAME_DTYPE) and ``pac`` (PAC_DTYPE) are arrays in the order of arrival, ``idle`` (IDLE_DTYPE)
    heartbeats, ``wire`` the FRAME messages as sent, ``messages`` the rest (tare changes, status). ``settings`` are the
    board's, ``calibrations`` and ``maps`` (bytes, as the board holds them) those in force, by finger, when it began.
    ``problems`` lists in words what is missing or damaged; the rest is good. ``cut_off``: the file ends without its
    index; ``damaged_chunks``: seconds that were left out; ``gaps``: times in which the board was away. ``blocks`` are
    the wire's bytes as they came, about one a second, and ``arrived_ns`` when each began, by the host's clock (Unix).
    Raises RecordingError when nothing can be read. ``show`` is told the share of the work that is done.
    """

    def __init__(self, path: str | os.PathLike[str], show: Callable[[float], None] = lambda share: None) -> None:
        self.path = Path(path)
        self.problems: list[str] = []
        self.cut_off = False
        self.damaged_chunks = 0
        self.gaps: list[Gap] = []
        metadata: dict[str, str] | None = None
        self.blocks: list[bytes] = []
        self.arrived_ns: list[int] = []
        all_here_s: list[float] = []
        for record in self._records():
            if isinstance(record, Metadata) and record.name == layout.METADATA_NAME:
                metadata = record.metadata
            elif isinstance(record, Metadata) and record.name == f"{layout.METADATA_NAME}.{GAP}":
                self._take_gap(record.metadata)
            elif isinstance(record, Message):
                self.blocks.append(record.data)
                self.arrived_ns.append(record.publish_time)
                all_here_s.append(record.log_time / 1e9)
        if metadata is None:
            raise RecordingError(self._without_metadata())
        try:
            self._take_metadata(metadata)
        except (KeyError, TypeError, ValueError) as error:
            raise RecordingError(f"{self.path} has damaged metadata ({error}); its frames cannot be judged") from error
        decoder = StreamDecoder()
        decoder.accept_newer_minor()
        parts = []
        for k, block in enumerate(self.blocks):
            parts.append(decoder.feed(block))
            show((k + 1) / len(self.blocks))
        batch = join(parts)
        ends_us = [part.last_t_us() for part in parts]
        self._arrivals = [(t_us, at_s) for t_us, at_s in zip(ends_us, all_here_s, strict=True) if t_us is not None]
        self.frames: StructArray = batch.frames
        self.wire: StructArray = batch.wire
        self.pac: StructArray = batch.pac
        self.idle: StructArray = batch.idle
        self.messages: list[Any] = batch.messages
        self.counts = decoder.counts
        self.frames_lost = decoder.lost
        self.pac_lost = decoder.lost_pac
        self.disordered = decoder.disordered
        if self.cut_off and not len(self.frames):
            raise RecordingError(f"{self.path} was cut off before its first second was whole; record it again")
        self._describe_losses(decoder)

    def clock(self, promised_delay_s: float = 0.01) -> DeviceClock:
        """The board's clock against the recording computer's; its host_time_s is in seconds since 1970.

        Each second was written when its last frame had come. A recording holds no round trips: the stated
        uncertainty rests on ``promised_delay_s``, your word that in every 5 s one of these frames took no longer
        from the board to the file.
        """
        clock = DeviceClock(promised_delay_s=promised_delay_s, unix_offset_s=0.0)
        for t_us, at_s in self._arrivals:
            clock.arrived(t_us + LAST_SAMPLE_US, at_s)
        return clock

    def _take_gap(self, text: dict[str, str]) -> None:
        try:
            gap = Gap.from_text(text)
        except (KeyError, ValueError) as error:
            self.problems.append(f"a gap is marked in {self.path.name}, in words that are damaged ({error})")
            return
        self.gaps.append(gap)
        self.problems.append(gap.words())

    def _without_metadata(self) -> str:
        if self.problems:
            return f"{self.path} was cut off before its first record; nothing can be read: record it again"
        return f"{self.path} is an MCAP file, but no biotac recording; expected one that `biotac record` wrote"

    def _take_metadata(self, metadata: dict[str, str]) -> None:
        if metadata.get("format") != layout.FORMAT_VERSION:
            raise RecordingError(
                f"{self.path} has recording format {metadata.get('format')}, this version reads "
                f"{layout.FORMAT_VERSION}; install a newer biotac-gateway"
            )
        major = metadata["wire"].partition(".")[0]
        if int(major) != wire.WIRE_MAJOR:
            raise RecordingError(
                f"{self.path} holds wire {metadata['wire']}, this version reads {wire.WIRE_MAJOR}.x; "
                "install the biotac-gateway it was recorded with"
            )
        self.metadata = metadata
        hello: dict[str, Any] = {"image_crc32": NO_IMAGE} | json.loads(metadata["hello"])
        self.info = wire.Hello(**_tuples(hello))
        self.sensors = [wire.SensorInfo(**_tuples(s)) for s in json.loads(metadata.get("sensors", "[]"))]
        named = json.loads(metadata["settings"])
        own = json.loads(metadata.get("calibrations", "{}"))
        # A setting or a calibration that this recording's firmware did not have yet: the default, and none.
        self.calibrations = {int(finger): from_dict(its) for finger, its in own.items()}
        self.maps = _maps(metadata.get("maps", "{}"))
        self.settings = {s: int(named.get(s.name.lower(), wire.SETTINGS[s].default)) for s in wire.Setting}

    @property
    def finger_settings(self) -> dict[int, dict[wire.Setting, int]]:
        """All settings that a finger's results come from, for the fingers that had a calibration in force."""
        return own_settings(self.settings, self.calibrations)

    def _records(self) -> Iterator[McapRecord]:
        try:
            size = self.path.stat().st_size
            stream = self.path.open("rb")
        except OSError as error:
            raise RecordingError(f"{self.path} cannot be read ({error.strerror}); check the path") from error
        with stream:
            topics: dict[int, str] = {}
            whole = False
            begun = False
            good_until = 0
            try:
                for record in StreamReader(stream, emit_chunks=True).records:
                    begun = True
                    inner = self._open_chunk(record) if isinstance(record, Chunk) else [record]
                    for item in inner:
                        if isinstance(item, Channel):
                            topics[item.id] = item.topic
                        if not isinstance(item, Message) or topics.get(item.channel_id) == layout.TOPIC:
                            yield item
                    good_until = stream.tell()
                whole = True
            except (McapError, struct.error, ValueError, EOFError, MemoryError, OverflowError) as error:
                # Cut off in the middle of a record, and what came before it is good; unless it
                # never was such a file.
                if isinstance(error, InvalidMagic) and not begun:
                    raise RecordingError(
                        f"{self.path} is no MCAP file ({size} bytes, wrong first bytes); expected a file that "
                        "`biotac record` wrote"
                    ) from error
            if not whole:
                self.cut_off = True
                unread = size - good_until
                self.problems.append(
                    f"{self.path.name} ends without its index, as after a kill or a full disk: its last {unread} bytes "
                    "are missing or unreadable, what came before them is read"
                )

    def _open_chunk(self, chunk: Chunk) -> list[McapRecord]:
        try:
            return list(breakup_chunk(chunk, validate_crc=True))
        except Exception as error:  # mcap, zstandard and struct each raise their own kinds
            self.damaged_chunks += 1
            self.problems.append(f"one second of {self.path.name} is damaged and left out ({error})")
            return []

    @property
    def fingers(self) -> list[int]:
        """Fingers of which there is a frame, a heartbeat or PAC."""
        rows = (self.frames, self.idle, self.pac)
        return sorted({int(finger) for table in rows for finger in np.unique(table["finger"])})

    @property
    def begin_us(self) -> int:
        """Device time of the first frame or heartbeat; 0 without any."""
        return min((int(rows["t_us"].min()) for rows in (self.frames, self.idle) if len(rows)), default=0)

    @property
    def end_us(self) -> int:
        """Device time of the last frame or heartbeat; 0 without any."""
        return max((int(rows["t_us"].max()) for rows in (self.frames, self.idle) if len(rows)), default=0)

    @property
    def begin_ns(self) -> int:
        """``begin_us`` on the host's clock (Unix), as good as the link is prompt."""
        return self.arrived_ns[0] if self.arrived_ns else 0

    def _describe_losses(self, decoder: StreamDecoder) -> None:
        for finger, seq, lost in decoder.lost_after[:10]:
            self.problems.append(f"finger {finger}: {lost} frame(s) missing after frame {seq}")
        if len(decoder.lost_after) > 10:
            self.problems.append(f"{len(decoder.lost_after) - 10} more gaps")
        counts = decoder.counts
        if counts.bad:
            self.problems.append(
                f"{counts.bad} wire frame(s) refused: {counts.bad_crc} bad CRC, {counts.bad_cobs} bad COBS, "
                f"{counts.bad_length} wrong length, {counts.too_long} too long"
            )


def _maps(text: str) -> dict[int, bytes]:
    """Maps as JSON had them; ValueError for what is none."""
    try:
        return {finger: as_blob(its) for finger, its in layout.maps_of(text).items()}
    except InputError as error:
        raise ValueError(error) from error


def _tuples(fields: dict[str, Any]) -> dict[str, Any]:
    """A message's fields as JSON had them."""
    return {name: tuple(value) if isinstance(value, list) else value for name, value in fields.items()}


def load(path: str | os.PathLike[str]) -> StructArray:
    """Return a recording's frames as one FRAME_DTYPE array (n,), in order of arrival.

    Raises RecordingError when the file is no recording. A recording that was cut off gives what is
    whole; use Recording to learn what is missing.
    """
    return Recording(path).frames
