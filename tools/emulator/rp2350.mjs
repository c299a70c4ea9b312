// The RP2350 as Machine needs a chip: rp2350js 2.0.1, which is not fetched with the rest, corrected from outside so that
// it stays as published (host/docs/develop/pico2.md has each correction in words). The boot ROM is the chip's own
// code, of stepping A2: the program's calls run, down to the bytes on the flash's interface.
import { pathToFileURL } from 'node:url'

import { Surroundings } from './rom.mjs'

const FLASH_BYTES = 4 * 1024 * 1024 // of a Pico 2
const XIP = 0x10000000
const SRAM = 0x20000000
const [NVIC_IPR, NVIC_IPR_END, IPR_TOO_FAR] = [0xe400, 0xe440, 0x100]
const FIRST_INTERRUPT = 16
const RETURN_CYCLES = 12 // judged: an entry's, which rp2350js counts
const [NOP_W, HINT] = [0xf3af, 0xf3bf] // first halfwords: one unknown to rp2350js, and one that it treats as a hint
const [LOAD_ACQUIRE, BYTE, HALF] = [0xe8d0, 0x8f, 0x9f] // LDAB and LDAH, which it takes for LDA; the exclusive ones it knows
const TO_EXCLUSIVE = 0x40
const ISO = 1 << 8 // of a pad
const PAD_AT_RESET = 0x116
const NO_FUNCTION = 0x1f
const WATCHDOG_LOAD = 4
const [ADDR_ENDP, MAIN_CTRL, SIE_CTRL, EP_STALL_ARM] = [0x00, 0x40, 0x4c, 0x68]
const PHY_ISO = 1 << 2 // of MAIN_CTRL
const RESET_DONE = 8
const ALL_BLOCKS = 0x1fffffff
const [TO_BOOTSEL, REBOOT] = [2, 0xb007c0d3] // by the ROM's reboot() in scratch 6 and 4
const [BLOCK_START, BLOCK_WITHIN, BLOCK_END] = [0xffffded3, 4096, 0xab123579]

/** Blocks that are memory here, and the bits that are always there when the program looks. */
const MEMORIES = {
  0x40030: {}, // IO_QSPI
  0x40048: { 0x04: 1 << 31 }, // XOSC: STABLE
  0x40058: { 0x00: 1 << 31 }, // PLL_USB: LOCK
  0x40060: {}, // ACCESSCTRL
  0x400c8: {}, // XIP_CTRL
  0x400d0: {}, // QMI
  0x400e8: { 0x14: 1 << 31 }, // ROSC: STABLE
  0x40108: {}, // TICKS
}

function bootable(flash) {
  const words = new Uint32Array(flash.buffer, flash.byteOffset, BLOCK_WITHIN / 4)
  const start = words.indexOf(BLOCK_START)
  return start >= 0 && words.indexOf(BLOCK_END, start) >= 0
}

/** path: of the module that is made of rp2350js. */
export async function rp2350(path) {
  const published = await import(pathToFileURL(path))
  correctPrototypes(published)
  return {
    flashBytes: FLASH_BYTES,
    flashId: [0xef, 0x40, 0x16], // W25Q32
    family: 0xe48bff59, // of UF2 files
    Rom: Surroundings2350,
    checkImage(image) {
      if (image.length <= BLOCK_WITHIN || image.length > FLASH_BYTES || !bootable(new Uint8Array(image))) {
        throw new Error('has no IMAGE_DEF in its first 4 KiB: expected the .bin of a Pico 2 image')
      }
    },
    make: (nanos) => make(published, nanos),
    /** The ROM goes on from here, unless the loader was asked for, or there is no image. */
    boot({ blocks, flash }) {
      const { scratchData: scratch } = blocks.watchdog
      return bootable(flash) && !(scratch[4] === REBOOT && scratch[6] === TO_BOOTSEL)
    },
  }
}

function correctPrototypes({ CortexM33Core, GPIOPin }) {
  const give = (of, name, get, set) => Object.defineProperty(of.prototype, name, { get, set, configurable: true })
  give(CortexM33Core, 'IPSR', function () { return this.regs.ipsr })
  give(CortexM33Core, 'PM', function () { return this.regs.primask !== 0 }, function (set) { this.regs.primask = set ? 1 : 0 })
  give(CortexM33Core, 'enabledInterrupts', undefined, function (none) { this.ppb().nvicEnabled.fill(none) })
  // An isolated pad is as it was at reset: nobody's. The overrides are where the RP2350 has them.
  give(GPIOPin, 'functionSelect', function () { return this.padValue & ISO ? NO_FUNCTION : this.ctrl & NO_FUNCTION })
  give(GPIOPin, 'outputOverride', function () { return this.padValue & ISO ? 0 : (this.ctrl >> 12) & 3 })
  give(GPIOPin, 'outputEnableOverride', function () { return this.padValue & ISO ? 0 : (this.ctrl >> 14) & 3 })
}

