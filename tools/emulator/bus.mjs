// The USB wire: one transaction at a time, at full speed, to the endpoint buffers of the chip's controller.
//
// rp2040js answers buffers as soon as they are armed, storms OUT endpoints with empty packets and knows no NAK.
// This takes over DPRAMUpdated: a buffer stays with the controller until the host's token has come for it. Errors
// on silicon are counted: wrong data toggles, AVAILABLE written together with the rest of the word.
import { onReset } from './faults.mjs'

const AVAILABLE = 1 << 10
const STALL = 1 << 11
const DATA1 = 1 << 13
const FULL = 1 << 15
const LENGTH = 0x3ff
const CONTROLS = 0x80 // of buffers: 8 bytes an endpoint, IN before OUT
const CONTROLS_END = 0x100
const EP0_BUFFER = 0x100
const ENDPOINT_ENABLE = 1 << 31
const DOUBLE_BUFFER = 1 << 30
const INTERRUPT_PER_BUFFER = 1 << 29
const EP0_INT_1BUF = 1 << 29 // of SIE_CTRL
const SIE_STATUS = 0x50
const DATA_SEQ_ERROR = 1 << 31
const SETUP_REC = 1 << 17
const SUSPENDED = 1 << 4
const SOF_RD = 0x48
const INTE = 0x90
const INT_SUSPEND = 1 << 14
const INT_SOF = 1 << 17
const LINE_J = 1 << 2 // of SIE_STATUS: the lines, D+ up
const LINE_K = 2 << 2
const AT_REST_FRAMES = 3 // on hold, without a transaction: nothing more comes of them
const E15_NS = 800_000 // RP2040-E15: a bulk IN that is armed this late in a frame
const OVERHEAD_BYTES = 13 // token, handshake, sync, CRC, gaps: leaves 19 bulk packets of 64 bytes a frame
const BITS_PER_S = 12e6

export class UsbBus {
  constructor(mcu, board) {
    this.mcu = mcu
    this.board = board
    this.usb = mcu.usbCtrl
    this.view = mcu.usbDPRAMView
    this.toggles = new Map() // of the host's next packet: endpoint*2 + out -> 0 or 1
    this.written = new Map()
    this.counters = { toggle_errors: 0, available_not_last: 0, hangs: 0, resets: 0, armed: 0, armed_late: 0, latest_armed_us: 0 }
    this.lateHangs = 0 // chance that RP2040-E15 strikes when one is armed late
    this.holdsOff = true
    this.hungAsleep = false // a hung controller says that the bus is suspended
    this.draw = Math.random
    this.onArmed = () => {}
    this.onSetupSeen = () => {}
    this.onReset = () => {}
    this.hungAt = null // ns: the controller has met RP2040-E15, and hears nothing until the block is reset
    this.silentAt = 0 // ns: since when the host has sent no frames; null: it does
    this.idleFrames = 0
    this.held = () => false
    this.frames = mcu.clock.createAlarm(() => this.#frame())
    this.wire = mcu.clock.createAlarm(() => {
      const finish = this.finish
      this.finish = null
      finish()
    })
    this.finish = null
    this.usb.DPRAMUpdated = (offset, value) => this.#written(offset, value)
    this.#correctRegisters()
  }

  get busy() {
    return this.finish !== null
  }

  /** The host sends a start of frame every ms, or none. */
  sendFrames(sends) {
    if (sends === (this.silentAt === null)) return
    this.silentAt = sends ? null : this.mcu.clock.nanos
    this.goOn()
  }

  /** Frames may matter again. */
  goOn() {
    this.idleFrames = 0
    this.frames.cancel()
    if (this.silentAt === null && this.usb.intEnable & INT_SOF) this.frames.schedule(this.board.frameNanos - this.inFrame)
  }

  get inFrame() {
    return this.mcu.clock.nanos % this.board.frameNanos
  }

  #frame() {
    if (!this.hung && !this.#isLost(Math.round(this.mcu.clock.nanos / this.board.frameNanos))) {
      this.usb.intRaw |= INT_SOF
      this.usb.checkInterrupts()
    }
    const idle = ++this.idleFrames
    if (this.held() && idle >= AT_REST_FRAMES) return
    this.goOn()
    this.idleFrames = idle
  }

