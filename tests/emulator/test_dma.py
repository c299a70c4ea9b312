"""The emulator's model of the DMA: its sniffer against zlib, its timers. Frames are checked wherever they are read."""

from __future__ import annotations

import json
import random
import shutil
import subprocess
import zlib
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MODEL = ROOT / "tools/emulator/dma.mjs"
SCRIPT = """
const { correctDma } = await import(process.argv[1])
const sram = JSON.parse(process.argv[2])
const channel = { index: 0, ctrl: 1 << 23, dataSize: 1, readAddr: 0, transfer() {}, scheduleTransfer() {} }
const dma = { channels: [channel], readUint32() {}, writeUint32() {} }
const time = { onHold: [], onRelease: [] }
const wrong = (what) => { throw new Error(what) }
correctDma({ dma, clock: { createAlarm() {} }, readUint8: (at) => sram[at] }, time, wrong)
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


TIMER = """
const { RP2040 } = await import(process.argv[1])
const { correctDma } = await import(process.argv[2])
const mcu = new RP2040()
const time = { held: false, onHold: [], onRelease: [] }
correctDma(mcu, time, (what) => { throw new Error(what) })
const at = []
const write = mcu.writeUint32.bind(mcu)
mcu.writeUint32 = (address, value) => {
  if (address === 0x20000000) at.push(mcu.clock.nanos)
  else write(address, value)
}
mcu.clock.tick(300)
write(0x50000420, (1 << 16) | 125) // TIMER0: clk_sys / 125, a tick every us
write(0x50000004, 0x20000000)
write(0x50000008, 6)
write(0x5000000c, (0x3b << 15) | (2 << 2) | 1)
mcu.clock.tick(2000)
time.held = true
for (const stop of time.onHold) stop()
mcu.clock.tick(10000)
time.held = false
for (const go of time.onRelease) go()
mcu.clock.tick(10000)
console.log(JSON.stringify(at))
"""


def test_a_channel_goes_by_its_timers_ticks_and_stands_still_on_hold() -> None:
    if shutil.which("node") is None:
        pytest.skip("node is missing; tools/test installs it")
    js = ROOT / "tools/node_modules/rp2040js/dist/esm/index.js"
    if not js.is_file():
        pytest.skip("rp2040js is missing; tools/emulator/prepare fetches it")
    words = ["node", "--input-type=module", "-e", TIMER, str(js), str(MODEL)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    # clk_sys * X / Y (data sheet 2.5.5.1): 125 MHz / 125; the timer runs on before the first and over the hold.
    assert json.loads(done.stdout) == [1000, 2000, 13000, 14000, 15000, 16000]