/** The chip for Machine and the surroundings: names as in rp2040js. */
function make(published, nanos) {
  const { BasePeripheral, ConsoleLogger, RP2350 } = published
  const chip = new RP2350({ coreArch: 'arm' })
  const { peripherals } = chip
  const memory = (ready) => {
    const [block, words] = [new BasePeripheral(chip, 'memory'), {}]
    block.readUint32 = (offset) => ((words[offset] ?? 0) | (ready[offset] ?? 0)) >>> 0
    block.writeUint32 = (offset, value) => (words[offset] = value)
    return block
  }
  chip.clock.nanosCounter = nanos
  chip.logger = new ConsoleLogger(3, true) // errors
  for (const [block, ready] of Object.entries(MEMORIES)) peripherals[block] = memory(ready)
  for (const pin of chip.gpio) pin.padValue = PAD_AT_RESET
  correctCore(chip)
  correctBlocks(chip)
  const [core] = chip.core
  return {
    core,
    blocks: { timer: peripherals[0x400b0], watchdog: chip.watchdog, resets: peripherals[0x40020] },
    resetBits: { spi0: 1 << 18, usb: 1 << 28 },
    dmaTimers: 0x440,
    addClockListener: () => {}, // clk_sys is constant
    setInterrupt: (irq, high) => core.setInterrupt(irq, high),
    chip,
    ...Object.fromEntries(SAME.map((name) => [name, chip[name]])),
  }
}

const SAME = 'adc clkSys clock dma flash gpio peripherals spi sram uart usbCtrl usbDPRAM usbDPRAMView'.split(' ')

function correctCore(chip) {
  const { ppb } = chip
  const [core] = chip.core
  const state = core.ppb()
  const lines = [0, 0] // pending interrupt requests
  core.owedCycles = 0
  core.wakes = () =>
    !!((state.nvicPending[0] & state.nvicEnabled[0]) | (state.nvicPending[1] & state.nvicEnabled[1])) ||
    state.pendingSystick ||
    state.pendingPendSV
  core.setInterrupt = (irq, high) => {
    const [bank, bit] = [irq >>> 5, 1 << (irq & 31)]
    lines[bank] = high ? lines[bank] | bit : lines[bank] & ~bit
    state.nvicPending[bank] = (state.nvicPending[bank] & ~bit) | (lines[bank] & bit & ~state.nvicActive[bank])
    core.interruptsUpdated = true
  }
  chip.core[1].setInterrupt = () => {} // it sleeps in the ROM
  for (const alarm of chip.sio.mtimecmpAlarm) alarm.enable = false // RISC-V's timer: with it nothing is ever still
  const leave = core.exceptionReturn.bind(core)
  core.exceptionReturn = (value) => {
    const irq = core.IPSR - FIRST_INTERRUPT
    leave(value)
    if (irq >= 0) state.nvicActive[irq >>> 5] &= ~(1 << (irq & 31))
    for (const bank of [0, 1]) state.nvicPending[bank] |= lines[bank] & ~state.nvicActive[bank]
    core.owedCycles += RETURN_CYCLES
  }
  for (const name of ['readUint32ViaCore', 'writeUint32ViaCore']) {
    const access = ppb[name].bind(ppb)
    ppb[name] = (offset, ...rest) =>
      access(offset >= NVIC_IPR && offset < NVIC_IPR_END ? offset + IPR_TOO_FAR : offset, ...rest)
  }
  const { sram16, flash16 } = chip
  const read16 = chip.readUint16.bind(chip)
  const [ramEnd, flashEnd] = [SRAM + chip.sram.length, XIP + FLASH_BYTES]
  chip.readUint16 = (address) => {
    const at = address - SRAM
    if (at >= 0 && address < ramEnd) {
      const value = sram16[at >>> 1]
      if (value === NOP_W && address === core.regs.pc) return HINT
      const low = value & 0xff
      const acquires = (low === BYTE || low === HALF) && address === core.regs.pc + 2
      return acquires && (sram16[(at >>> 1) - 1] & 0xfff0) === LOAD_ACQUIRE ? value - TO_EXCLUSIVE : value
    }
    return address >= XIP && address < flashEnd ? flash16[(address - XIP) >>> 1] : read16(address)
  }
}

function correctBlocks(chip) {
  const { watchdog, usbCtrl, peripherals } = chip
  const resets = peripherals[0x40020]
  const readResets = resets.readUint32.bind(resets)
  resets.readUint32 = (offset) => (offset === RESET_DONE ? ~readResets(0) & ALL_BLOCKS : readResets(offset))
  const load = watchdog.writeUint32.bind(watchdog)
  // Counted in half microseconds, as the RP2040's erratum E1 has it, which this chip has not.
  watchdog.writeUint32 = (offset, value) => load(offset, offset === WATCHDOG_LOAD ? 2 * value : value)
  Object.assign(usbCtrl, { addrEndp: 0, sieCtrl: 0, epStallArm: 0 })
  const named = { [ADDR_ENDP]: 'addrEndp', [SIE_CTRL]: 'sieCtrl', [EP_STALL_ARM]: 'epStallArm' }
  const [readUsb, writeUsb] = [usbCtrl.readUint32.bind(usbCtrl), usbCtrl.writeUint32.bind(usbCtrl)]
  usbCtrl.readUint32 = (offset) => (offset in named ? usbCtrl[named[offset]] : readUsb(offset))
  usbCtrl.writeUint32 = (offset, value) => {
    if (offset in named) usbCtrl[named[offset]] = value
    else writeUsb(offset, offset === MAIN_CTRL && value & PHY_ISO ? 0 : value)
  }
}

