// The emulated BioTacs on the chip's SPI0: firmware/emu/ as WebAssembly, called in the middle of a transfer, so
// that a sensor's answer follows from the exact emulated time of each edge.
import fs from 'node:fs'

import { GPIOPinState } from 'rp2040js'

import { onReset } from './faults.mjs'

const MISO = 16
const SCK = 18
const MOSI = 19
export const CHIP_SELECTS = [17, 20, 21, 22, 26] // of fingers 0 to 4: firmware/boards/pico
const SPI_FUNCTION = 1
export const WIDTHS = [8, 16] // of a property's byte; of all else
const STRETCH_NS = 150e3
const FASTEST_HZ = 10e6 // data sheet
const SENSOR = JSON.parse(fs.readFileSync(new URL('../../protocol/schema.json', import.meta.url))).sensor
const COMMANDS = new Map(SENSOR.channel.map(({ name, command }) => [name, command]))
const SLOTS = SENSOR.frame.slots.length
const LIVE_ROUNDS = 64 // that a program may be ahead, as in the posix port
const LEAD_NS = 20e3 // before a slot: the words of the one before have been read
const SAMPLE_COMMAND = 0x80 // and above

/** A byte with an odd number of ones, as all of a sample have. */
const odd = (byte) => (byte.toString(2).split('1').length - 1) % 2 === 1

