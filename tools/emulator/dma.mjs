// What rp2040js declares of the DMA and does not run, from the data sheet: the sniffer (2.5.5.2), pacing timers (2.5.5.1;
// as published their period is upside down), and the time that transfers take, a cycle each where nothing paces them.
// The sniffer takes bytes and CRC-32 only; whatever else a program asks of it is wrong here.
const SNIFF_CTRL = 0x434
const SNIFF_DATA = 0x438
const EN = 1
const OUT_REV = 1 << 10
const OUT_INV = 1 << 11
const CHANNEL_SNIFF_EN = 1 << 23
const UNPACED = 0x3f
const TIMER0 = 0x3b
const TIMER3 = 0x3e
const TIMERS = 0x420
const POLYNOMIAL = 0x04c11db7

function reversed(value, bits) {
  let out = 0
  for (let k = 0; k < bits; k++) out = (out << 1) | ((value >>> k) & 1)
  return out >>> 0
}

/** One byte into a CRC that is not reflected. */
export function crcStep(crc, byte) {
  let next = crc ^ (byte << 24)
  for (let bit = 0; bit < 8; bit++) next = next & 0x80000000 ? (next << 1) ^ POLYNOMIAL : next << 1
  return next >>> 0
}

/** time: DeviceTime, with which its timers stand still. wrong(what): the program asked for what is not modelled. */
export function correctDma(mcu, time, wrong, board = { dmaSlowness: 1 }) {
  const { dma } = mcu
  const [read, write] = [dma.readUint32.bind(dma), dma.writeUint32.bind(dma)]
  const paced = new Set() // channels that a timer has paced
  const waiting = new Set() // for time to go on
  time.onHold.push(() => {
    for (const channel of paced) {
      if (!channel.active || channel.treqValue < TIMER0 || channel.treqValue > TIMER3) continue
      channel.transferAlarm.cancel()
      waiting.add(channel)
    }
  })
  time.onRelease.push(() => {
    const those = [...waiting]
    waiting.clear()
    for (const channel of those) if (channel.active) tick(channel)
  })
  let control = 0
  let data = 0
  dma.readUint32 = (offset) => {
    if (offset === SNIFF_CTRL) return control
    if (offset !== SNIFF_DATA) return read(offset)
    const out = control & OUT_REV ? reversed(data, 32) : data
    return (control & OUT_INV ? ~out : out) >>> 0
  }
  dma.writeUint32 = (offset, value) => {
    if (offset === SNIFF_CTRL) control = value
    else if (offset === SNIFF_DATA) data = value >>> 0
    else write(offset, value)
  }
  for (const channel of dma.channels) {
    const { transfer } = channel
    const schedule = channel.scheduleTransfer.bind(channel)
    channel.transfer = () => {
      const sniffed = control & EN && ((control >>> 1) & 15) === channel.index && channel.ctrl & CHANNEL_SNIFF_EN
      if (sniffed) {
        const calculation = (control >>> 5) & 15
        if (calculation > 1 || channel.dataSize !== 1) wrong('a sniffer that is not for the CRC-32 of bytes')
        const byte = mcu.readUint8(channel.readAddr)
        data = crcStep(data, calculation === 1 ? reversed(byte, 8) : byte)
      }
      transfer()
    }
    channel.transferAlarm = mcu.clock.createAlarm(channel.transfer)
    channel.scheduleTransfer = () => {
      const { treqValue } = channel
      if (treqValue === UNPACED) channel.transferAlarm.schedule(1e9 / mcu.clkSys)
      else if (treqValue >= TIMER0 && treqValue <= TIMER3) tick(channel)
      else schedule()
    }
  }

  /** At the timer's next tick: it runs whether or not somebody waits for it. */
  function tick(channel) {
    if (time.held) return waiting.add(channel)
    const ratio = read(TIMERS + 4 * (channel.treqValue - TIMER0))
    const period = ((ratio & 0xffff) / (ratio >>> 16)) * (1e9 / mcu.clkSys) * board.dmaSlowness
    const now = mcu.clock.nanos
    if (!(period > 0) || !Number.isFinite(period)) return wrong('a DMA channel paced by a timer that stands')
    paced.add(channel)
    channel.transferAlarm.schedule((Math.floor(now / period) + 1) * period - now)
  }
}
