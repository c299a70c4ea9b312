"""The link's decoder against MAVLink's and against decoders written in Python, in one run.

The input is FRAMEs and PACs of five simulated fingers, in memory, in chunks. As in a live reader, the result of one
chunk is released before the next. Rounds are interleaved, each contestant runs once untimed first, and times are
medians of CPU time. Absolute times hold for this machine only.
"""

from __future__ import annotations

import gc
import zlib
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from time import process_time_ns
from types import ModuleType
from typing import Any

import numpy as np

import biotac

from ...errors import InputError
from ...wire import messages_gen as wire
from ...wire.batches import StreamDecoder
from ...wire.decoder import Decoder
from ...wire.dtypes_gen import DTYPES
from ...wire.frames import StructArray
from ...wire.framing import encode
from . import mavlink
from .timing import Contestant, Ratio, Row, timed

FINGERS = 5
FRAMES_PER_S = 100 * FINGERS
SOURCE = "sim:press.toml"
ROUNDS = 7
CHUNK_BYTES = (4096, 65536)  # the most that one read of a serial port, and of the recording reader, gives
CRC_BYTES = 4
CRC_RESIDUE = zlib.crc32(zlib.crc32(b"any").to_bytes(CRC_BYTES, "little"), zlib.crc32(b"any"))
FRAME, PAC, UNITS_OF_FRAME = wire.Frame.ID, wire.Pac.ID, -1
NAMES = {FRAME: "FRAME", PAC: "PAC"}
EXTRA = "bench decode needs pymavlink and cobs; pip install 'biotac-gateway[bench]'"

OURS, LIVE, UNITS = "biotac Decoder", "biotac StreamDecoder", "biotac StreamDecoder, units"
MAVLINK, STRUCT, NUMPY = "pymavlink", "C-cobs + zlib + struct", "C-cobs + zlib + NumPy frombuffer"

#: (faster, slower, smallest ratio); None where there is no requirement.
ASKED: tuple[tuple[str, str, float | None], ...] = (
    (OURS, MAVLINK, 150.0),
    (OURS, STRUCT, 15.0),
    (OURS, NUMPY, 5.0),
    (LIVE, MAVLINK, None),
)

Chunks = list[bytes]
Columns = dict[int, Any]  # by message id: an array, or a list of tuples or messages, in order of arrival
Feed = Callable[[bytes], Columns]


@dataclass(frozen=True)
class Result:
    """One chunk size. Rows are ns per message; a FRAME and a PAC count as one each.

    Ratios use the slower contestant's best median of all chunk sizes.
    """

    chunk_bytes: int
    rows: list[Row]
    ratios: list[Ratio]


@dataclass(frozen=True)
class Outcome:
    """One run over ``seconds`` of stream; bytes per message on the wire are means."""

    seconds: float
    messages: int
    bytes_per_message: float
    mavlink_bytes_per_message: float
    results: list[Result]


@dataclass(frozen=True)
class _Contestant:
    name: str
    chunks: Chunks
    start: Callable[[], Feed]  # makes a fresh decoder; the function takes its chunks


def recording(frames: int) -> dict[int, StructArray]:
    """FRAME and PAC messages of five simulated fingers, as rows of DTYPES by id."""
    with biotac.open(f"{SOURCE}?fingers={FINGERS}&seconds={frames / FRAMES_PER_S}") as hand:
        hand.start()
        batch = hand.read_batch(1e6)
    pac = np.empty(len(batch.pac), DTYPES[PAC])
    pac["seq"], pac["t_us"] = batch.pac["seq"] % 2**16, batch.pac["t_us"] % 2**32
    pac["finger"], pac["pac"] = batch.pac["finger"], batch.pac["pac"]
    return {FRAME: batch.wire, PAC: pac}


def measure(frames: int, rounds: int = ROUNDS) -> Outcome:
    """Check that all contestants decode the same fields, then time them.

    Raises InputError without the extra `bench`, RuntimeError if two contestants differ.
    """
    cobs_decode, dialect = _extra()
    sent = recording(frames)
    messages = _as_sent(sent)
    ours = b"".join(encode(m.ID, m.pack()) for m in messages)
    theirs = b"".join(map(mavlink.encoder(dialect), messages))
    live = {FRAME: "wire", PAC: "pac"}
    tables: list[list[Row]] = []
    for chunk_bytes in CHUNK_BYTES:
        chunks, mavlink_chunks = _chunks(ours, chunk_bytes), _chunks(theirs, chunk_bytes)
        contestants = [
            _Contestant(OURS, chunks, partial(_ours, Decoder, {FRAME: "frames", PAC: "pacs"})),
            _Contestant(LIVE, chunks, partial(_ours, StreamDecoder, live)),
            _Contestant(UNITS, chunks, partial(_ours, StreamDecoder, live | {UNITS_OF_FRAME: "frames"})),
            _Contestant(MAVLINK, mavlink_chunks, partial(_mavlink, dialect)),
            _Contestant(STRUCT, chunks, partial(_struct, cobs_decode)),
            _Contestant(NUMPY, chunks, partial(_numpy, cobs_decode)),
        ]
        for contestant in contestants:
            _check(contestant, sent)
        tables.append(_timed(contestants, rounds, len(messages)))
    # Decoders that make an object per value are slower with long chunks (fresh memory): take each at its best.
    best = {row.name: min(row.median_ns, other.median_ns) for row, other in zip(*tables, strict=True)}
    results = []
    for chunk_bytes, rows in zip(CHUNK_BYTES, tables, strict=True):
        times = {row.name: row.median_ns for row in rows}
        ratios = [Ratio(fast, slow, best[slow] / times[fast], asked) for fast, slow, asked in ASKED]
        results.append(Result(chunk_bytes, rows, ratios))
    n = len(messages)
    return Outcome(frames / FRAMES_PER_S, n, len(ours) / n, len(theirs) / n, results)