/** The sensors, for any board. Throws an Error for a bad tape. */
export class Sensors {
  /** tape: counts to play; null: a program feeds as many as there are `liveFingers` (control.mjs). */
  constructor(wasm, tape, serials, liveFingers) {
    const module = new WebAssembly.Module(wasm)
    this.linkBytes = () => 0 // sent by the board to the host
    this.answer = () => {} // the program that feeds
    const told = (at, bytes) => this.answer(Buffer.from(this.#bytes().slice(at, at + bytes)))
    this.calls = new WebAssembly.Instance(module, { env: { link_bytes: () => this.linkBytes(), answer: told } }).exports
    this.live = tape === null
    const samples = LIVE_ROUNDS * SLOTS * liveFingers
    const bytes = this.live ? 2 * samples : tape.length
    const at = this.calls.room(bytes)
    if (at === 0) throw new Error(`no memory for a tape of ${bytes} bytes`)
    this.#bytes().set(Buffer.from(`${serials}\0`), this.calls.serials())
    if (this.live) {
      this.calls.plug_in_live(liveFingers, samples)
    } else {
      this.#bytes().set(tape, at)
      const wrong = this.calls.plug_in(tape.length)
      if (wrong !== 0) throw new Error(this.#text(wrong))
    }
    this.overlaps = 0 // transfers with more than one chip select low: commands to all, else contention
    this.misconfigured = 0
    this.ends = CHIP_SELECTS.map((_, finger) => 1 << finger) // of the selects' leads: whom each selects
    this.lateAboveHz = Infinity // MISO is a bit late at faster clocks
    this.weak = new Map() // finger and channel: [share of the true change, first count]
    this.command = 0 // that was sent last
    this.stretched = false // the next word takes longer than any driver waits
    this.selected = 0 // ns, when a chip select last fell
    this.shortestSetup = Infinity // ns from there to a word
  }

  /** Somebody has asked for a sample. */
  get started() {
    return this.calls.started() !== 0
  }

  /** Somebody has asked for a sample behind the tape's last. */
  get over() {
    return !this.live && this.calls.over() !== 0
  }

  /** When time has to stand still because the next round is missing; ns of the sensors' world. */
  get standsAt() {
    return this.live && this.started ? this.calls.lacks_at() - LEAD_NS : Infinity
  }

  /** A whole round has come. */
  get hasRound() {
    return this.calls.rounds() > 0
  }

  /** Carry out a program's bytes; `answer` is called with the reply. */
  feed(chunk) {
    this.#bytes().set(chunk, this.calls.fed())
    this.calls.feed(chunk.length)
  }

  counters() {
    const early = CHIP_SELECTS.map((_, finger) => this.calls.early_reads(finger))
    const { overlaps, misconfigured } = this
    return { overlaps, misconfigured, early_reads: early, select_setup_ns: this.shortestSetup }
  }

  powerCycle() {
    this.calls.power_cycle()
  }

  /** Come to where the gateway is: they are there. */
  follow() {}

  /** Solder them to a chip. nanos() is the time the sensors live in. */
  wire(mcu, nanos) {
    const spi = mcu.spi[0]
    let low = 0
    let mask = 0
    CHIP_SELECTS.forEach((pin, finger) => {
      mcu.gpio[pin].addListener((state) => {
        // A pin that is not driven is pulled up at the sensor.
        low = state === GPIOPinState.Low ? low | (1 << finger) : low & ~(1 << finger)
        mask = this.ends.reduce((all, end, lead) => (low & (1 << lead) ? all | end : all), 0)
        if (state === GPIOPinState.Low) this.selected = mcu.clock.nanos
        this.calls.select(mask, nanos())
      })
    })
    let word = 0
    const done = mcu.clock.createAlarm(() => spi.completeTransmit(word))
    onReset(mcu, 'spi0', () => {
      done.cancel()
      spi.busy = false
      spi.rxFIFO.reset()
      spi.txFIFO.reset()
      spi.fifosUpdated()
    })
    spi.onTransmit = (mosi) => {
      this.shortestSetup = Math.min(this.shortestSetup, mcu.clock.nanos - this.selected)
      const late = this.stretched ? STRETCH_NS : 0
      this.stretched = false
      if (mask & (mask - 1)) this.overlaps++
      word = this.#answer(mcu, spi, mosi, nanos())
      if (mosi >> 8 >= SAMPLE_COMMAND) this.command = mosi >> 8
      else if (this.weak.size > 0) word = this.#weakened(word, Math.log2(mask))
      if (spi.clockFrequency > this.lateAboveHz) word >>>= 1
      // As published a transfer takes no time at all.
      done.schedule(Math.max(1, Math.round(spi.dataBits * (mcu.clkSys / spi.clockFrequency))) * (1e9 / mcu.clkSys) + late)
    }
  }

  #answer(mcu, spi, mosi, nanos) {
    const wired = [MISO, SCK, MOSI].every((pin) => mcu.gpio[pin].functionSelect === SPI_FUNCTION)
    const right = spi.enabled && WIDTHS.includes(spi.dataBits) && spi.spiMode === 0 && spi.clockFrequency <= FASTEST_HZ
    if (!wired || !right) {
      this.misconfigured++ // a real sensor's answer is unknown
      return 0xffff
    }
    return spi.dataBits === 8 ? this.calls.transfer_byte(mosi, nanos) : this.calls.transfer(mosi, nanos)
  }

  /** Have a select's lead end at another finger, or nowhere (null), by the names SS0 to SS4. */
  connect(name, end) {
    const [lead, finger] = [name, end].map((one) => (one === null ? null : Number(/^SS([0-4])$/.exec(one)?.[1] ?? NaN)))
    if (Number.isNaN(lead) || Number.isNaN(finger)) throw new Error(`no lead ${name} to ${end}: expected SS0 to SS4`)
    this.ends[lead] = finger === null ? 0 : 1 << finger
  }

  /** A finger's channel moves by this share of the true change; 0: it is stuck. */
  weaken(finger, channel, share) {
    this.weak.set(`${finger} ${COMMANDS.get(channel)}`, [share, null])
  }

  #weakened(word, finger) {
    const fault = this.weak.get(`${finger} ${this.command}`)
    if (fault === undefined || !odd(word >> 8) || !odd(word & 0xff)) return word
    const count = (word >> 9) * 32 + ((word >> 3) & 31)
    fault[1] ??= count
    const felt = Math.round(fault[1] + (count - fault[1]) * fault[0])
    const [high, low] = [(felt >> 5) << 1, (felt & 31) << 3]
    return ((odd(high) ? high : high | 1) << 8) | (odd(low) ? low : low | 1)
  }

  #bytes() {
    return new Uint8Array(this.calls.memory.buffer) // anew each time: growing detaches it
  }

  #text(at) {
    const bytes = this.#bytes()
    return Buffer.from(bytes.subarray(at, bytes.indexOf(0, at))).toString()
  }
}
