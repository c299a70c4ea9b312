// A UART with something on the pins, from the data sheet (4.2): bytes take their time both ways, FIFOs hold 32, the DMA
// is asked while there is room, and interrupts tell of half a FIFO and of silence behind the last byte. As published bytes
// take no time, nothing paces the DMA, and whatever comes interrupts at once.
const [DR, FR, IMSC, MIS, ICR, DMACR] = [0x0, 0x18, 0x38, 0x40, 0x44, 0x48]
const [BUSY, RXFE, TXFF, RXFF, TXFE] = [1 << 3, 1 << 4, 1 << 5, 1 << 6, 1 << 7]
const [INT_RX, INT_RT] = [1 << 4, 1 << 6]
const TXDMAE = 1 << 1
const FIFO = 32
const HALF = FIFO / 2
const BITS = 10 // of a byte with start and stop
const SILENCE_BITS = 32
const GPIO_FUNCTION = 2
const SENDS_ON = [[0, 12], [4, 8]] // of UART 0 and 1, those that a Pico's sensors leave free; it hears on the next

export class Uart {
  /** number: of the chip's UARTs; port: a Pty, or something like it, on the pins. */
  constructor(mcu, number, port) {
    this.mcu = mcu
    this.uart = mcu.uart[number]
    this.pins = SENDS_ON[number]
    this.port = port
    this.sending = []
    this.heard = []
    this.silent = false // after received bytes
    this.dma = false
    this.onByte = () => {} // (line, byte) after the stop bit: TX or RX
    this.counters = { sent: 0, overruns: 0, unread: 0, fastest_bits_per_s: 0 }
    this.sender = mcu.clock.createAlarm(() => this.#sent())
    this.hearer = mcu.clock.createAlarm(() => this.#hear())
    this.silence = mcu.clock.createAlarm(() => {
      this.silent = true
      this.#update()
    })
    const read = this.uart.readUint32.bind(this.uart)
    const write = this.uart.writeUint32.bind(this.uart)
    this.uart.readUint32 = (offset) => this.#read(offset, read)
    this.uart.writeUint32 = (offset, value) => this.#write(offset, value, write)
  }

  get wired() {
    const { gpio } = this.mcu
    return this.pins.some((pin) => [pin, pin + 1].every((one) => gpio[one].functionSelect === GPIO_FUNCTION))
  }

  get byteNanos() {
    return (BITS * 1e9) / this.uart.baudRate
  }

  get busy() {
    return this.sending.length > 0 || this.hearing
  }

  /** Bytes from outside may be waiting. */
  poke() {
    if (this.hearing || !this.uart.enabled || !this.wired || this.port.received.length === 0) return
    this.hearing = true
    this.hearer.schedule(this.byteNanos)
  }

  #hear() {
    const bytes = this.port.take(1)
    this.hearing = false
    if (bytes?.length > 0) {
      this.onByte('RX', bytes[0])
      if (this.heard.length < FIFO) this.heard.push(bytes[0])
      else this.counters.overruns++
      this.silent = false
      this.silence.cancel()
      this.silence.schedule((SILENCE_BITS * 1e9) / this.uart.baudRate)
      this.#update()
    }
    this.poke()
  }

  #sent() {
    const byte = this.sending.shift()
    this.counters.sent++
    if (this.wired) this.onByte('TX', byte)
    if (!this.wired || !this.port.hasRoom) this.counters.unread++ // a UART waits for nobody
    else this.port.put(Uint8Array.of(byte))
    if (this.sending.length > 0) this.sender.schedule(this.byteNanos)
    this.#update()
  }

  #send(byte) {
    if (this.sending.length >= FIFO) {
      this.counters.overruns++
      return
    }
    this.counters.fastest_bits_per_s = Math.max(this.counters.fastest_bits_per_s, this.uart.baudRate)
    this.sending.push(byte)
    if (this.sending.length === 1) this.sender.schedule(this.byteNanos)
    this.#update()
  }

  #read(offset, otherwise) {
    const { sending, heard } = this
    if (offset === DR) {
      const byte = heard.shift() ?? 0
      if (heard.length === 0) this.silent = false
      this.#update()
      return byte
    }
    if (offset === FR) {
      const out = sending.length === 0 ? TXFE : BUSY | (sending.length >= FIFO ? TXFF : 0)
      return out | (heard.length === 0 ? RXFE : heard.length >= FIFO ? RXFF : 0)
    }
    if (offset === MIS) return this.raw & this.uart.interruptMask
    return otherwise(offset)
  }

  #write(offset, value, otherwise) {
    if (offset === DR) return this.uart.enabled ? this.#send(value & 0xff) : undefined
    if (offset === ICR) {
      if (value & INT_RT) this.silent = false
    } else if (offset === DMACR) {
      this.dma = (value & TXDMAE) !== 0
    } else {
      otherwise(offset, value)
    }
    this.#update()
    if (offset !== IMSC) this.poke()
  }

  get raw() {
    return (this.heard.length >= HALF ? INT_RX : 0) | (this.silent && this.heard.length > 0 ? INT_RT : 0)
  }

  #update() {
    const { mcu, uart } = this
    mcu.setInterrupt(uart.irq, (this.raw & uart.interruptMask) !== 0)
    if (this.dma && uart.enabled && this.sending.length < FIFO) mcu.dma.setDREQ(uart.dreq.tx)
    else mcu.dma.clearDREQ(uart.dreq.tx)
  }
}
