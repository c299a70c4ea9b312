"""The emulator's model of the DMA timers."""

import json
import subprocess
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
MODEL = ROOT / "tools/emulator/dma.mjs"
TIMER = """
const { RP2040 } = await import(process.argv[1])
const { correctDma } = await import(process.argv[2])
const mcu = new RP2040()
mcu.dmaTimers = 0x420
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


@pytest.mark.usefixtures("emulated_pico")
def test_a_channel_goes_by_its_timers_ticks_and_stands_still_on_hold() -> None:
    js = ROOT / "tools/node_modules/rp2040js/dist/esm/index.js"
    words = ["node", "--input-type=module", "-e", TIMER, str(js), str(MODEL)]
    done = subprocess.run(words, capture_output=True, text=True, check=True)
    # clk_sys * X / Y (data sheet 2.5.5.1): 125 MHz / 125; the timer runs on before the first and over the hold.
    assert json.loads(done.stdout) == [1000, 2000, 13000, 14000, 15000, 16000]
