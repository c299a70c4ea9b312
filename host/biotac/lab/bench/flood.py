"""A board in a process of its own that floods a pty with FRAMEs: the producer of `biotac bench live`.

    python -m biotac.lab.bench.flood MASTER_FD RATE FRAMES TIMES_FILE

It answers commands; START lets it send FRAMES frames of five fingers, RATE a second, through a ring of 16 KiB that
drops whole frames when full, as boards have it. When each burst was put into the ring goes to TIMES_FILE (int64 ns,
CLOCK_MONOTONIC); afterwards it writes a line of JSON to stdout. Python, because the simulator's executable is the
firmware, which is not to grow a flood; frames are made beforehand, so that sending is a slice and a system call.
"""

from __future__ import annotations

import json
import mmap
import os
import select
import sys
import time
from contextlib import suppress
from typing import Any

import numpy as np

from ...wire import messages_gen as wire
from ...wire.decoder import Decoder
from ...wire.dtypes_gen import DTYPES
from ...wire.framing import encode
from ...wire.identity import NO_IMAGE

FINGERS = 5
RING_BYTES = 16_384
MOST_BURSTS_HZ = 5_000  # USB would not deliver oftener
SPIN_NS = 150_000  # a sleeper is woken so much too late


def burst_frames(rate: int) -> int:
    """Frames that go out together."""
    return max(1, rate // MOST_BURSTS_HZ)


def frames(count: int) -> list[bytes]:
    """``count`` encoded FRAMEs: finger k % 5, seq k // 5."""
    values: dict[str, Any] = dict.fromkeys(DTYPES[wire.Frame.ID].names or (), 0)
    noise = np.random.default_rng(1).integers(1900, 3200, (256, 19))
    three: dict[str, Any] = {"poc_um": (-5497, 1667, -4799), "force_100un": (120, -340, 9000)}
    three |= {"torque_mnmm": (8, 134, 29), "force_sigma_100un": (20, 20, 20)}
    out = []
    for k in range(count):
        counts = tuple(noise[k % 256].tolist())
        now = {"finger": k % FINGERS, "seq": k // FINGERS % 65536, "t_us": k // FINGERS * 10_000 % 2**32}
        row = values | three | now | {"counts": counts, "tare_q4": tuple(c * 16 for c in counts)}
        out.append(encode(wire.Frame.ID, wire.Frame(**row).pack()))
    return out


class Board:
    """The far end of the pty."""

    def __init__(self, master: int) -> None:
        self._master = master
        self._decoder = Decoder()
        os.set_blocking(master, False)

    def serve(self, ring: bytearray) -> bool:
        """Put answers to what has come in the ring; true when START was among it.

        Written beside the ring they would end up amid a frame, or, when the pty is full, end the flood.
        """
        try:
            heard = self._decoder.feed(os.read(self._master, 4096))
        except BlockingIOError:
            return False
        started = False
        for message_id, payload in heard.others:
            message = wire.MESSAGES[message_id].unpack(payload)
            started |= isinstance(message, wire.Start)
            ring += answer(message)
        return started

    def send(self, ring: bytearray) -> None:
        """As much of the ring as the pty takes."""
        with suppress(BlockingIOError):
            del ring[: os.write(self._master, ring)]

    def wait(self) -> None:
        """Until something comes."""
        select.select([self._master], [], [])


def answer(message: Any) -> bytes:
    """HELLO or yes."""
    if isinstance(message, wire.HelloRequest):
        versions = (wire.WIRE_MAJOR, wire.WIRE_MINOR, wire.SCHEMA_HASH, 0, 0, 0)
        hello = wire.Hello(
            message.req_id, message.nonce, *versions, wire.Board.POSIX_SIM, (1,) * 12, 1, 4400, 31, NO_IMAGE
        )
        return encode(hello.ID, hello.pack())
    return encode(wire.Reply.ID, wire.Reply(message.req_id, message.ID, 0).pack())


def flood(board: Board, packets: list[bytes], rate: int, times: Any, ring: bytearray) -> dict[str, int]:
    """Send them all in time, or drop them."""
    burst = burst_frames(rate)
    dropped = 0
    worst_ns = 0
    begin_ns = time.monotonic_ns() + 10_000_000
    for number, first in enumerate(range(0, len(packets), burst)):
        due_ns = begin_ns + first * 1_000_000_000 // rate
        while (left_ns := due_ns - time.monotonic_ns()) > 0:
            if left_ns > SPIN_NS:
                time.sleep((left_ns - SPIN_NS) / 1e9)
        worst_ns = max(worst_ns, -left_ns)
        times[number] = time.monotonic_ns()
        for packet in packets[first : first + burst]:
            if len(ring) + len(packet) > RING_BYTES:
                dropped += 1
            else:
                ring += packet
        board.send(ring)
        if number % 512 == 0:
            board.serve(ring)
    while ring:
        board.send(ring)
    return {"offered": len(packets), "dropped": dropped, "late_us": worst_ns // 1000}


def main() -> None:
    """See the head of this file."""
    master, rate, count, path = int(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4]
    packets = frames(count)
    bursts = -(-count // burst_frames(rate))
    with open(path, "wb+") as file:
        file.truncate(8 * bursts)
        times = memoryview(mmap.mmap(file.fileno(), 8 * bursts)).cast("q")
    board = Board(master)
    ring = bytearray()
    print("ready", flush=True)
    while True:
        board.wait()
        try:
            started = board.serve(ring)
            board.send(ring)
            if started:
                print(json.dumps(flood(board, packets, rate, times, ring)), flush=True)
        except OSError:  # nobody has the port open for a while: between two rounds
            ring.clear()
            time.sleep(0.001)


if __name__ == "__main__":
    main()