def _extra() -> tuple[Callable[[bytes], bytes], ModuleType]:
    try:
        from cobs import cobs

        return cobs.decode, mavlink.generate(NAMES)
    except ImportError as error:
        raise InputError(f"{EXTRA} ({error})") from None


def _as_sent(sent: dict[int, StructArray]) -> list[Any]:
    """All messages in the board's order: in each round all FRAMEs, then all PACs."""
    messages = [(wire.MESSAGES[i].unpack(row.tobytes()), k) for i, rows in sent.items() for k, row in enumerate(rows)]
    return [m for m, k in sorted(messages, key=lambda message: (message[1] // FINGERS, message[0].ID))]


def _chunks(data: bytes, size: int) -> Chunks:
    return [data[at : at + size] for at in range(0, len(data), size)]


# ---- contestants: all check what they accept and count what they reject --------------------------


def _ours(make: Callable[[], Any], columns: dict[int, str]) -> Feed:
    """A decoder of this package; ``columns`` names the part of its batches to read, by message id."""
    decoder = make()

    def feed(chunk: bytes) -> Columns:
        batch = decoder.feed(chunk)
        return {message_id: getattr(batch, name) for message_id, name in columns.items()}

    return feed


def _mavlink(dialect: ModuleType) -> Feed:
    parser = dialect.MAVLink(None)
    frame_id = mavlink.FIRST_ID + FRAME

    def feed(chunk: bytes) -> Columns:
        frames: list[Any] = []
        pacs: list[Any] = []
        for message in parser.parse_buffer(chunk) or ():
            (frames if message.id == frame_id else pacs).append(message)
        return {FRAME: frames, PAC: pacs}

    return feed


def _struct(cobs_decode: Callable[[bytes], bytes]) -> Feed:
    unpackers = {i: wire.MESSAGES[i].STRUCT.unpack for i in NAMES}
    crc32 = zlib.crc32
    rest, bad = b"", 0

    def feed(chunk: bytes) -> Columns:
        nonlocal rest, bad
        *pieces, rest = (rest + chunk).split(b"\0")
        columns: dict[int, list[Any]] = {FRAME: [], PAC: []}
        for piece in pieces:
            try:
                plain = cobs_decode(piece)
                if crc32(plain) != CRC_RESIDUE:
                    bad += 1
                    continue
                message_id = plain[0]
                columns[message_id].append(unpackers[message_id](plain[1:-CRC_BYTES]))
            except Exception:
                bad += 1
        return columns

    return feed


def _numpy(cobs_decode: Callable[[bytes], bytes]) -> Feed:
    # With id and CRC in the row no message needs slicing; a view drops them afterwards.
    dtypes = {i: np.dtype([("id", "u1"), ("payload", DTYPES[i]), ("crc", "<u4")]) for i in NAMES}
    sizes = {i: dtype.itemsize for i, dtype in dtypes.items()}
    crc32 = zlib.crc32
    rest, bad = b"", 0

    def feed(chunk: bytes) -> Columns:
        nonlocal rest, bad
        *pieces, rest = (rest + chunk).split(b"\0")
        plains: dict[int, list[bytes]] = {FRAME: [], PAC: []}
        for piece in pieces:
            try:
                plain = cobs_decode(piece)
                message_id = plain[0]
                if crc32(plain) == CRC_RESIDUE and len(plain) == sizes[message_id]:
                    plains[message_id].append(plain)
                else:
                    bad += 1
            except Exception:
                bad += 1
        return {i: np.frombuffer(b"".join(rows), dtypes[i])["payload"] for i, rows in plains.items()}

    return feed


# ---- checks and timing --------------------------------------------------------------------------


def _check(contestant: _Contestant, sent: dict[int, StructArray]) -> None:
    name, feed = contestant.name, contestant.start()
    parts = [feed(chunk) for chunk in contestant.chunks]
    for message_id, rows in sent.items():
        got = [part[message_id] for part in parts]
        arrays = all(isinstance(part, np.ndarray) for part in got)
        whole = np.concatenate(got) if arrays else _array([m for part in got for m in part], rows.dtype)
        for field in rows.dtype.names or ():
            if len(whole) != len(rows) or not np.array_equal(whole[field].astype(rows[field].dtype), rows[field]):
                raise RuntimeError(f"{name} decoded a wrong {field} of {NAMES[message_id]}; do not compare its times")


def _array(messages: list[Any], dtype: np.dtype[Any]) -> StructArray:
    """Messages as an array; each is an object with the fields, or a tuple in their order, flattened as by struct."""
    out = np.empty(len(messages), dtype)
    at = 0
    for field in dtype.names or ():
        shape = out[field].shape[1:]
        width = int(np.prod(shape))
        if messages and isinstance(messages[0], tuple):
            values = [m[at : at + width] for m in messages]
        else:
            values = [getattr(m, field) for m in messages]
        out[field] = np.array(values).reshape(len(messages), *shape)
        at += width
    return out


def _timed(contestants: list[_Contestant], rounds: int, messages: int) -> list[Row]:
    # The garbage collector stays on, as a cost of making many objects. The benchmark's own objects are frozen, so that
    # no contestant pays for walking them.
    gc.collect()
    gc.freeze()
    try:
        return timed([Contestant(c.name, messages, partial(_feed, c)) for c in contestants], rounds, process_time_ns)
    finally:
        gc.unfreeze()


def _feed(contestant: _Contestant) -> None:
    feed = contestant.start()
    for chunk in contestant.chunks:
        feed(chunk)
