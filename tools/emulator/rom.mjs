// The chip's boot ROM and its flash chip, as far as an image may call on them. rp2040js has neither.
//
// The ROM's own code is the look-up of functions by two letters; each function is a breakpoint that comes here.
// While the flash takes commands nothing can be read from it: code that runs from flash meanwhile meets 0xFF.

const TABLE_POINTER = 0x14
const LOOKUP_POINTER = 0x18
const LOOKUP = 0x80
const TABLE = 0x100
const FUNCTIONS = 0x200
const ROM_BYTES = 0x4000
const BX_LR = 0x4770
const BKPT = 0xbe00
// r0: table of pairs (letters, address), ended by 0; r1: letters. Returns the address or 0.
const LOOKUP_CODE = [0x8802, 0x2a00, 0xd005, 0x428a, 0xd001, 0x3004, 0xe7f8, 0x8840, BX_LR, 0x2000, BX_LR]

const ERASE_S = 0.045 // a sector of a W25Q16JV, typically
const PROGRAM_S = 0.0004 // a page
const SECTOR_BYTES = 4096
const PAGE_BYTES = 256
const SRAM = 0x20000000

const SSI = 0x18000
const SSI_SSIENR = 0x08
const SSI_DR0 = 0x60
const IO_QSPI = 0x40018
const SS_CTRL = 0x0c
const OVERRIDE = 3 << 8
const DRIVEN_LOW = 2 << 8
const UNIQUE_ID_COMMAND = 0x4b
const UNIQUE_ID_DUMMIES = 4
const UNIQUE_ID = [0xe6, 0x61, 0x45, 0x4d, 0x55, 0x00, 0x00, 0x01]

/** What lasts over resets: how often the flash was written, and when to lose power at it. */
export class FlashLife {
  constructor() {
    this.erases = 0
    this.programs = 0
    this.cutAt = 0 // power goes in the middle of this write, counted from 1; 0: of none
    this.breaches = 0 // writes that the chip would not have done as asked
  }

  get writes() {
    return this.erases + this.programs
  }
}

let erasedView = null

/** Give a chip its ROM. onPowerCut() and onLoader() tell what a call led to. */
export function installRom(mcu, life, { onPowerCut, onLoader }) {
  const { core } = mcu
  const readable = mcu.flashView
  const hide = () => (mcu.flashView = erasedView ??= new DataView(new Uint8Array(mcu.flash.length).fill(0xff).buffer))
  const show = () => (mcu.flashView = readable)

  function busy(seconds) {
    core.owedCycles += Math.round(seconds * mcu.clkSys)
  }

  /** Changes flash[from, to) byte by byte; half of it when power goes. */
  function change(from, to, byteAt) {
    const cut = life.writes === life.cutAt
    const end = cut ? from + (to - from) / 2 : to
    if (mcu.flashView === readable) life.breaches++ // not taken out of XIP first
    for (let at = from; at < end; at++) mcu.flash[at] = byteAt(at)
    if (cut) onPowerCut()
  }

  const functions = {
    IF: () => {},
    EX: hide,
    FC: () => {},
    RE: () => {
      const [from, bytes] = core.registers
      if (from % SECTOR_BYTES || bytes % SECTOR_BYTES) life.breaches++
      life.erases++
      change(from, from + bytes, () => 0xff)
      busy((bytes / SECTOR_BYTES) * ERASE_S)
    },
    RP: () => {
      const [to, from, bytes] = core.registers
      if (to % PAGE_BYTES || bytes % PAGE_BYTES || from < SRAM) life.breaches++
      life.programs++
      change(to, to + bytes, (at) => mcu.flash[at] & mcu.readUint8(from + at - to))
      busy((bytes / PAGE_BYTES) * PROGRAM_S)
    },
    UB: onLoader,
  }

  const rom = new DataView(mcu.bootrom.buffer)
  rom.setUint16(TABLE_POINTER, TABLE, true)
  rom.setUint16(LOOKUP_POINTER, LOOKUP | 1, true)
  LOOKUP_CODE.forEach((word, k) => rom.setUint16(LOOKUP + 2 * k, word, true))
  Object.keys(functions).forEach((letters, k) => {
    rom.setUint16(TABLE + 4 * k, letters.charCodeAt(0) | (letters.charCodeAt(1) << 8), true)
    rom.setUint16(TABLE + 4 * k + 2, (FUNCTIONS + 4 * k) | 1, true)
    rom.setUint16(FUNCTIONS + 4 * k, BKPT | k, true)
    rom.setUint16(FUNCTIONS + 4 * k + 2, BX_LR, true)
  })
  const actions = Object.values(functions)
  mcu.onBreak = (k) => {
    if (core.PC < ROM_BYTES && k < actions.length) actions[k]()
  }
  installSerialFlash(mcu, show)
}

/** The flash's answers to bytes that the program sends itself, and its way back to being read. */
function installSerialFlash(mcu, show) {
  const ssi = mcu.peripherals[SSI]
  const pins = mcu.peripherals[IO_QSPI]
  const registers = new Map()
  let sent = null // bytes since chip select fell
  const answers = []
  pins.readUint32 = (offset) => registers.get(offset) ?? 0
  pins.writeUint32 = (offset, value) => {
    registers.set(offset, value)
    if (offset !== SS_CTRL) return
    const low = (value & OVERRIDE) === DRIVEN_LOW
    if (low) sent ??= []
    else sent = null
  }
  const read = ssi.readUint32.bind(ssi)
  const write = ssi.writeUint32.bind(ssi)
  ssi.readUint32 = (offset) => (offset === SSI_DR0 && sent !== null ? (answers.shift() ?? 0) : read(offset))
  ssi.writeUint32 = (offset, value) => {
    if (offset === SSI_SSIENR && value === 1) show() // boot2 is through: flash is memory again
    if (offset !== SSI_DR0 || sent === null) return write(offset, value)
    sent.push(value & 0xff)
    const k = sent.length - 1 - 1 - UNIQUE_ID_DUMMIES
    answers.push(sent[0] === UNIQUE_ID_COMMAND && k >= 0 ? (UNIQUE_ID[k] ?? 0xff) : 0)
  }
}