  /** The interrupt of a change to suspended: late, which is that it is not so any more, or out of nothing. */
  tellSuspended(late) {
    if (late) {
      this.usb.sieStatus |= SUSPENDED
      this.usb.sieStatusUpdated()
    } else {
      this.usb.intRaw |= INT_SUSPEND
      this.usb.checkInterrupts()
    }
  }

  /** Run `then` after so many bytes have crossed the wire. */
  transact(bytes, then) {
    this.goOn()
    this.finish = then
    const bits = (bytes + OVERHEAD_BYTES) * 8
    this.wire.schedule(Math.ceil((bits / BITS_PER_S) * 125e6) * 8) // whole cycles of 8 ns
  }

  abort() {
    this.wire.cancel()
    this.finish = null
  }

  get hung() {
    return this.hungAt !== null
  }

  /** Bus errors in an IN transfer, a corrupt handshake among them, can stop the controller (RP2040-E15). */
  hang() {
    this.hungAt = this.mcu.clock.nanos
    this.counters.hangs++
    if (this.hungAsleep) this.tellSuspended(true)
  }

  control(endpoint, out) {
    return this.view.getUint32(CONTROLS + endpoint * 8 + (out ? 4 : 0), true)
  }

  armed(endpoint, out) {
    // Judged, not documented: endpoint 0 says NAK until the program has seen the SETUP. Without holdsOff it does not,
    // and a buffer armed before answers a host that asks before the program has disarmed it.
    if (this.hung || (endpoint === 0 && this.holdsOff && this.usb.sieStatus & SETUP_REC)) return false
    return !!(this.control(endpoint, out) & AVAILABLE) && (endpoint === 0 || this.#enabled(endpoint, out))
  }

  stalled(endpoint, out) {
    if (this.hung) return false
    const armed = endpoint !== 0 || this.usb.epStallArm & (out ? 2 : 1)
    return !!(this.control(endpoint, out) & STALL) && !!armed
  }

  length(endpoint, out) {
    return this.control(endpoint, out) & LENGTH
  }

  setToggle(endpoint, out, value) {
    this.toggles.set(endpoint * 2 + (out ? 1 : 0), value)
  }

  setup(packet) {
    if (this.hung) return
    this.mcu.usbDPRAM.set(packet)
    this.usb.epStallArm &= ~3
    this.setToggle(0, false, 1)
    this.setToggle(0, true, 1)
    this.usb.sieStatus |= SETUP_REC
    this.usb.sieStatusUpdated()
  }

  /** An armed IN buffer's content as the host's token comes: that is sent, not later writes. */
  beginIn(endpoint) {
    const control = this.control(endpoint, false)
    const at = this.#buffer(endpoint, false)
    return { control, data: this.mcu.usbDPRAM.slice(at, at + (control & LENGTH)) }
  }

  /** The host has it; null for a toggle of one that it had already. */
  takeIn(endpoint, { control, data }) {
    const fresh = this.#toggled(endpoint, false, control)
    this.#done(endpoint, false, control & ~(AVAILABLE | FULL))
    return fresh ? data : null
  }

  /** Fill an armed OUT buffer. */
  putOut(endpoint, data) {
    const control = this.control(endpoint, true)
    if (!this.#toggled(endpoint, true, control)) {
      this.usb.sieStatus |= DATA_SEQ_ERROR // the controller drops it; the buffer stays armed
      this.usb.sieStatusUpdated()
      return
    }
    this.mcu.usbDPRAM.set(data, this.#buffer(endpoint, true))
    this.#done(endpoint, true, (control & ~(AVAILABLE | LENGTH)) | FULL | data.length)
  }

  #toggled(endpoint, out, control) {
    const key = endpoint * 2 + (out ? 1 : 0)
    const expected = this.toggles.get(key) ?? 0
    const right = (control & DATA1 ? 1 : 0) === expected
    if (right) this.toggles.set(key, expected ^ 1)
    else this.counters.toggle_errors++
    return right
  }

  #done(endpoint, out, control) {
    const at = CONTROLS + endpoint * 8 + (out ? 4 : 0)
    this.view.setUint32(at, control, true)
    this.written.set(at, control >>> 0)
    const told = endpoint === 0 ? this.usb.sieCtrl & EP0_INT_1BUF : this.#endpoint(endpoint, out) & INTERRUPT_PER_BUFFER
    if (told) this.usb.indicateBufferReady(endpoint, out)
  }

