// The sensors as a board of their own: a second emulated Pico that runs firmware/sensor_board, and the leads to the
// gateway's. Takes the place of Sensors (sensors.mjs), edge by edge: SCK and MOSI as the gateway's SPI block would drive
// them, MISO as the pad carries it when the clock rises.
//
// The gateway runs ahead. Pin changes are stored with their times, and the sensors' board runs after it as soon as
// the gateway wants to know something of it: the word that it has read.
import fs from 'node:fs'

import { GPIOPinState } from 'rp2040js'

import { Machine } from './machine.mjs'
import { PioTime } from './pio.mjs'
import { Board, BootRom } from './rom.mjs'
import { CHIP_SELECTS, WIDTHS } from './sensors.mjs'
import { UsbHost } from './usb.mjs'

const [MISO, SCK, MOSI] = [16, 18, 19] // firmware/sensor_board/pins.h
export const SELECTS = [2, 3, 4, 5, 6]
const LEADS = { SCK, MOSI, MISO, SS0: 2, SS1: 3, SS2: 4, SS3: 5, SS4: 6 } // where each goes to when all is well
const SYNCHRONISER_NS = 16 // two flip-flops behind each input
const LONGEST_STEP_NS = 200 // an exception's entry takes 16 cycles of 8 ns
const SAMPLE_COMMAND = 0x80 // and above
const SLOTS = JSON.parse(fs.readFileSync(new URL('../../protocol/schema.json', import.meta.url))).sensor.frame.slots.length
const TAPE_FRAMES_AT = 12
const SPI_BLOCK_BITS = 16

export class SensorBoard {
  /** tape: the one that the host will play; only the length matters here, unless endless. */
  constructor({ image, tape, endless, port }) {
    this.port = port
    this.frames = endless ? Infinity : tape.readUInt32LE(TAPE_FRAMES_AT)
    this.stretched = false // no lead makes a word longer
    this.ends = new Map(Object.values(LEADS).map((pin) => [pin, pin])) // of the gateway's leads; null: nowhere
    this.edges = [] // {at: ns, pin, high}, sorted by time; those before `passed` are over
    this.passed = 0
    this.word = 0 // as the gateway's shift register has it
    this.miso = { now: 0, before: 0, since: 0 }
    this.lateEdges = 0 // that came when the board was already past their time
    this.commands = 0 // to sample
    this.fell = null // ns, when a select last fell
    this.slowestAnswer = 0 // ns from there until MISO was driven, and the least that the bus has left for it
    this.leastLeft = Infinity
    this.gateway = null // the chip, once it has power
    this.behind = 0 // ns: this board's time less the gateway's
    this.machine = new Machine(image, (machine) => this.#attach(machine))
  }

  get started() {
    return this.commands > 0
  }

  get over() {
    return this.commands > this.frames * SLOTS
  }

  counters() {
    const { commands, lateEdges, slowestAnswer, leastLeft } = this
    return { commands, late_edges: lateEdges, answer_ns: slowestAnswer, answer_left_ns: leastLeft, usb: this.usb.state, instructions: this.machine.instructions, slept: this.machine.sleptNanos / this.machine.nanos }
  }

  /** Have the gateway's lead of this name end where another one should, or nowhere (null); both are names of LEADS. */
  connect(name, end) {
    if (!(name in LEADS) || (end !== null && !(end in LEADS))) {
      throw new Error(`no lead ${name} to ${end}: expected names from ${Object.keys(LEADS).join(', ')}`)
    }
    const left = this.ends.get(LEADS[name])
    if (left !== null && left !== MISO) this.pio.input(left, SELECTS.includes(left)) // level of a pull
    this.ends.set(LEADS[name], end === null ? null : LEADS[end])
  }

  powerCycle() {
    this.machine.powerCycle()
  }

  /** Run by itself, while there is no gateway, or it stands still. */
  runAlone(nanos) {
    this.runUntil(this.machine.nanos + nanos)
    if (this.gateway) this.behind = this.machine.nanos - this.gateway.clock.nanos
  }

  /** The gateway's chip, at the other end of the leads; again after each reset. */
  wire(mcu) {
    this.behind = this.machine.nanos - mcu.clock.nanos
    this.gateway = mcu
    CHIP_SELECTS.forEach((pin, finger) => {
      mcu.gpio[pin].addListener((state) => this.lead(mcu.clock.nanos, SELECTS[finger], state !== GPIOPinState.Low))
    })
    const spi = mcu.spi[0]
    const done = mcu.clock.createAlarm(() => {
      this.runUntil(mcu.clock.nanos + this.behind)
      spi.completeTransmit(this.word)
    })
    spi.onTransmit = (mosi) => {
      if (!WIDTHS.includes(spi.dataBits) || spi.spiMode !== 0) throw new Error('wrong SPI mode or word width of the gateway: expected mode 0 and one of WIDTHS')
      this.commands += spi.dataBits === SPI_BLOCK_BITS && mosi >> 8 >= SAMPLE_COMMAND ? 1 : 0
      done.schedule(this.clockOut(mcu.clock.nanos, mosi, spi.dataBits, 1e9 / spi.clockFrequency))
    }
  }

  /** Come to where the gateway is, but never past it: a board runs whole instructions. */
  follow() {
    this.runUntil(this.gateway.clock.nanos + this.behind - LONGEST_STEP_NS)
  }

  runUntil(nanos) {
    if (nanos <= this.machine.nanos) return
    this.usb.setOpen(this.port.up)
    this.usb.poke()
    this.machine.runUntil(nanos)
  }

  /** A word's edges, the first bit out half a period before the clock first rises. Returns how long it takes in ns. */
  clockOut(start, mosi, bits, period) {
    this.word = 0
    for (let k = 0; k < bits; k++) {
      this.lead(start + k * period, MOSI, ((mosi >> (bits - 1 - k)) & 1) === 1)
      this.lead(start + (k + 0.5) * period, SCK, true)
      this.lead(start + (k + 1) * period, SCK, false)
    }
    if (this.fell !== null) this.leastLeft = Math.min(this.leastLeft, start + period / 2 - this.fell)
    return bits * period
  }

  /** A lead's level at a time of the gateway's: SELECTS, SCK, MOSI. */
  lead(nanos, pin, high) {
    if (SELECTS.includes(pin)) this.fell = high ? null : nanos
    const at = nanos + this.behind + SYNCHRONISER_NS
    let k = this.edges.length
    while (k > this.passed && this.edges[k - 1].at > at) k--
    this.edges.splice(k, 0, { at, pin, high })
    if (k === this.passed) this.#await()
  }

  #await() {
    if (this.passed === this.edges.length) {
      this.edges = []
      this.passed = 0
      return
    }
    const { nanos } = this.machine
    const { at } = this.edges[this.passed]
    if (at < nanos - 1e-3) this.lateEdges++
    this.next.schedule(Math.max(0, at - nanos))
  }

