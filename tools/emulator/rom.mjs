// Parts of a real chip that rp2040js lacks: the boot ROM's functions and the ring oscillator's
// random bit. Modelled from the RP2040 data sheet (2.8.3, 2.17). The ROM's calls are real calls, to two
// instructions: BKPT, which comes here, and BX LR.
import { randomInt } from 'node:crypto'

import { correctDma } from './dma.mjs'
import { ERASE_NS, Flash, ISSI, PAGE, PROGRAM_NS, SECTOR } from './flash.mjs'

const FUNC_TABLE = 0x40
const LOOKUP = 0x20
const FIRST_STUB = 0x80
const BKPT = 0xbe00
const BX_LR = 0x4770
const WFI_FOREVER = [0xbf30, 0xe7fd] // wfi; b back to it
const THUMB = 1
const CYCLE_NS = 8
const MISREAD_AT = 0x10004000
const HARD_FAULT = 3
const FAULT_AFTER_NS = 1e6 // the image is being copied then

const ROSC = 0x40060
const SYSINFO = 0x40000
const ROSC_RANDOMBIT = 0x1c

/** State that outlives a power cycle, held by the rig. */
export class Board {
  constructor({ uniqueId = [0xe6, 0x60, 0x58, 0x38, 0x83, 0x1f, 0x5b, 0x2c], flashId = [0xef, 0x40, 0x15] } = {}) {
    this.uniqueId = uniqueId
    this.random = randomInt(1, 2 ** 31) // no two programs boot alike
    this.cutAfter = null // bytes erased or programmed until power fails
    this.eraseNanos = ERASE_NS // of a flash sector
    this.programNanos = PROGRAM_NS // a page
    this.flashId = flashId // W25Q16JV
    this.frameNanos = 1e6 // of the host's USB, by this board's clock
    this.lostFrames = Infinity // one start of frame in so many does not come
    this.supplyMv = 4750 // VBUS less a diode
    this.celsius = 27
    this.revision = 2 // of the chip: B2
    this.hubMilliamps = 500
    this.dmaSlowness = 1 // of channels that a timer paces
    this.atErase = null // a function to run with the next one
    this.misreads = 0 // starts in which a word of the image is read wrongly from flash
    this.faultyStarts = 0 // starts that an exception ends before the program runs
    this.writtenAt = null // where it was programmed last
    this.counters = { erases: 0, programs: 0, bytes: 0, misses: 0, wrong: [] }
  }

  /** A byte of the flash's number. ISSI's has 16; the first may be the same on all boards (pico-sdk #1641). */
  numberSent(at) {
    return (this.flashId[0] === ISSI ? [...Array(8).fill(0x11), ...this.uniqueId] : this.uniqueId)[at]
  }

  randomBit() {
    this.random ^= this.random << 13
    this.random ^= this.random >>> 17
    this.random ^= this.random << 5
    return this.random & 1
  }

  /** Bits flipped in a word of the image as it is copied. */
  misread(address) {
    return address === MISREAD_AT && this.misreads-- > 0 ? 1 << 17 : 0
  }

  /** Bytes of flash one by one, so that power can fail after any of them. False when it did. */
  change(flash, at, bytes, value) {
    for (let k = 0; k < bytes; k++) {
      if (this.cutAfter === 0) {
        this.cutAfter = null
        return false
      }
      if (this.cutAfter !== null) this.cutAfter--
      this.counters.bytes++
      flash[at + k] = value(k)
    }
    return true
  }
}

/** The surroundings of both chips' programs. */
export class Surroundings {
  /** onLoader(): the program asked for the UF2 loader. onCut(): power fails in the middle of a flash write. */
  constructor({ mcu, time }, board, { onLoader, onCut }) {
    this.mcu = mcu
    this.board = board
    this.onLoader = onLoader
    this.onCut = onCut
    correctDma(mcu, time, (what) => this.wrong(what), board)
    this.#measures()
    mcu.clock.createAlarm(() => board.faultyStarts-- > 0 && mcu.core.exceptionEntry(HARD_FAULT)).schedule(FAULT_AFTER_NS)
  }

  wrong(what) {
    const { wrong } = this.board.counters
    if (wrong.length < 10) wrong.push(`${what} at ${(this.mcu.core.PC >>> 0).toString(16)}`)
  }

