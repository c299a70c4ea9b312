// The flash chip as the program sees it: memory behind a slow serial interface. rp2040js reads it for
// nothing. Modelled from the RP2040 data sheet (2.6.3, 4.10), the W25Q16JV's, and pico-sdk issue 1182 for how the cache
// fills: 16 KiB, two ways, lines of 8 bytes of which a miss fetches the half that was asked for.
//
// A miss costs the clocks of the interface's registers, for command, address, waiting and 32 bits of data, times the
// divider. That is 256 cycles for 03h at clk_sys / 4. Reads on four lines are not modelled. For 35h the chip is one of
// those (ISSI IS25LP, Macronix MX25) for which it is no question for a status, but the way into a mode without 03h.

export const SECTOR = 4096
export const PAGE = 256
export const ERASE_NS = 45e6 // of a sector, typical of a W25Q16JV
export const PROGRAM_NS = 0.7e6 // of a page

export const XIP = 0x10000000
const XIP_END = 0x14000000
const NO_ALLOCATE = 1 << 24 // in the address: nothing is kept
const NO_CACHE = 1 << 25 // nothing is looked up
const OFFSET = 0xffffff
const SRAM = 0x20000000
const SETS = 1024
const LINE_BITS = 3

const SSI = 0x18000
const CTRLR0 = 0x00
const SSIENR = 0x08
const BAUDR = 0x14
const SR = 0x28
const DR0 = 0x60
const SPI_CTRLR0 = 0xf4
const SR_TFNF = 2
const SR_TFE = 4
const SR_RFNE = 8
const SERIAL_BYTES = 7 << 16
const IO_QSPI = 0x40018
const IO_QSPI_SS_CTRL = 0x0c
const OUTOVER_LOW = 2 << 8
const OUTOVER = 3 << 8

const READ = 0x03
const ENTER_QPI = 0x35
const READ_UNIQUE_ID = 0x4b
const READ_JEDEC_ID = 0x9f
const UNIQUE_ID_DUMMIES = 4
export const ISSI = 0x9d
const NOTHING = 0xff // a line that nobody drives

/** Two ways of 1024 lines of two words, the less recently used way replaced. */
class Cache {
  constructor() {
    this.tags = new Int32Array(2 * SETS)
    this.halves = new Uint8Array(2 * SETS) // bit 0: the line's first word is here, bit 1: the second
    this.older = new Uint8Array(SETS)
  }

  /** The ROM's function of this name: empties the cache. */
  flush() {
    this.halves.fill(0)
  }

  /** Whether the word at this offset is here; with keep, it is afterwards. */
  look(offset, keep) {
    const set = (offset >>> LINE_BITS) & (SETS - 1)
    const tag = offset >>> (LINE_BITS + 10)
    const half = offset & 4 ? 2 : 1
    for (let way = 0; way < 2; way++) {
      const line = 2 * set + way
      if (this.halves[line] === 0 || this.tags[line] !== tag) continue
      this.older[set] = 1 - way
      const here = (this.halves[line] & half) !== 0
      if (keep) this.halves[line] |= half
      return here
    }
    if (keep) {
      const way = this.older[set]
      this.tags[2 * set + way] = tag
      this.halves[2 * set + way] = half
      this.older[set] = 1 - way
    }
    return false
  }
}

export class Flash {
  /** board: the state that outlives a power cycle. wrong(what): the program did something that fails on the chip. */
  constructor(mcu, board, wrong) {
    this.mcu = mcu
    this.board = board
    this.wrong = wrong
    this.cache = new Cache()
    this.readable = true
    this.missCycles = 0 // boot2's first instructions are in SRAM: it sets up the interface before anything is read
    this.mute = false // the chip takes no serial command any more
    this.registers = { [CTRLR0]: 0, [BAUDR]: 0, [SPI_CTRLR0]: 0 }
    this.answer = []
    this.sent = [] // since chip select went low
    this.#memory()
    this.#interface()
  }

