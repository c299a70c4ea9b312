"""Open and close a board of five fingers again and again, with everything that a program may want of it at once.

    biotac-soak                      two minutes
    biotac-soak --minutes 60         an hour
    biotac-soak --faults             faults of sensors and of the line every second, and nothing else
    biotac-soak --faults --rig pico  on the emulated Pico (it needs what tests/hil needs)
    biotac-soak --hazards            two minutes of the emulated Pico's time, with the hazards on its page

Each round of ten seconds: a hand with reading threads, callbacks, a recording and a queue; a hand in an event loop,
once left by an exception, once cancelled, once forgotten without a close; and the page with a browser's connection.
After each, threads, descriptors and memory are counted, and the ledger is balanced: the frames that the board numbered,
the callbacks got and the recording holds are the same, and dropped ones were counted as lost.

With --faults a round is ten seconds of five fingers, each second a random fault of a random finger (parity, error
words, stuck lines, unplugged, swapped) and one of the line (bytes lost, doubled, flipped, older ones spliced in, two
pieces swapped). The ledger is by finger: each frame was delivered as it was sent, or counted as lost; frames that came
twice were counted, too; the time of a round is that of its number but for rounds without an answer; and the board has
latched that finger's fault.

With --hazards the minutes are the board's. Beside a stream of five fingers the bus reports false suspends, the host
pauses, and a packet that is armed late hangs the controller one time in ten (RP2040-E15); between streams the port is
opened and closed, requests overtake each other, and flash is erased while the bus sleeps. The controller is never
reset, no answer needs longer than a second, and the frames missing here are those that the board counted as dropped.

Prints a line a round. Exit 0: flat and balanced; 1: not.
"""

from __future__ import annotations

import argparse
import asyncio
import gc
import os
import random
import sys
import tempfile
import threading
import time
import urllib.request
from collections import Counter
from collections.abc import Callable
from contextlib import closing, suppress
from pathlib import Path

import numpy as np

import biotac
from biotac.hand.opening import shake_hands
from biotac.sim.loading import load_source
from biotac.sim.ports import start_board
from biotac.view.serving import Viewing
from biotac.wire import messages_gen as wire
from biotac.wire.batches import StreamDecoder

PORT = "sim:press.toml?fingers=5&seconds=60&pace=1"
WARM_UP = 6  # rounds until all lasting objects have been made
FLAT_KIB = 16384  # heaps breathe; leaked arrays of five fingers would be as much in three rounds
PART_S = 2.5
# Verbs of tools/emulator/rig.mjs, with the range of their random number.
ALWAYS = "hang 0.1 of late armings"
BESIDE = {"tell of a suspend late": (0, 1), "tell of a suspend falsely": (0, 1), "stop reading for {} ms": (5, 200)}
BETWEEN = {"erase in {} ms": (45, 400), "sleep for {} ms while it erases": (5, 300)}
BETWEEN |= {"open and close {} times": (1, 100), "two setups {}": (100, 60_000)}
FAULTS = ("bad_parity", "error_word", "stuck_low", "stuck_high", "unplugged", "swapped")