  #arrive() {
    const { at, pin, high } = this.edges[this.passed++]
    const left = at - SYNCHRONISER_NS // when it left the gateway
    if (SELECTS.includes(pin)) this.selectFell = high ? null : left
    const end = this.ends.get(pin)
    if (end !== null && end !== MISO) this.pio.input(end, high)
    if (pin === SCK && high) {
      const { now, before, since } = this.miso
      const bit = this.ends.get(MISO) !== MISO ? 0 : since > left ? before : now // the gateway pulls MISO down
      this.word = (this.word << 1) | bit
    }
    this.#await()
  }

  #attach(machine) {
    const { mcu } = machine
    this.pio = new PioTime(mcu)
    for (const pin of SELECTS) this.pio.input(pin, true) // the gateway's, or the pull-up's
    this.edges = []
    this.passed = 0
    this.next = mcu.clock.createAlarm(() => this.#arrive())
    mcu.gpio[MISO].addListener((state) => {
      const high = state === GPIOPinState.High
      this.miso = { now: high ? 1 : 0, before: this.miso.now, since: this.pio.nanos }
      const driven = high || state === GPIOPinState.Low
      if (driven && this.selectFell !== null) {
        this.slowestAnswer = Math.max(this.slowestAnswer, this.pio.nanos - this.selectFell)
        this.selectFell = null
      }
    })
    this.selectFell = null
    const board = new Board({ uniqueId: [0xe6, 0x60, 0x58, 0x38, 0x83, 0x1f, 0x5b, 0x5e] })
    this.rom = new BootRom(machine, board, {
      onLoader: () => {},
      onCut: () => {},
    })
    this.usb = new UsbHost(mcu, board, {
      onData: (bytes) => this.port.put(bytes),
      canTake: () => this.port.hasRoom,
      take: (n) => this.port.take(n),
    })
    this.usb.setOpen(this.port.up)
  }
}
