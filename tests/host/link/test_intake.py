"""From bytes to numbered rows in C (host/binding/decode/intake.c, descriptor.c), by chunks and from a port.

The truth is the reference deframer with a loop over one message at a time.
"""

import errno
import os
import pty
import signal
import threading
import tty
from collections.abc import Iterator
from typing import Any

import numpy as np
import pytest
from deframer import Deframer, encode

from biotac.wire import messages_gen as wire
from biotac.wire.batches import Batch, StreamDecoder, join
from biotac.wire.decoder import STREAMED
from biotac.wire.dtypes_gen import DTYPES

posix = pytest.mark.skipif(os.name != "posix", reason="no ports by file descriptor on this system")
#: Numbers mostly in order; else skipped, repeated or going back.
STEPS = [0] * 40 + [5, -1, -2, -3, -20, -40, -70, 9_000, 32_000]
START = (wire.Reply.ID, wire.Reply(1, wire.Start.ID, wire.Error.OK).pack())


def sent(random: np.random.Generator, n: int) -> list[tuple[int, bytes]]:
    """Rows of all kinds with numbers that go on, skip and step back, amid answers, one of them to a START."""
    out = []
    for k in range(n):
        kind = int(random.choice([*STREAMED, *STREAMED, wire.FrameMessage.ID, wire.Reply.ID]))
        if kind == wire.Reply.ID:
            out.append(START if random.random() < 0.3 else (kind, wire.Reply(k % 256, wire.Ping.ID, 0).pack()))
            continue
        row = np.frombuffer(random.bytes(DTYPES[kind].itemsize), DTYPES[kind]).copy()
        row["finger"] = random.choice([0, 3, 255])
        row["seq"] = (65_000 + k + random.choice(STEPS)) % 2**16
        row["t_us"] = (2**32 - 10**6 + 10_000 * k) % 2**32
        if kind == wire.Idle.ID:
            row["frames"] = random.choice([1, 2, 10])
        out.append((kind, row.tobytes()))
    return out


def damaged(random: np.random.Generator, data: bytes) -> bytes:
    """The bytes with bits flipped and bytes gone."""
    raw = np.frombuffer(data, np.uint8).copy()
    hit = random.random(len(raw)) < 1e-3
    raw[hit] ^= (1 << random.integers(0, 8, hit.sum())).astype(np.uint8)
    return raw[random.random(len(raw)) > 1e-3].tobytes()


def cut(random: np.random.Generator, data: bytes, longest: int) -> Iterator[bytes]:
    at = 0
    while at < len(data):
        size = int(random.integers(1, longest + 1))
        yield data[at : at + size]
        at += size


class Loop:
    """The model for the compiled numbering: one number at a time, in Python's whole numbers and sets."""

    def __init__(self) -> None:
        self.last: dict[int, int] = {}
        self.missing: dict[int, set[int]] = {}
        self.joined: set[int] = set()
        self.gaps: list[tuple[int, int, int]] = []
        self.disordered = 0
        self.lost = 0

    def extend(self, finger: int, seq: int, rounds: int) -> int:
        last = self.last.get(finger, seq)
        whole = min((last - last % 65536 + seq + k * 65536 for k in (-1, 0, 1)), key=lambda v: (abs(v - last), v))
        lacking = self.missing.setdefault(finger, set())
        covered = set(range(whole - rounds + 1, whole + 1))
        if finger not in self.joined or whole <= last - 64:
            self.disordered += finger in self.joined
            lacking.clear()
        elif whole <= last:
            late = {number for number in lacking & covered if number > last - 64}
            lacking -= late
            self.lost -= len(late)
            self.disordered += 1
            return whole
        else:
            new = set(range(last + 1, whole + 1)) - covered
            lacking |= new
            self.lost += len(new)
            self.disordered += whole - rounds < last
            if new:
                self.gaps.append((finger, last, len(new)))
        self.last[finger] = whole
        self.joined.add(finger)
        return whole


def nearest(raw: int, near: int, span: int) -> int:
    return min((near - near % span + raw + k * span for k in (-1, 0, 1)), key=lambda v: (abs(v - near), v))


def expected(data: bytes) -> dict[str, Any]:
    """Message by message: (kind, finger, seq, t_us), gaps of FRAMEs and IDLEs, PACs lost, disorder, answers."""
    loops = {is_pac: Loop() for is_pac in (False, True)}
    clock: int | None = None
    out: dict[str, Any] = {"rows": [], "messages": []}
    for message_id, payload in Deframer().feed(data):
        if message_id not in STREAMED:
            out["messages"].append(wire.MESSAGES[message_id].unpack(payload))
            if out["messages"][-1] == wire.MESSAGES[START[0]].unpack(START[1]):
                for loop in loops.values():
                    loop.joined.clear()
            continue
        row = wire.MESSAGES[message_id].unpack(payload)
        clock = row.t_us if clock is None else nearest(row.t_us, clock, 2**32)
        whole = loops[message_id == wire.Pac.ID].extend(
            row.finger, row.seq, row.frames if message_id == wire.Idle.ID else 1
        )
        out["rows"].append((message_id, row.finger, whole, clock))
    out["gaps"], out["lost"] = loops[False].gaps, loops[False].lost
    out["lost_pac"] = loops[True].lost
    out["disordered"] = loops[False].disordered + loops[True].disordered
    return out


