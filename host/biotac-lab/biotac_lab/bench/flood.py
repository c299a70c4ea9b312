"""A board that floods a pty with FRAMEs, in a process of its own: the producer of `biotac-lab bench live`.

It answers commands. START makes it send the frames through a ring of 16 KiB that drops whole frames when full, as on
real boards. It is Python because the simulator's executable is the firmware, which should not grow a flood mode.
Frames are made beforehand: sending is a slice and a system call.
"""

from __future__ import annotations

import os
import pty
import select
import time
import tty
from contextlib import suppress
from typing import Any

import numpy as np

from biotac.wire import DTYPES, Decoder, encode
from biotac.wire import messages as wire

FINGERS = 5
RING_BYTES = 16_384
MOST_BURSTS_HZ = 5_000  # USB would not deliver more often
SPIN_NS = 150_000  # a sleeper wakes up to this much late


def burst_frames(rate: int) -> int:
    """Frames per burst."""
    return max(1, rate // MOST_BURSTS_HZ)


def frames(count: int) -> list[bytes]:
    """``count`` encoded FRAMEs: finger k % 5, seq k // 5."""
    values: dict[str, Any] = dict.fromkeys(DTYPES[wire.FrameMessage.ID].names or (), 0)
    noise = np.random.default_rng(1).integers(1900, 3200, (256, 19))
    three: dict[str, Any] = {"poc_um": (-5497, 1667, -4799), "force_100un": (120, -340, 9000)}
    three |= {"torque_mnmm": (8, 134, 29)}
    out = []
    for k in range(count):
        counts = tuple(noise[k % 256].tolist())
        now = {"finger": k % FINGERS, "seq": k // FINGERS % 65536, "t_us": k // FINGERS * 10_000 % 2**32}
        row = values | three | now | {"counts": counts, "tare_q4": tuple(c * 16 for c in counts)}
        out.append(encode(wire.FrameMessage.ID, wire.FrameMessage(**row).pack()))
    return out


class Board:
    """The board's end of the pty."""

    def __init__(self, master: int) -> None:
        self._master = master
        self._decoder = Decoder()
        os.set_blocking(master, False)

    def serve(self, ring: bytearray) -> bool:
        """Put the answers to commands received into the ring; return true if START was among them.

        Written past the ring, an answer could land inside a frame, or end the flood when the pty is full.
        """
        try:
            batch = self._decoder.feed(os.read(self._master, 4096))
        except BlockingIOError:
            return False
        started = False
        for message_id, payload in batch.others:
            message = wire.MESSAGES[message_id].unpack(payload)
            started |= isinstance(message, wire.Start)
            ring += answer(message)
        return started

    def send(self, ring: bytearray) -> None:
        """Write as much of the ring as the pty takes."""
        with suppress(BlockingIOError):
            del ring[: os.write(self._master, ring)]


def answer(message: Any) -> bytes:
    """The encoded answer: HELLO, or a Reply of success."""
    if isinstance(message, wire.HelloRequest):
        versions = (wire.WIRE_MAJOR, wire.WIRE_MINOR, wire.SCHEMA_HASH, 0, 0, 0)
        serial, name = (1,) * 12, (0,) * 16
        kind = wire.BoardKind.POSIX_SIM
        hello = wire.Hello(message.req_id, message.nonce, *versions, kind, serial, 1, 4400, 31, 0xFFFFFFFF, 5, 0, name)
        return encode(hello.ID, hello.pack())
    return encode(wire.Reply.ID, wire.Reply(message.req_id, message.ID, 0).pack())


def flood(board: Board, packets: list[bytes], rate: int, times: Any, ring: bytearray) -> None:
    """Send all packets on time; drop those that find the ring full."""
    burst = burst_frames(rate)
    begin_ns = time.monotonic_ns() + 10_000_000
    for number, first in enumerate(range(0, len(packets), burst)):
        due_ns = begin_ns + first * 1_000_000_000 // rate
        while (left_ns := due_ns - time.monotonic_ns()) > 0:
            if left_ns > SPIN_NS:
                time.sleep((left_ns - SPIN_NS) / 1e9)
        times[number] = time.monotonic_ns()
        for packet in packets[first : first + burst]:
            if len(ring) + len(packet) <= RING_BYTES:
                ring += packet
        board.send(ring)
        if number % 512 == 0:
            board.serve(ring)
    while ring:
        board.send(ring)


def run(pipe: Any, rate: int, count: int, times: Any) -> None:
    """Send the pty's path through the ``pipe``; then, after each START, ``count`` frames to the pty, ``rate`` a second.

    ``times`` gets when each burst entered the ring (ns, CLOCK_MONOTONIC), and the pipe a None once all are sent.
    """
    packets = frames(count)
    master, slave = pty.openpty()
    tty.setraw(slave)
    board, ring = Board(master), bytearray()
    pipe.send(os.ttyname(slave))
    while True:
        select.select([master], [], [])  # until something arrives
        try:
            started = board.serve(ring)
            board.send(ring)
            if started:
                flood(board, packets, rate, times, ring)
                pipe.send(None)
        except OSError:  # nobody has the port open for a while, between two rounds
            ring.clear()
            time.sleep(0.001)
