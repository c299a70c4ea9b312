"""The emulator's model of the DMA's sniffer against zlib; the board's own frames are checked wherever they are read."""

from __future__ import annotations

import json
import random
import shutil
import subprocess
import zlib
from pathlib import Path

import pytest

MODEL = Path(__file__).resolve().parents[2] / "tools/emulator/sniffer.mjs"
SCRIPT = """
const { addSniffer } = await import(process.argv[1])
const sram = JSON.parse(process.argv[2])
const channel = { index: 0, ctrl: 1 << 23, dataSize: 1, readAddr: 0, transfer() {}, scheduleTransfer() {} }
const dma = { channels: [channel], readUint32() {}, writeUint32() {} }
addSniffer({ dma, clock: { createAlarm() {} }, readUint8: (at) => sram[at] }, (what) => { throw new Error(what) })
dma.writeUint32(0x434, (1 << 11) | (1 << 10) | (1 << 5) | 1)
dma.writeUint32(0x438, 0xffffffff)
for (; channel.readAddr < sram.length; channel.readAddr++) channel.transfer()
console.log(dma.readUint32(0x438))
"""


@pytest.mark.parametrize("size", [1, 9, 151])
def test_what_is_sniffed_is_zlibs_crc32(size: int) -> None:
    if shutil.which("node") is None:
        pytest.skip("node is missing; tools/test installs it")
    data = b"123456789" if size == 9 else random.Random(size).randbytes(size)
    words = ["node", "--input-type=module", "-e", SCRIPT, str(MODEL), json.dumps(list(data))]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    assert int(done.stdout) == zlib.crc32(data)
