// Our model of the boot ROM's UF2 loader: the flash after a file was copied onto the drive. From
// the RP2040 data sheet (2.8.4) and the boot ROM's published source; neither the drive nor the USB are modelled.
import { ERASE_NS, PAGE, PROGRAM_NS, SECTOR, XIP } from './flash.mjs'

const BLOCK = 512
const MAGIC = [0x0a324655, 0x9e5d5157, 0x0ab16f30]
const FLAG_FAMILY = 0x2000
const FLAG_NOT_FLASH = 1

export class Loader {
  /** flash: the chip's bytes, changed through board, which counts them and cuts power. onDone(): the chip restarts. */
  constructor({ clock, flash, chip, board, onDone, onCut }) {
    this.flash = flash
    this.family = chip.family
    this.flashEnd = XIP + chip.flashBytes
    this.board = board
    this.onDone = onDone
    this.onCut = onCut
    this.waiting = [] // blocks of files that were copied
    this.ignored = 0
    this.#begin(0)
    this.clock = clock.createAlarm(() => this.#next())
  }

  counters() {
    return { blocks: this.seen.size, of: this.blocks, waiting: this.waiting.length, ignored: this.ignored }
  }

  /** A file is copied onto the drive: the 512-byte sectors come in the file's order. */
  copy(file) {
    for (let at = 0; at + BLOCK <= file.length; at += BLOCK) this.waiting.push(file.subarray(at, at + BLOCK))
    this.clock.schedule(0)
  }

  #begin(blocks) {
    this.blocks = blocks // of the file under way, as the file states
    this.seen = new Set()
    this.erased = new Set()
  }

  #next() {
    const bytes = this.waiting.shift()
    if (bytes === undefined) return
    const nanos = this.#take(bytes)
    if (nanos === null) return
    if (this.blocks > 0 && this.seen.size === this.blocks) return this.onDone()
    this.clock.schedule(nanos)
  }

  /** One block; returns how long the flash was busy with it, or null when power failed. */
  #take(bytes) {
    const [first, second, flags, address, size, number, blocks, family] = new Uint32Array(
      bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + 32),
    )
    const whole = first === MAGIC[0] && second === MAGIC[1] && bytes.readUInt32LE(BLOCK - 4) === MAGIC[2]
    const ours = !!(flags & FLAG_FAMILY) && family === this.family && !(flags & FLAG_NOT_FLASH) && size === PAGE
    if (!whole || !ours) {
      this.ignored++
      return 0
    }
    const inFlash = address >= XIP && address + PAGE <= this.flashEnd && address % PAGE === 0
    if (!inFlash || number >= blocks) {
      this.ignored++
      this.#begin(0) // drop the blocks until now
      return 0
    }
    if (blocks !== this.blocks) this.#begin(blocks)
    if (this.seen.has(number)) return 0
    this.seen.add(number)
    return this.#write(address - XIP, number, bytes.subarray(32, 32 + PAGE))
  }

  #write(at, number, page) {
    const { board, flash } = this
    let nanos = PROGRAM_NS
    // RP2040-E14: which sectors are erased already is kept by block number, sixteen a sector, not by address.
    const group = Math.floor((number * PAGE) / SECTOR)
    if (!this.erased.has(group)) {
      this.erased.add(group)
      board.counters.erases++
      nanos += ERASE_NS
      if (!board.change(flash, at - (at % SECTOR), SECTOR, () => 0xff)) return this.#cut()
    }
    board.counters.programs++
    if (!board.change(flash, at, PAGE, (k) => flash[at + k] & page[k])) return this.#cut()
    return nanos
  }

  #cut() {
    this.onCut()
    return null
  }
}