def main() -> int:
    """The command line."""
    parser = argparse.ArgumentParser(
        prog="biotac-soak", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--minutes", type=float, default=2.0, help="how long, roughly (default 2)")
    parser.add_argument("--faults", action="store_true", help="random sensor and line faults, every second")
    parser.add_argument("--rig", choices=("sim", "pico"), default="sim", help="board for --faults (default sim)")
    parser.add_argument("--hazards", action="store_true", help="the emulated Pico, and hazards of chip, bus and flash")
    args = parser.parse_args()
    if args.hazards:
        return hazards(60 * args.minutes)
    end_s = time.monotonic() + 60 * args.minutes
    rounds, first, ledger = 0, (0, 0, 0), Counter[str]()
    while rounds < WARM_UP + 2 or time.monotonic() < end_s:
        with tempfile.TemporaryDirectory() as folder:
            if args.faults:
                ledger += faulty(Path(folder), args.rig, seed=rounds)
            else:
                ledger += recorded(Path(folder))
                looped(rounds)
                viewed(Path(folder))
        gc.collect()
        now = held()
        rounds += 1
        summary = ", ".join(f"{count} {kind}" for kind, count in ledger.items())
        print(f"round {rounds}: {summary}; threads {now[0]}, descriptors {now[1]}, {now[2]} KiB", flush=True)
        if rounds <= WARM_UP:
            first = now
        elif now[:2] != first[:2] or now[2] - first[2] > FLAT_KIB:
            print(f"biotac-soak: threads, descriptors, KiB: {first} after round {WARM_UP}, now {now}", file=sys.stderr)
            return 1
    print(f"no growth over {rounds} rounds, ledger balanced: {summary}")
    return 0


def hazards(until_s: float) -> int:
    """Draw them until so much of the board's time has gone by."""
    draw, commands = random.Random(1), Counter[str]()
    hand: biotac.Hand = biotac.open("emu:pico?source=press.toml&fingers=5&seconds=3600&pace=fast&do=" + ALWAYS)
    board = hand.link.board  # type: ignore[attr-defined]
    resets = board.counters()["usb"]["resets"]

    def play(verbs: dict[str, tuple[int, int]]) -> str:
        verb = draw.choice(list(verbs))
        commands[verb] += 1
        board.do(verb.format(draw.randrange(*verbs[verb])))
        return verb

    hand.board.set_setting(biotac.Setting.HOLD_TIMEOUT_MS, 0)
    hand.read(2.0)
    hand.hold()  # no TARE comes, nor STATUS: every message that may be dropped has a number that will be missed
    while (seen := board.counters())["emulated_s"] < min(until_s, 3585):  # the source's end less a turn
        hand.stream()
        hand.board.command(wire.Start(0, int(wire.StreamFlags.FRAMES | wire.StreamFlags.PAC), 0b11111, 0))
        for _ in range(5):
            play(BESIDE)
            hand.read(draw.uniform(0.3, 2.0))
        hand.stop()
        verb = play(BETWEEN)
        hand.ping()
        for k in range(15 if "erase" in verb else 0):
            hand.board.set_setting(biotac.Setting.STATUS_PERIOD_MS, 1000 + k)
            hand.board.save_settings()  # one of them erases a sector
        seen, stats, dropped = board.counters(), hand.stats, hand.status().messages_dropped
        usb, lost, longest_us = seen["usb"], stats.frames_lost + stats.pac_lost, seen["latency"]["reply_us"]
        upset = seen["boots"] != 1 or usb["resets"] != resets or usb["failed"] or usb["hurried"]["wrong"] or stats.gaps
        if upset or lost != dropped or longest_us > 1e6:
            print(f"biotac-soak: after {verb}: {lost} lost, {dropped} dropped; {stats}, {seen}", file=sys.stderr)
            return 1
    print(f"{seen['emulated_s']:.0f} s of the board's time, {stats.frames} frames; {dict(commands)}")
    armed = f"{usb['armed_late']} of {usb['armed']} packets armed in a frame's last 200 us"
    print(f"{armed}, the latest {usb['latest_armed_us']:.0f} us into it; {seen['flash']['erases']} sectors erased")
    print(f"no reset, no answer later than {longest_us / 1000:.0f} ms; {lost} messages lost, {dropped} counted")
    hand.close()
    return 0


def recorded(folder: Path) -> Counter[str]:
    """Threads, callbacks, a queue and a recording of the same stream; the ledger."""
    called: dict[int, list[int]] = {finger: [] for finger in range(5)}
    queued = 0

    def arrived(batch: biotac.Batch) -> None:
        for finger, seq in zip(batch.wire["finger"].tolist(), batch.seq.tolist(), strict=True):
            called[finger].append(seq)

    with biotac.open(PORT) as hand:
        hand.record(folder / "a.mcap")
        hand.on_batch(arrived)
        hand.on_touch(lambda touch: None)
        hand.stream()
        until_s = time.monotonic() + PART_S
        for batch in hand.batches():
            queued += len(batch.wire)
            if time.monotonic() > until_s and hand.streaming:
                hand.stop()  # which ends the iteration behind the last frame
        board = hand.status()
    stats = hand.stats  # the callbacks have had all frames
    kept = biotac.load(folder / "a.mcap")
    missing = 0
    for finger, seqs in called.items():
        recorded_seqs = kept["seq"][kept["finger"] == finger].tolist()
        if seqs != recorded_seqs or recorded_seqs != sorted(set(recorded_seqs)):
            raise SystemExit(f"biotac-soak: finger {finger}: frames called back and recorded differ, or repeat")
        missing += recorded_seqs[-1] + 1 - len(recorded_seqs)
    received = (stats.frames, queued + stats.frames_skipped)
    if received != (len(kept), len(kept)) or stats.crc_errors:
        raise SystemExit(f"biotac-soak: {len(kept)} recorded; received and queued: {received}; {stats}")
    # A busy computer may stop reading for so long that the board has to drop; nothing may go uncounted.
    if missing != stats.frames_lost or missing > board.messages_dropped:
        raise SystemExit(f"biotac-soak: {missing} missing, {stats.frames_lost} counted as lost; board: {board}")
    return Counter({"frames recorded": len(kept), "lost": missing})


def faulty(folder: Path, rig: str, seed: int) -> Counter[str]:
    """Ten seconds with ten faults of sensors and as many of the line; the ledger of all fingers."""
    draw = random.Random(seed)
    text = f'name = "soak"\nseed = {seed}\nfingers = 5\n[[step]]\ndo = "rest"\nseconds = 1.5\n'
    text += '[[step]]\ndo = "press"\nseconds = 0.5\nat = "E17"\nforce_n = 3.0\n[[step]]\ndo = "hold"\nseconds = 8.0\n'
    hurt = []
    for second in range(10):
        hurt.append(draw.randrange(5))
        kind, length_s = draw.choice(FAULTS), draw.choice((0.003, 0.02, 0.1, 0.4))
        # Behind the first two rounds: a sensor that does not answer until then came late, and was not away.
        text += f"[[fault]]\nat_s = {second + draw.randrange(20, 500) / 1000}\nseconds = {length_s}\n"
        text += f'finger = {hurt[-1]}\nkind = "{kind}"\n'
    source = folder / "soak.toml"
    source.write_text(text)
    link = start_board(rig, load_source(source), pace=0.0).link(str(source))
    line = HurtLine(link.read, draw)
    link.read = line.read  # type: ignore[method-assign]
    with shake_hands(link) as hand:
        line.hurts = True
        batch = hand.read_batch(1000)
        line.hurts = False
        stats, faults = hand.stats, hand.board.faults()
    sent = StreamDecoder().feed(bytes(line.sent))
    missing = doubled = 0
    for finger in range(5):
        came, expected = (np.flatnonzero(rows.wire["finger"] == finger) for rows in (batch, sent))
        at = expected[np.searchsorted(sent.seq[expected], batch.seq[came]).clip(max=len(expected) - 1)]
        if (batch.wire[came] != sent.wire[at]).any() or (batch.t_us[came] != sent.t_us[at]).any():
            raise SystemExit(f"biotac-soak: finger {finger}: frames received differ from frames sent; seed {seed}")
        distinct = len(np.unique(at))
        missing += len(expected) - distinct
        doubled += len(came) - distinct
        steps, times_us = np.diff(sent.seq[expected]), np.diff(sent.t_us[expected])
        in_step = times_us == steps * 10_000
        silent = finger in hurt and (times_us[~in_step] % 10_000 == 0).all() and (times_us >= steps * 10_000).all()
        if not (in_step.all() or silent) or (steps != 1).any():
            raise SystemExit(f"biotac-soak: finger {finger}: rounds and device time disagree; seed {seed}")
        if (faults.by_index[finger] != 0) != (finger in hurt):
            raise SystemExit(f"biotac-soak: faults given to {sorted(set(hurt))}, latched: {faults}; seed {seed}")
    # PAC blocks that came twice are counted with the frames.
    if missing != stats.frames_lost or len(batch.wire) != stats.frames or doubled > stats.disordered:
        raise SystemExit(f"biotac-soak: {missing} missing, {doubled} received twice, {stats}; seed {seed}")
    delivered, hurts = len(batch.wire) - doubled, {"sensor faults": len(hurt), "line faults": line.faults}
    return Counter({"frames sent": len(sent.wire), "delivered": delivered, "lost": missing, "twice": doubled, **hurts})


class HurtLine:
    """A line from a simulated board that damages the bytes about once a second; ``sent`` are the undamaged ones."""

    SECOND_BYTES = 80_000
    LAST = 9 * SECOND_BYTES  # bytes behind the last fault show the losses
    PIECE = 2000  # rounds, not seconds: older bytes come from a board that started again

    def __init__(self, read: Callable[[float], bytes], draw: random.Random) -> None:
        self._read = read
        self.hurts = False
        self.faults = 0
        self.sent = bytearray()
        self._draw = draw
        self._passed = 0
        self._due = self._pause()

    def read(self, timeout_s: float) -> bytes:
        """See Link.read."""
        chunk = self._read(timeout_s)
        if not self.hurts:
            return chunk
        self.sent += chunk
        out = b""
        while self._due < self.LAST and len(self.sent) >= self._due + 2 * self.PIECE:
            out += self.sent[self._passed : self._due] + self._hurt(self._due)
            self._passed = self._due + 2 * self.PIECE
            self._due += self._pause()
            self.faults += 1
        end = len(self.sent) if self._due >= self.LAST else max(self._passed, min(self._due, len(self.sent)))
        out += self.sent[self._passed : end]
        self._passed = end
        return out

    def _pause(self) -> int:
        return self._draw.randrange(self.SECOND_BYTES // 2, self.SECOND_BYTES)

    def _hurt(self, at: int) -> bytes:
        """The two pieces that begin at ``at``, damaged."""
        kind, size = self._draw.randrange(5), self._draw.randrange(1, self.PIECE)
        before, whole = self.sent[:at], self.sent[at : at + 2 * self.PIECE]
        if kind == 0:
            return bytes(whole[size:])
        if kind == 1:
            return bytes(before[-size:] + whole)
        if kind == 2:
            for _ in range(self._draw.randint(1, 8)):
                whole[self._draw.randrange(32)] ^= 1 << self._draw.randrange(8)
            return bytes(whole)
        if kind == 3:
            return bytes(before[-2 * size : -size] + whole)
        return bytes(whole[size : 2 * size] + whole[:size] + whole[2 * size :])


def looped(number: int) -> None:
    """A hand in an event loop, left in one of three ways; another is forgotten as it runs."""

    async def listen() -> None:
        async with biotac.aio.open(PORT) as hand:
            async for _ in hand.batches():
                if number % 3 == 0 and hand.stats.frames > 500:
                    raise ZeroDivisionError

    async def program() -> None:
        await asyncio.wait_for(listen(), 0.05 if number % 3 == 1 else PART_S)

    with suppress(ZeroDivisionError, TimeoutError, asyncio.TimeoutError):
        asyncio.run(program())
    hand = biotac.open(PORT)
    hand.on_batch(lambda batch: None)
    hand.stream()
    hand["thumb"]


def viewed(folder: Path) -> None:
    """The page, with a browser that reads its events."""
    with closing(Viewing(PORT, port=0, folder=folder)) as viewing:
        until_s = time.monotonic() + PART_S
        with urllib.request.urlopen(f"{viewing.url}events") as events:
            while time.monotonic() < until_s:
                events.read1(65536)


def held() -> tuple[int, int, int]:
    """Threads and descriptors of this process, and the memory in KiB."""
    resident = int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") // 1024
    return threading.active_count(), len(os.listdir("/proc/self/fd")), resident


if __name__ == "__main__":
    sys.exit(main())
