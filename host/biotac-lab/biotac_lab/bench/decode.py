"""The link's decoder against MAVLink's and against decoders written in Python, in one run.

The input is FRAMEs and PACs of five simulated fingers, in memory, in chunks. As in a live reader, the result of one
chunk is released before the next. Rounds are interleaved, and times are medians of CPU time.
"""

from __future__ import annotations

import contextlib
import gc
import io
import runpy
import tempfile
import zlib
from collections.abc import Callable
from functools import partial
from pathlib import Path
from time import process_time_ns
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import biotac
from biotac.wire import DTYPES, Decoder, StreamDecoder, encode, messages

from ..report import Show, Table
from .contest import Asked, Contestant, check_installed, tables, timed

FINGERS = 5
FRAMES_PER_S = 100 * FINGERS
ROUNDS = 7
CHUNK_BYTES = (4096, 65536)  # the most that one read of a serial port, and of the recording reader, gives
CRC_BYTES = 4
CRC_RESIDUE = zlib.crc32(zlib.crc32(b"any").to_bytes(CRC_BYTES, "little"), zlib.crc32(b"any"))
FRAME, PAC, UNITS_OF_FRAME = messages.FrameMessage.ID, messages.Pac.ID, -1
NAMES = {FRAME: "FRAME", PAC: "PAC"}
MAVLINK_ID = 100  # of the dialect's messages, plus the link's own id
MAVLINK_TYPES = {"u1": "uint8_t", "u2": "uint16_t", "u4": "uint32_t", "i2": "int16_t", "i4": "int32_t"}

OURS, LIVE, UNITS = "biotac Decoder", "biotac StreamDecoder", "biotac StreamDecoder, units"
MAVLINK, STRUCT, NUMPY = "pymavlink", "C-cobs + zlib + struct", "C-cobs + zlib + NumPy frombuffer"
ASKED: Asked = ((OURS, MAVLINK, 60.0), (OURS, STRUCT, 8.0), (OURS, NUMPY, 3.0), (LIVE, MAVLINK, None))

Rows = NDArray[Any]
Columns = dict[int, Any]  # by message id: an array, or a list of tuples or messages, in order of arrival
Feed = Callable[[bytes], Columns]
Start = Callable[[], Feed]  # makes a fresh decoder; the function decodes chunks


def recording(frames: int) -> dict[int, Rows]:
    """FRAME and PAC messages of five simulated fingers, as rows of DTYPES by id."""
    with biotac.open(f"sim:press.toml?fingers={FINGERS}&seconds={frames / FRAMES_PER_S}") as hand:
        hand.stream()
        batch = hand.read_batch(1e6)
    pac = np.empty(len(batch.pac), DTYPES[PAC])
    pac["seq"], pac["t_us"] = batch.pac["seq"] % 2**16, batch.pac["t_us"] % 2**32
    pac["finger"], pac["pac"] = batch.pac["finger"], batch.pac["pac"]
    return {FRAME: batch.wire, PAC: pac}


