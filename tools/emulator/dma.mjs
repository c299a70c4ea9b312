// Parts of the DMA that rp2040js declares and does not run, by data sheet: pacing timers (2.5.5.1; as published their
// period is upside down), and the time that transfers take, a cycle each where nothing paces them.
const UNPACED = 0x3f
const TIMER0 = 0x3b
const TIMER3 = 0x3e
const POLYNOMIAL = 0x04c11db7

/** One byte into a CRC that is not reflected. */
export function crcStep(crc, byte) {
  let next = crc ^ (byte << 24)
  for (let bit = 0; bit < 8; bit++) next = next & 0x80000000 ? (next << 1) ^ POLYNOMIAL : next << 1
  return next >>> 0
}

/** time: DeviceTime; the timers stand still with it. wrong(what): the program used a part that is not modelled. */
export function correctDma(mcu, time, wrong, board = { dmaSlowness: 1 }) {
  const { dma } = mcu
  const read = dma.readUint32.bind(dma)
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
  for (const channel of dma.channels) {
    const schedule = channel.scheduleTransfer.bind(channel)
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
    const ratio = read(mcu.dmaTimers + 4 * (channel.treqValue - TIMER0))
    const period = ((ratio & 0xffff) / (ratio >>> 16)) * (1e9 / mcu.clkSys) * board.dmaSlowness
    const now = mcu.clock.nanos
    if (!(period > 0) || !Number.isFinite(period)) return wrong('a DMA channel paced by a timer that stands')
    paced.add(channel)
    channel.transferAlarm.schedule((Math.floor(now / period) + 1) * period - now)
  }
}
