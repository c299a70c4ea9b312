// The DMA's sniffer (data sheet 2.5.5), which rp2040js declares and does not run, and the time that transfers take: a
// cycle each where nothing paces them. Bytes and CRC-32 only; whatever else a program asks of it is wrong here.
const SNIFF_CTRL = 0x434
const SNIFF_DATA = 0x438
const EN = 1
const OUT_REV = 1 << 10
const OUT_INV = 1 << 11
const CHANNEL_SNIFF_EN = 1 << 23
const UNPACED = 0x3f
const POLYNOMIAL = 0x04c11db7

export function reversed(value, bits) {
  let out = 0
  for (let k = 0; k < bits; k++) out = (out << 1) | ((value >>> k) & 1)
  return out >>> 0
}

/** One byte into a CRC that is not reflected. */
export function step(crc, byte) {
  let next = crc ^ (byte << 24)
  for (let bit = 0; bit < 8; bit++) next = next & 0x80000000 ? (next << 1) ^ POLYNOMIAL : next << 1
  return next >>> 0
}

/** Have the chip's DMA sniff. wrong(what): the program asked for what is not modelled. */
export function addSniffer(mcu, wrong) {
  const { dma } = mcu
  const [read, write] = [dma.readUint32.bind(dma), dma.writeUint32.bind(dma)]
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
        data = step(data, calculation === 1 ? reversed(byte, 8) : byte)
      }
      transfer()
    }
    channel.transferAlarm = mcu.clock.createAlarm(channel.transfer)
    channel.scheduleTransfer = () => {
      if (channel.treqValue !== UNPACED) schedule()
      else channel.transferAlarm.schedule(1e9 / mcu.clkSys)
    }
  }
}