def measure(frames: int = 30_000, show: Show = lambda text: None, rounds: int = ROUNDS) -> list[Table]:
    """Check that all contestants decode the same fields, then time them; ratios are to the other's better chunk size.

    Raises InputError without the extra `bench`, RuntimeError if two contestants differ.
    """
    check_installed("cobs", "pymavlink")
    from cobs import cobs

    dialect = mavlink_dialect()
    sent = recording(frames)
    unpacked = [
        (messages.MESSAGES[i].unpack(row.tobytes()), k) for i, rows in sent.items() for k, row in enumerate(rows)
    ]
    # in the board's order: in each round all FRAMEs, then all PACs
    stream = [m for m, k in sorted(unpacked, key=lambda pair: (pair[1] // FINGERS, pair[0].ID))]
    ours, theirs = b"".join(encode(m.ID, m.pack()) for m in stream), _mavlink_bytes(dialect, stream)
    live = {FRAME: "wire", PAC: "pac"}
    found = []
    for size in CHUNK_BYTES:
        chunks = _chunks(ours, size)
        starts: dict[str, tuple[list[bytes], Start]] = {
            OURS: (chunks, partial(_ours, Decoder, {FRAME: "frames", PAC: "pacs"})),
            LIVE: (chunks, partial(_ours, StreamDecoder, live)),
            UNITS: (chunks, partial(_ours, StreamDecoder, live | {UNITS_OF_FRAME: "frames"})),
            MAVLINK: (_chunks(theirs, size), partial(_mavlink, dialect)),
            STRUCT: (chunks, partial(_struct, cobs.decode)),
            NUMPY: (chunks, partial(_numpy, cobs.decode)),
        }
        for name, (data, start) in starts.items():
            check(name, data, start, sent)
        contestants = [Contestant(name, len(stream), partial(_feed, *start)) for name, start in starts.items()]
        show(f"chunks of {size} bytes")
        gc.collect()
        gc.freeze()  # so that no contestant pays for walking the benchmark's own objects
        try:
            found.append(timed(contestants, rounds, process_time_ns))
        finally:
            gc.unfreeze()
    # Decoders that make an object per value are slower with long chunks (fresh memory): each is compared at its best.
    best = {name: min(times[name] for times in found) for name in found[0]}
    titles = [f"chunks of {size} bytes" for size in CHUNK_BYTES]
    return [table for k, title in enumerate(titles) for table in tables(title, "message", found[k], best, ASKED)]


def _chunks(data: bytes, size: int) -> list[bytes]:
    return [data[at : at + size] for at in range(0, len(data), size)]


# ---- contestants: all check the packets that they accept and count rejected ones ----------------


def _ours(make: Callable[[], Any], columns: dict[int, str]) -> Feed:
    decoder = make()

    def feed(chunk: bytes) -> Columns:
        batch = decoder.feed(chunk)
        return {message_id: getattr(batch, name) for message_id, name in columns.items()}

    return feed


def _mavlink(dialect: SimpleNamespace) -> Feed:
    parser = dialect.MAVLink(None)

    def feed(chunk: bytes) -> Columns:
        found: dict[int, list[Any]] = {FRAME: [], PAC: []}
        for message in parser.parse_buffer(chunk) or ():
            found[message.id - MAVLINK_ID].append(message)
        return found

    return feed


def _packets(cobs_decode: Callable[[bytes], bytes], accept: Callable[[bytes], None]) -> Callable[[bytes], None]:
    """Calls ``accept`` with each packet that has a right CRC; counts the others."""
    rest, bad, crc32 = b"", 0, zlib.crc32

    def feed(chunk: bytes) -> None:
        nonlocal rest, bad
        *pieces, rest = (rest + chunk).split(b"\0")
        for piece in pieces:
            try:
                plain = cobs_decode(piece)
                if crc32(plain) == CRC_RESIDUE:
                    accept(plain)
                else:
                    bad += 1
            except Exception:
                bad += 1

    return feed


def _struct(cobs_decode: Callable[[bytes], bytes]) -> Feed:
    unpackers = {i: messages.MESSAGES[i].STRUCT.unpack for i in NAMES}
    columns: dict[int, list[Any]] = {}
    packets = _packets(cobs_decode, lambda plain: columns[plain[0]].append(unpackers[plain[0]](plain[1:-CRC_BYTES])))

    def feed(chunk: bytes) -> Columns:
        columns.update({FRAME: [], PAC: []})
        packets(chunk)
        return dict(columns)

    return feed


def _numpy(cobs_decode: Callable[[bytes], bytes]) -> Feed:
    # With id and CRC in the row no message needs slicing; a view drops them afterwards.
    dtypes = {i: np.dtype([("id", "u1"), ("payload", DTYPES[i]), ("crc", "<u4")]) for i in NAMES}
    plains: dict[int, list[bytes]] = {}
    packets = _packets(cobs_decode, lambda plain: plains[plain[0]].append(plain))

    def feed(chunk: bytes) -> Columns:
        plains.update({FRAME: [], PAC: []})
        packets(chunk)
        return {i: np.frombuffer(b"".join(rows), dtypes[i])["payload"] for i, rows in plains.items()}

    return feed


def _feed(chunks: list[bytes], start: Start) -> None:
    feed = start()
    for chunk in chunks:
        feed(chunk)


def check(name: str, chunks: list[bytes], start: Start, sent: dict[int, Rows]) -> None:
    """Raise RuntimeError if a contestant does not decode the messages ``sent``: it is none."""
    feed = start()
    parts = [feed(chunk) for chunk in chunks]
    for message_id, rows in sent.items():
        got = [part[message_id] for part in parts]
        arrays = all(isinstance(part, np.ndarray) for part in got)
        whole = np.concatenate(got) if arrays else _array([m for part in got for m in part], rows.dtype)
        for field in rows.dtype.names or ():
            if len(whole) != len(rows) or not np.array_equal(whole[field].astype(rows[field].dtype), rows[field]):
                raise RuntimeError(f"{name} decoded a wrong {field} of {NAMES[message_id]}; do not compare its times")


def _array(found: list[Any], dtype: np.dtype[Any]) -> Rows:
    """Messages as an array; each is an object with the fields, or a tuple in their order, flattened as by struct."""
    out, at = np.empty(len(found), dtype), 0
    for field in dtype.names or ():
        shape = out[field].shape[1:]
        width = int(np.prod(shape))
        values = [m[at : at + width] if isinstance(m, tuple) else getattr(m, field) for m in found]
        out[field] = np.array(values).reshape(len(found), *shape)
        at += width
    return out


# ---- MAVLink: a dialect of the same fields, generated by pymavlink itself ------------------------


def mavlink_dialect() -> SimpleNamespace:
    """The Python module that pymavlink generates for FRAME and PAC. ImportError without pymavlink."""
    from pymavlink.generator import mavgen

    xml = ""
    for message_id, name in NAMES.items():
        xml += f'<message id="{MAVLINK_ID + message_id}" name="{name}">'
        for field, (kind, *_) in (DTYPES[message_id].fields or {}).items():
            size = f"[{int(np.prod(kind.shape))}]" if kind.shape else ""
            xml += f'<field type="{MAVLINK_TYPES[kind.base.str[1:]]}{size}" name="{field}"/>'
        xml += "</message>"
    with tempfile.TemporaryDirectory(prefix="biotac-mavlink-") as folder:
        source, module = Path(folder, "biotac_bench.xml"), Path(folder, "biotac_bench.py")
        xml = f'<?xml version="1.0"?><mavlink><version>3</version><messages>{xml}</messages></mavlink>'
        source.write_text(xml, encoding="utf-8")
        options = SimpleNamespace(
            output=str(module), wire_protocol="2.0", language="Python3", validate=False, strict_units=False
        )
        with contextlib.redirect_stdout(io.StringIO()):  # it prints progress
            mavgen.mavgen(options, [str(source)])
        return SimpleNamespace(**runpy.run_path(str(module)))


def _mavlink_bytes(dialect: SimpleNamespace, stream: list[Any]) -> bytes:
    sender, packed = dialect.MAVLink(None, srcSystem=1, srcComponent=1), []
    for message in stream:
        kind = dialect.mavlink_map[MAVLINK_ID + message.ID]
        packed.append(bytes(kind(*(getattr(message, name) for name in kind.fieldnames)).pack(sender)))
        sender.seq = (sender.seq + 1) % 256
    return b"".join(packed)
