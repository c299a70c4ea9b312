"""kill -9 in the middle of recording: everything that came until a second before is on disk, and is usable.

The recorder's process notes the bytes that arrive, unbuffered, before it goes on; it kills itself at a byte of
the stream, or at a byte of the file, in the middle of a write. No clock is involved: the simulated board is
unpaced, in pieces as small as USB's, and the recorder's clock stands still, so that only bytes close a block.
"""

import json
import random
import signal
import subprocess
import sys
import zlib
from pathlib import Path

import pytest
from cobs import cobs

import biotac
from biotac.cli.main import main
from biotac.wire import messages_gen as wire

FINGERS = 5
ROUNDS_PER_S = 100
# A second of five fingers is 100 kB on the link and 60 kB in the file; the first is there before it is whole.
STREAM_BYTES = (150_000, 1_500_000)
FILE_BYTES = (120_000, 800_000)
RANDOM = random.Random(20261121)
MOMENTS = [("stream", RANDOM.randrange(*STREAM_BYTES)) for _ in range(50)]
MOMENTS += [("file", RANDOM.randrange(*FILE_BYTES)) for _ in range(50)]
BY_DAY = (0,)

RECORDER = """
import os, signal, sys
import biotac
from biotac.recording import writer

path, arrived, where, at = sys.argv[1], sys.argv[2], sys.argv[3], int(sys.argv[4])
truth = open(arrived, "wb", buffering=0)
hand = biotac.open("sim:press.toml?seconds=60&fingers=5")

def die():
    os.kill(os.getpid(), signal.SIGKILL)

class Dying:
    '''A file whose process dies at byte `at`, after a part of a write.'''
    def __init__(self, inner): self.inner, self.written = inner, 0
    def write(self, data):
        data = bytes(data)
        if where == "file" and self.written + len(data) > at:
            self.inner.write(data[: at - self.written]); die()
        self.written += len(data)
        return self.inner.write(data)
    def __getattr__(self, name): return getattr(self.inner, name)

create = writer.create
writer.create = lambda path, **options: Dying(create(path, **options).detach())
recorder = hand.record(path)
recorder._writer._clock_s = lambda: 0.0

read, seen, ahead = hand.link.read, 0, b""
def reading(timeout_s):
    global seen, ahead
    ahead = ahead or read(timeout_s)
    chunk, ahead = ahead[:512], ahead[512:]
    seen += len(chunk)
    if where == "stream" and seen > at:
        truth.write(chunk[: len(chunk) - (seen - at)]); die()
    truth.write(chunk)
    return chunk
hand.link.read = reading
for batch in hand.batches(): pass
"""


def arrived_frames(stream: bytes) -> list[tuple[int, int]]:
    """(finger, seq) of the FRAMEs in a stream, without the decoder under test."""
    found = []
    for piece in stream.split(b"\0")[:-1]:
        plain = cobs.decode(piece)
        assert zlib.crc32(plain[:-4]) == int.from_bytes(plain[-4:], "little") or not plain
        if plain and plain[0] == wire.FrameMessage.ID:
            found.append((plain[7], int.from_bytes(plain[1:3], "little")))
    return found


@pytest.mark.parametrize(
    ("where", "at"),
    [pytest.param(*moment, marks=() if k in BY_DAY else pytest.mark.nightly) for k, moment in enumerate(MOMENTS)],
)
def test_a_killed_recorder_loses_at_most_the_last_second(tmp_path: Path, capsys, where: str, at: int) -> None:
    path, truth = tmp_path / "killed.mcap", tmp_path / "arrived.bin"
    program = [sys.executable, "-c", RECORDER, str(path), str(truth), where, str(at)]
    done = subprocess.run(program, capture_output=True, text=True, check=False)
    assert done.returncode == -signal.SIGKILL, done.stderr

    arrived = arrived_frames(truth.read_bytes())
    recording = biotac.Recording(path)
    kept = list(zip(recording.frames["finger"].tolist(), recording.frames["seq"].tolist(), strict=True))
    assert kept == arrived[: len(kept)]
    assert len(arrived) - len(kept) <= FINGERS * ROUNDS_PER_S
    assert recording.cut_off and recording.frames_lost == 0 and recording.counts.bad == 0

    assert main(["check", str(path), "--json"]) == 1
    facts = json.loads(capsys.readouterr().out)
    assert facts["cut_off"] is True and facts["frames"] == len(kept)
    assert main(["stream", f"replay:{path}?pace=fast", "--rate", "0", "--json"]) == 0
    assert len(capsys.readouterr().out.splitlines()) == len(kept)