  /**
   * The ROM's function of this name: the interface is serial, a byte a frame and both ways, at clk_sys / 6, and the
   * flash out of any read mode (flash_exit_xip in the boot ROM's published source; data sheet 2.8.3.1.3, 4.10).
   */
  leaveXip() {
    this.registers[BAUDR] = 6
    this.registers[CTRLR0] = SERIAL_BYTES
    this.answer = []
    this.sent = []
    this.readable = false
  }

  #memory() {
    const { mcu } = this
    const { core, sram, sramView } = mcu
    const end = SRAM + sram.length
    // Methods are replaced once and for all: an object runs several times slower after a change of properties.
    const [read32, read16, read8] = [mcu.readUint32.bind(mcu), mcu.readUint16.bind(mcu), mcu.readUint8.bind(mcu)]
    const spend = (address) => {
      if (address < XIP || address >= XIP_END) return
      if (!this.readable) this.wrong('flash read while it is no memory')
      const cached = !(address & NO_CACHE) && this.cache.look(address & OFFSET, !(address & NO_ALLOCATE))
      if (cached) return
      core.owedCycles += this.missCycles
      this.board.counters.misses++
    }
    mcu.readUint16 = (address) => {
      if (address >= SRAM && address + 1 < end) return sramView.getUint16(address - SRAM, true)
      spend(address)
      return read16(address)
    }
    mcu.readUint32 = (address) => {
      const at = address >>> 0
      spend(at)
      if (at < XIP || at >= XIP_END) return read32(at)
      return this.mute ? 0xffffffff : read32(at) ^ this.board.misread(at)
    }
    mcu.readUint8 = (address) => {
      spend(address)
      return read8(address)
    }
  }

  #interface() {
    const ssi = this.mcu.peripherals[SSI]
    const read = ssi.readUint32.bind(ssi)
    const write = ssi.writeUint32.bind(ssi)
    const { registers } = this
    let select = 0
    ssi.readUint32 = (offset) => {
      if (offset === SR) {
        // A program that looks has nothing more to send: the interface's own chip select goes high.
        if ((select & OUTOVER) !== OUTOVER_LOW) this.sent = []
        return SR_TFNF | SR_TFE | (this.answer.length > 0 ? SR_RFNE : 0)
      }
      if (offset === DR0) return this.answer.shift() ?? 0
      return read(offset)
    }
    ssi.writeUint32 = (offset, value) => {
      write(offset, value)
      if (offset in registers) registers[offset] = value
      if (offset === SSIENR) {
        this.answer = []
        this.sent = []
        if (value === 1) this.#setUp()
      }
      if (offset === DR0) this.#send(value, (select & OUTOVER) === OUTOVER_LOW)
    }
    const pins = this.mcu.peripherals[IO_QSPI]
    pins.readUint32 = (offset) => (offset === IO_QSPI_SS_CTRL ? select : 0)
    pins.writeUint32 = (offset, value) => {
      if (offset !== IO_QSPI_SS_CTRL) return
      if ((value & OUTOVER) !== OUTOVER_LOW) this.sent = []
      select = value
    }
  }

  /** Set the kind of reads of the window from now on. */
  #setUp() {
    const control = this.registers[SPI_CTRLR0]
    const instruction = [0, 4, 8, 16][(control >>> 8) & 3]
    const clocks = instruction + 4 * ((control >>> 2) & 15) + ((control >>> 11) & 31) + 32
    this.missCycles = clocks * this.registers[BAUDR]
    this.readable = instruction === 8 && control >>> 24 === READ
  }

  /** selected: chip select is held low, by hand. */
  #send(value, selected) {
    this.sent.push(value)
    this.mute = this.mute || this.sent[0] === ENTER_QPI
    const listens = !this.mute && (this.readable || selected)
    this.answer.push(listens ? this.#byte() : NOTHING)
  }

  #byte() {
    const at = this.sent.length - 2
    if (at < 0) return NOTHING
    const command = this.sent[0] & 0xff
    if (command === READ_UNIQUE_ID && at >= UNIQUE_ID_DUMMIES) return this.board.numberSent(at - UNIQUE_ID_DUMMIES) ?? NOTHING
    if (command === READ_JEDEC_ID) return this.board.flashId[at] ?? NOTHING
    return NOTHING
  }
}
