// The master side of a pty that whoever started this program made: serial programs open the other side.
// Non-blocking calls between two stretches of emulation, so that nothing happens behind the emulator's back.
import fs from 'node:fs'

const READ_BYTES = 4096
const ROOM_BYTES = 4096 // buffer of a host's serial driver while the program does not read

export class Pty {
  constructor(fd) {
    this.fd = fd
    this.up = false // a program has the port open
    this.received = [] // chunks on their way to the board
    this.pending = [] // chunks on their way to the program
    this.pendingBytes = 0
    this.putBytes = 0 // in all
    this.buffer = Buffer.alloc(READ_BYTES)
  }

  get hasRoom() {
    return this.pendingBytes < ROOM_BYTES
  }

  /** Look for bytes and for whether somebody is there; true when something came. */
  poll() {
    if (this.received.length > 0) return false // the board has not taken the last ones yet
    try {
      const bytes = fs.readSync(this.fd, this.buffer)
      this.received.push(Buffer.from(this.buffer.subarray(0, bytes)))
      this.up = true
      return true
    } catch (error) {
      if (error.code !== 'EAGAIN' && error.code !== 'EIO') throw error
      this.up = error.code === 'EAGAIN' // EIO: nobody has the other side open, which is our DTR
      if (!this.up) this.#forget() // a new program must not get the old one's tail
      return false
    }
  }

  /** Up to n of the bytes that came, or null. */
  take(n) {
    if (this.received.length === 0) return null
    const chunk = this.received[0]
    if (chunk.length <= n) return this.received.shift()
    this.received[0] = chunk.subarray(n)
    return chunk.subarray(0, n)
  }

  put(bytes) {
    this.pending.push(bytes)
    this.pendingBytes += bytes.length
    this.putBytes += bytes.length
  }

  flush() {
    if (this.pending.length === 0) return
    const all = Buffer.concat(this.pending)
    let written = 0
    try {
      written = fs.writeSync(this.fd, all)
    } catch (error) {
      if (error.code === 'EIO') return this.#forget()
      if (error.code !== 'EAGAIN') throw error
    }
    this.pending = written < all.length ? [all.subarray(written)] : []
    this.pendingBytes = all.length - written
  }

  #forget() {
    this.pending = []
    this.pendingBytes = 0
  }
}