  #endpoint(endpoint, out) {
    return this.usb.readEndpointControlReg(endpoint, out)
  }

  #enabled(endpoint, out) {
    const control = this.#endpoint(endpoint, out)
    if (control & DOUBLE_BUFFER) throw new Error(`endpoint ${endpoint} is double-buffered, which this emulator does not support`)
    return !!(control & ENDPOINT_ENABLE)
  }

  #buffer(endpoint, out) {
    return endpoint === 0 ? EP0_BUFFER : this.#endpoint(endpoint, out) & 0xffc0
  }

  #written(offset, value) {
    if (offset < CONTROLS || offset >= CONTROLS_END) return
    const before = this.written.get(offset) ?? 0
    this.written.set(offset, value >>> 0)
    if (!(value & AVAILABLE)) {
      if (value & STALL) this.onArmed()
      return
    }
    if ((before & ~AVAILABLE) !== (value & ~AVAILABLE)) this.counters.available_not_last++
    const isBulkIn = offset >= CONTROLS + 8 && offset % 8 === 0
    if (isBulkIn && this.silentAt === null && !this.held()) {
      this.counters.armed++
      this.counters.latest_armed_us = Math.max(this.counters.latest_armed_us, this.inFrame / 1000)
      this.counters.armed_late += this.inFrame >= E15_NS ? 1 : 0
      if (this.inFrame >= E15_NS && this.draw() < this.lateHangs) this.hang()
    }
    this.goOn()
    this.onArmed()
  }

  #resetBlock() {
    const { usb } = this
    this.abort()
    this.counters.resets++
    this.hungAt = null
    usb.mainCtrl = usb.sieCtrl = usb.sieStatus = usb.buffStatus = usb.intEnable = usb.addrEndp = usb.epStallArm = 0
    usb.intRaw = 0
    usb.checkInterrupts()
    this.onReset()
  }

  #correctRegisters() {
    const { usb } = this
    onReset(this.mcu, 'usb', () => this.#resetBlock())
    const write = usb.writeUint32.bind(usb)
    const read = usb.readUint32.bind(usb)
    usb.writeUint32 = (offset, value) => {
      // SUSPENDED is cleared by writing it, which rp2040js leaves out.
      if (offset === SIE_STATUS && usb.rawWriteValue & SUSPENDED) usb.sieStatus &= ~SUSPENDED
      const seen = offset === SIE_STATUS && usb.rawWriteValue & usb.sieStatus & SETUP_REC
      write(offset, value)
      if (seen) this.onSetupSeen()
      if (offset === INTE) this.goOn()
    }
    usb.readUint32 = (offset) => {
      if (offset === SIE_STATUS) {
        // A host that goes on talking to a hung controller moves the lines.
        const moves = this.hung && this.silentAt === null && this.draw() < 0.1
        return read(offset) | (moves ? LINE_K : LINE_J)
      }
      if (offset !== SOF_RD) return read(offset)
      usb.intRaw &= ~INT_SOF
      usb.checkInterrupts()
      return this.#number
    }
  }

  /** The number of the latest frame begun: a device reads it. */
  get #number() {
    const frame = Math.floor((this.hungAt ?? this.silentAt ?? this.mcu.clock.nanos) / this.board.frameNanos)
    return (this.#isLost(frame) ? frame - 1 : frame) & 0x7ff
  }

  #isLost(frame) {
    return frame % this.board.lostFrames === 1
  }
}