const [CSR, TX, RX] = [0, 4, 8]
const [EN, ASSERT_CS, TXEMPTY, RXEMPTY] = [1, 1 << 2, 1 << 11, 1 << 16]
const MANY_LINES = 3 << 16
const TWO_BYTES = 1 << 18 // the lower first
const NO_PUSH = 1 << 20
const [WRITE_ENABLE, STATUS, ERASE, PROGRAM, READ_ID, READ_UNIQUE_ID] = [0x06, 0x05, 0x20, 0x02, 0x9f, 0x4b]
const [SECTOR, DATA_AT, UNIQUE_ID_AT] = [4096, 4, 5]
const WRITES_ENABLED = 2

/** The flash behind QMI's direct mode (12.14.5), and the chip's number and random bit. */
class Surroundings2350 extends Surroundings {
  constructor(machine, board, then) {
    super(machine, board, then)
    this.flash = { readable: true }
    const { peripherals } = this.mcu
    const qmi = peripherals[0x400d0]
    const [readQmi, writeQmi, answers] = [qmi.readUint32, qmi.writeUint32, []]
    let [csr, waiting, sent, writable] = [0, [], [], false]
    const drain = () => {
      for (const word of waiting.splice(0)) {
        if (csr & ASSERT_CS && !(word & MANY_LINES)) sent.push(word & 0xff, ...(word & TWO_BYTES ? [(word >> 8) & 0xff] : []))
        if (!(word & NO_PUSH)) answers.push(this.#answer(sent, writable))
      }
    }
    const released = () => {
      const at = (sent[1] << 16) | (sent[2] << 8) | sent[3]
      const data = sent.slice(DATA_AT)
      if (sent[0] === ERASE && writable) this.erase(at, SECTOR)
      if (sent[0] === PROGRAM && writable) this.program(at, data.length, (k) => data[k])
      writable = sent[0] === WRITE_ENABLE || (writable && sent[0] !== ERASE && sent[0] !== PROGRAM)
      sent = []
    }
    qmi.readUint32 = (offset) => {
      if (offset === CSR) return (csr | TXEMPTY | (answers.length > 0 ? 0 : RXEMPTY)) >>> 0
      return offset === RX ? (answers.shift() ?? 0) : readQmi(offset)
    }
    qmi.writeUint32 = (offset, value) => {
      writeQmi(offset, value)
      if (offset === TX) waiting.push(value)
      if (offset === CSR) csr = value & ~(TXEMPTY | RXEMPTY)
      if (csr & EN) drain()
      if (!(csr & ASSERT_CS) && sent.length > 0) released()
      this.flash.readable = !(csr & EN)
    }
    this.#words()
    peripherals[0x40000].readUint32 = (offset) => (offset === 0 ? ((board.revision << 28) | 0x4927) >>> 0 : 0)
    const readRosc = peripherals[0x400e8].readUint32
    peripherals[0x400e8].readUint32 = (offset) => (offset === 0x20 ? board.randomBit() : readRosc(offset))
  }

  #answer(sent, writable) {
    const at = sent.length - 1
    if (sent[0] === STATUS) return writable ? WRITES_ENABLED : 0
    if (sent[0] === READ_ID) return this.board.flashId[at - 1] ?? 0xff
    return (sent[0] === READ_UNIQUE_ID ? this.board.numberSent(at - UNIQUE_ID_AT) : undefined) ?? 0xff
  }

  /** Words of SRAM at once; words of flash as the board may misread them, and never while it is no memory. */
  #words() {
    const { board, mcu: { chip } } = this
    const { sram32 } = chip
    const [read, write] = [chip.readUint32.bind(chip), chip.writeUint32.bind(chip)]
    const last = chip.sram.length - 4
    chip.readUint32 = (address) => {
      const at = (address >>> 0) - SRAM
      if (at >= 0 && at <= last && (at & 3) === 0) return sram32[at >>> 2]
      if (at < 0 && address >= XIP) {
        if (!this.flash.readable) this.wrong('flash read while it is no memory')
        return read(address) ^ board.misread(address)
      }
      return read(address)
    }
    chip.writeUint32 = (address, value) => {
      const at = (address >>> 0) - SRAM
      if (at >= 0 && at <= last && (at & 3) === 0) sram32[at >>> 2] = value
      else write(address, value)
    }
  }
}