  #change(at, bytes, value) {
    if (!this.board.change(this.mcu.flash, at, bytes, value)) this.onCut()
  }

  #allowed(at, bytes, unit, what) {
    if (this.flash.readable) this.wrong(`${what} without leaving XIP`)
    else if (!this.mcu.core.PM) this.wrong(`${what} with interrupts on`)
    else if (at % unit !== 0 || bytes % unit !== 0) this.wrong(`${what} of ${bytes} bytes at ${at}`)
    else return true
    return false
  }

  erase(at, bytes) {
    if (!this.#allowed(at, bytes, SECTOR, 'erase')) return
    this.board.atErase?.()
    this.board.atErase = null
    this.board.counters.erases++
    this.#spend((this.board.eraseNanos * bytes) / SECTOR)
    this.#change(at, bytes, () => 0xff)
  }

  /** byte(k): the byte for at + k. */
  program(at, bytes, byte) {
    if (!this.#allowed(at, bytes, PAGE, 'program')) return
    this.board.counters.programs++
    this.#spend((this.board.programNanos * bytes) / PAGE)
    this.board.writtenAt = at
    this.#change(at, bytes, (k) => this.mcu.flash[at + k] & byte(k))
  }

  #spend(nanos) {
    this.mcu.core.owedCycles += Math.round(nanos / CYCLE_NS)
  }

  /** GPIO 29 has a third of the supply on a Pico; channel 4 is the chip's own temperature (4.9.5). */
  #measures() {
    const adc = this.mcu.adc
    adc.onADCRead = (channel) => {
      const millivolts = channel === 3 ? this.board.supplyMv / 3 : channel === 4 ? 706 - 1.721 * (this.board.celsius - 27) : 0
      adc.channelValues[channel] = Math.round((millivolts * 4096) / 3300)
      adc.currentChannel = channel
      adc.sampleAlarm.schedule(adc.sampleTime * 1000)
    }
  }
}

export class BootRom extends Surroundings {
  constructor(machine, board, then) {
    super(machine, board, then)
    this.flash = new Flash(this.mcu, board, (what) => this.wrong(what))
    this.#install()
    this.#randomBit()
  }

  #install() {
    const functions = {
      IF: () => {},
      EX: () => this.flash.leaveXip(),
      FC: () => this.flash.cache.flush(),
      RE: () => this.erase(...this.#r),
      RP: () => {
        const [at, from, bytes] = this.#r
        this.program(at, bytes, (k) => this.mcu.readUint8(from + k))
      },
      UB: () => this.#loader(),
    }
    const actions = [() => this.#lookup(), ...Object.values(functions)]
    const words = new Uint16Array(0x200)
    words[0x14 / 2] = FUNC_TABLE
    words[0x18 / 2] = LOOKUP | THUMB
    words.set([BKPT, BX_LR], LOOKUP / 2)
    Object.keys(functions).forEach((name, k) => {
      const at = FIRST_STUB + 8 * k
      words.set([name.charCodeAt(0) | (name.charCodeAt(1) << 8), at | THUMB], FUNC_TABLE / 2 + 2 * k)
      words.set([BKPT | (k + 1), ...(name === 'UB' ? WFI_FOREVER : [BX_LR])], at / 2)
    })
    this.mcu.bootrom.set(new Uint32Array(words.buffer))
    this.mcu.onBreak = (number) => actions[number]?.()
  }

  get #r() {
    return this.mcu.core.registers
  }

  #lookup() {
    const code = this.#r[1] & 0xffff
    let at = this.#r[0]
    while (this.mcu.readUint16(at) !== 0 && this.mcu.readUint16(at) !== code) at += 4
    this.#r[0] = this.mcu.readUint16(at) === 0 ? 0 : this.mcu.readUint16(at + 2)
  }

  #randomBit() {
    const sysinfo = this.mcu.peripherals[SYSINFO]
    const read = sysinfo.readUint32.bind(sysinfo)
    sysinfo.readUint32 = (offset) => (offset === 0 ? ((this.board.revision << 28) | 0x2927) >>> 0 : read(offset))
    const rosc = this.mcu.peripherals[ROSC]
    rosc.readUint32 = (offset) => (offset === ROSC_RANDOMBIT ? this.board.randomBit() : 0)
  }

  /** The program is gone: interrupts and watchdog are off. loader.mjs has the loader. */
  #loader() {
    const { core, peripherals } = this.mcu
    core.PM = true
    core.enabledInterrupts = 0
    peripherals[0x40058].timer.enable = peripherals[0x40058].alarm.enable = false
    this.onLoader()
  }
}