def assert_is(decoder: StreamDecoder, batches: list[Batch], data: bytes) -> None:
    want, got = expected(data), join(batches)
    columns = {
        wire.FrameMessage.ID: (got.wire["finger"], got.seq, got.t_us),
        wire.Pac.ID: (got.pac["finger"], got.pac["seq"], got.pac["t_us"]),
        wire.Idle.ID: (got.idle["finger"], got.idle["seq"], got.idle["t_us"]),
    }
    for message_id, (finger, seq, t_us) in columns.items():
        rows = [row[1:] for row in want["rows"] if row[0] == message_id]
        assert list(zip(finger.tolist(), seq.tolist(), t_us.tolist(), strict=True)) == rows
    assert got.messages == want["messages"]
    assert decoder.lost_after == want["gaps"]
    assert decoder.lost == want["lost"]
    assert (decoder.lost_pac, decoder.disordered) == (want["lost_pac"], want["disordered"])


def whole_stream(seed: int) -> bytes:
    random = np.random.default_rng(seed)
    return damaged(random, b"".join(encode(*message) for message in sent(random, 2000)))


@pytest.mark.parametrize(
    "longest", [20, 1400, *(pytest.param(size, marks=pytest.mark.nightly) for size in (200, 10**6))]
)
def test_chunks_of_any_size_give_the_same_numbered_rows(longest: int) -> None:
    data = whole_stream(longest)
    assert len(data) > 100_000  # more than one step of the compiled decoder
    decoder = StreamDecoder()
    assert_is(decoder, [decoder.feed(chunk) for chunk in cut(np.random.default_rng(0), data, longest)], data)
    assert len(expected(data)["gaps"]) > 50


class Port:
    """A pty: bytes written on one side are read on the other, which does not block."""

    def __init__(self) -> None:
        self.far, self.near = pty.openpty()
        tty.setraw(self.near)
        os.set_blocking(self.near, False)
        self.decoder = StreamDecoder()

    def read(self) -> Batch | None:
        return self.decoder.read(self.near, 60.0)

    def close(self) -> None:
        for fd in (self.far, self.near):
            if fd >= 0:
                os.close(fd)


@pytest.fixture
def port() -> Iterator[Port]:
    one = Port()
    yield one
    one.close()


@posix
@pytest.mark.parametrize("longest", [50, 1400, 20_000])
def test_a_port_gives_what_chunks_give(longest: int, port: Port) -> None:
    data = whole_stream(longest)

    def write() -> None:
        for chunk in cut(np.random.default_rng(1), data, longest):
            while chunk:
                chunk = chunk[os.write(port.far, chunk) :]

    writer = threading.Thread(target=write)
    writer.start()
    batches, came = [], b""
    while len(came) < len(data):
        batch = port.read()
        assert batch is not None
        batches.append(batch)
        assert port.decoder.taken == len(port.decoder.chunk())
        came += port.decoder.chunk()
    writer.join()
    assert came == data
    assert_is(port.decoder, batches, data)


@posix
def test_one_call_takes_more_than_one_read_gives() -> None:
    data = b"".join(encode(*message) for message in sent(np.random.default_rng(3), 600))[:40_000]
    near, far = os.pipe()
    os.set_blocking(near, False)
    os.write(far, data)
    decoder = StreamDecoder()
    batch = decoder.read(near, 60.0)
    os.close(near)
    os.close(far)
    assert batch is not None
    assert decoder.chunk() == data
    assert_is(decoder, [batch], data)


@posix
def test_a_closed_descriptor_is_an_error_with_its_number() -> None:
    read_end, write_end = os.pipe()
    os.close(read_end)
    os.close(write_end)
    with pytest.raises(OSError) as caught:
        StreamDecoder().read(read_end, 60.0)
    assert caught.value.errno == errno.EBADF


@posix
def test_a_signal_is_handled_in_the_middle_of_the_wait(port: Port) -> None:
    seen = []

    def handle(number: int, _: Any) -> None:
        seen.append(number)
        os.write(port.far, encode(*START))

    before = signal.signal(signal.SIGUSR1, handle)
    try:
        poke = threading.Thread(target=lambda: signal.pthread_kill(threading.main_thread().ident or 0, signal.SIGUSR1))
        poke.start()
        batch = port.read()  # without the handler, nothing comes for a minute
        poke.join()
    finally:
        signal.signal(signal.SIGUSR1, before)
    assert seen == [signal.SIGUSR1]
    assert batch is not None and len(batch.messages) == 1


@posix
def test_the_time_of_arrival_is_pythons(port: Port) -> None:
    import time

    before = time.monotonic()
    os.write(port.far, encode(*START))
    batch = port.read()
    assert batch is not None
    assert before <= batch.arrived_s <= time.monotonic()
