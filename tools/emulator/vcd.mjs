// A logic analyser's recording of the gateway's pins: SPI, selects and UART as a value change dump (IEEE 1364, 18),
// which sigrok, PulseView and GTKWave read. 1 ns a step; it takes some 13 MB a second while five fingers are sampled.
//
// Edges of a word are where SPI mode 0 has them; MISO changes with them, while a real sensor and cable are slower.
import fs from 'node:fs'

import { GPIOPinState } from 'rp2040js'

import { CHIP_SELECTS } from './sensors.mjs'

const LINES = ['SCK', 'MOSI', 'MISO', ...CHIP_SELECTS.map((_, finger) => `SS${finger}`), 'TX', 'RX']
const IDLE_HIGH = /^SS|^.X$/ // selects with their pull-ups; a UART at rest
const LONGEST_NS = 10e6 // of a byte: older changes are written in order

export class Vcd {
  constructor(path) {
    this.file = fs.openSync(path, 'w')
    this.levels = new Map(LINES.map((name) => [name, IDLE_HIGH.test(name) ? 1 : 0]))
    this.changes = [] // [ns, line, level], not yet in order
    this.written = -1
    const mark = (name) => String.fromCharCode(33 + LINES.indexOf(name))
    this.marks = new Map(LINES.map((name) => [name, mark(name)]))
    const variables = LINES.map((name) => `$var wire 1 ${mark(name)} ${name} $end\n`).join('')
    const first = LINES.map((name) => `${this.levels.get(name)}${mark(name)}\n`).join('')
    fs.writeSync(this.file, `$timescale 1 ns $end\n$scope module pico $end\n${variables}$upscope $end\n$enddefinitions $end\n#0\n${first}`)
  }

  /** Listen to a chip, again after each reset; now() is the time axis, in ns. */
  watch(mcu, now, uarts) {
    CHIP_SELECTS.forEach((pin, finger) => {
      const set = (state) => this.#set(now(), `SS${finger}`, state === GPIOPinState.Low ? 0 : 1)
      set(mcu.gpio[pin].value)
      mcu.gpio[pin].addListener(set)
    })
    const spi = mcu.spi[0]
    const [transmit, complete] = [spi.onTransmit, spi.completeTransmit.bind(spi)]
    let word = null
    spi.onTransmit = (mosi) => {
      word = { at: now(), mosi, bits: spi.dataBits, period: 1e9 / spi.clockFrequency }
      transmit(mosi)
    }
    spi.completeTransmit = (miso) => {
      if (word !== null) this.#word(word, miso)
      word = null
      complete(miso)
    }
    for (const uart of uarts) uart.onByte = (line, byte) => this.#byte(line, byte, now(), uart.byteNanos)
  }

  /** Write changes that are in order by now; all with Infinity. */
  flush(nanos) {
    this.changes.sort((a, b) => a[0] - b[0])
    let text = ''
    let count = 0
    for (const [at, line, level] of this.changes) {
      if (at > nanos - LONGEST_NS) break
      count++
      if (this.levels.get(line) === level) continue
      this.levels.set(line, level)
      if (at > this.written) text += `#${at}\n`
      this.written = Math.max(this.written, at)
      text += `${level}${this.marks.get(line)}\n`
    }
    this.changes.splice(0, count)
    // Sigrok sees no change at a file's last time, so one without a change follows.
    if (text !== '') fs.writeSync(this.file, `${text}#${++this.written}\n`)
  }

  #set(at, line, level) {
    this.changes.push([Math.round(at), line, level])
  }

  #word({ at, mosi, bits, period }, miso) {
    for (let k = 0; k < bits; k++) {
      this.#set(at + k * period, 'MOSI', (mosi >> (bits - 1 - k)) & 1)
      this.#set(at + k * period, 'MISO', (miso >> (bits - 1 - k)) & 1)
      this.#set(at + (k + 0.5) * period, 'SCK', 1)
      this.#set(at + (k + 1) * period, 'SCK', 0)
    }
    this.#set(at + bits * period, 'MISO', 0) // nobody drives it; the Pico pulls it down
  }

  /** A byte after the stop bit. */
  #byte(line, byte, end, nanos) {
    const bits = (byte | 0x100) << 1 // a start bit, eight from the lowest on, a stop bit
    for (let k = 0; k < 10; k++) this.#set(end - nanos + (k * nanos) / 10, line, (bits >> k) & 1)
  }
}
