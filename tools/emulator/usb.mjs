// The host at the other end of the USB cable: it enumerates a CDC-ACM device as Linux does, opens and closes the
// port, and reads only when asked to, so that the device feels back-pressure.
import { UsbBus } from './bus.mjs'

const IN = 0x80
const GET_DESCRIPTOR = 6
const DEVICE = 1
const CONFIGURATION = 2
const STRING = 3
const SET_ADDRESS = 5
const SET_CONFIGURATION = 9
const SET_LINE_CODING = 0x20
const SET_CONTROL_LINE_STATE = 0x22
const TO_INTERFACE = 0x21 // class request
const DTR = 1
const RTS = 2
const BULK = 2
const ENDPOINT_DESCRIPTOR = 5
const ADDRESS = 5
const MAX_POWER = 8 // of a configuration, in 2 mA
const PACKET = 64
const PULLUP = 1 << 16 // of SIE_CTRL
const CONTROLLER_ON = 1 // of MAIN_CTRL
const BUS_RESET = 1 << 19 // of SIE_STATUS
const CONNECTED = 1 << 16
const SUSPENDED = 1 << 4
const RESUMED = 1 << 11
const MS = 1e6
const VBUS_SENSE = 24 // the Pico's pin
const PULLUP_GONE_NS = 20 * MS // a board that can sense VBUS has let D+ go by then
const DEBOUNCE_NS = 10 * MS // a real host waits ten times as long before it resets and after
const SUSPEND_NS = 3 * MS
const TOKEN_NS = 3000 // behind the acknowledged SETUP: 3 bytes, sync and gap, at 12 Mbit/s
const ANSWER_NS = 500 * MS // a control transfer that takes longer has failed

const u16 = (value) => [value & 0xff, value >> 8]

export class UsbHost {
  /** onData(bytes) gets the device's bytes; canTake(): there is room for more. */
  constructor(mcu, board, { onData, canTake, take, time }) {
    this.bus = new UsbBus(mcu, board)
    this.mcu = mcu
    if (time) {
      this.bus.held = () => time.held
      time.onRelease.push(() => this.bus.goOn())
    }
    this.drivenUnpowered = 0 // D+ was up, into a host that gives no power
    this.usb = mcu.usbCtrl
    this.onData = onData
    this.canTake = canTake
    this.take = take // take(n): up to n bytes to send, or null
    this.open = false // the port, by some program
    this.plugged = true
    this.pulledUp = false // by the program, which so says that it is there
    this.asleep = false
    this.state = 'detached'
    this.device = {} // from enumeration
    this.transfers = [] // control transfers to do
    this.failed = []
    this.timer = mcu.clock.createAlarm(() => this.later())
    this.deadline = mcu.clock.createAlarm(() => this.#fail('was not answered'))
    this.later = () => {}
    this.bus.onArmed = this.bus.onSetupSeen = () => this.poke()
    this.bus.onReset = () => this.#lose()
    this.corrupting = null // bulk or control: the next handshake to the device
    this.waking = mcu.clock.createAlarm(() => this.setAsleep(false))
    this.hurried = { asked: 0, wrong: 0 } // requests that came before the one before was answered
    this.second = mcu.clock.createAlarm(() => this.#secondSetup())
    this.#watchPullup()
  }

  #enter(state) {
    this.state = state
    this.bus.sendFrames(!this.asleep && state !== 'detached' && state !== 'reset')
  }

  /** Some program opens or closes the port: DTR follows. */
  setOpen(open) {
    if (open === this.open) return
    this.open = open
    if (this.state === 'configured') this.#tellLines()
  }

  /** Some program opens the port at this rate and closes it again. */
  touch(rate) {
    this.#setRate(rate)
    this.request(TO_INTERFACE, SET_CONTROL_LINE_STATE, DTR | RTS, 0, [])
    this.request(TO_INTERFACE, SET_CONTROL_LINE_STATE, 0, 0, [])
  }

  /** Some program closes and opens the port, so often, as fast as it can. */
  flap(times) {
    for (let k = 0; k < times; k++) {
      this.request(TO_INTERFACE, SET_CONTROL_LINE_STATE, 0, 0, [])
      this.request(TO_INTERFACE, SET_CONTROL_LINE_STATE, DTR | RTS, 0, [])
    }
  }

  /** A SETUP, and so many ns later another one, which is the one to be answered (USB 2.0, 8.4.6.4). */
  hurry(nanos) {
    const abandoned = Uint8Array.from([IN, GET_DESCRIPTOR, 0, CONFIGURATION, 0, 0, 255, 0])
    this.request(IN, GET_DESCRIPTOR, DEVICE << 8, 0, 18, (data) => {
      this.hurried.asked++
      if (data === null || data.length !== 18 || data[0] !== 18 || data[1] !== DEVICE) this.hurried.wrong++
    })
    Object.assign(this.transfers.at(-1), { abandoned, nanos })
  }

  /** Pull the cable, in whatever the wire was doing; true puts it back. */
  setPlugged(plugged) {
    if (plugged === this.plugged) return
    this.plugged = plugged
    this.mcu.gpio[VBUS_SENSE].setInputValue(plugged)
    if (plugged) {
      if (this.#isUp) this.#attach()
      return
    }
    this.bus.abort()
    this.#lose()
    this.usb.sieStatus &= ~CONNECTED
    this.#after(SUSPEND_NS, () => {
      this.usb.sieStatus |= SUSPENDED
      this.usb.sieStatusUpdated()
      this.#after(PULLUP_GONE_NS, () => (this.drivenUnpowered += this.#isUp && !this.plugged ? 1 : 0)) // or it is back
    })
  }

  /** Put the bus to sleep, the cable in and the device configured, as a laptop's lid does; false wakes it. */
  setAsleep(asleep) {
    if (asleep === this.asleep) return
    this.asleep = asleep
    this.#enter(this.state)
    if (asleep) this.bus.abort()
    this.usb.sieStatus = asleep ? this.usb.sieStatus | SUSPENDED : (this.usb.sieStatus & ~SUSPENDED) | RESUMED
    this.usb.sieStatusUpdated()
    this.poke()
  }

  nap(ms) {
    this.setAsleep(true)
    this.waking.schedule(ms * MS)
  }

  #corrupts(kind) {
    if (this.corrupting !== kind) return false
    this.corrupting = null
    this.bus.hang()
    return true
  }

  /** The device is gone. */
  #lose() {
    this.deadline.cancel()
    this.second.cancel()
    this.timer.cancel()
    this.transfers = []
    this.#enter('detached')
    this.pulledUp = false
  }

  /** Start the next transaction, if there is one to do and the wire is free. */
  poke() {
    if (this.asleep || this.bus.busy || this.state === 'detached' || this.state === 'reset') return
    if (this.transfers.length > 0) return this.#control(this.transfers[0])
    if (this.state === 'configured' && this.device.in) this.#bulk()
  }

  #bulk() {
    const { bus, device } = this
    if (bus.armed(device.out, true)) {
      const bytes = this.take(Math.min(PACKET, bus.length(device.out, true)))
      if (bytes !== null) {
        return bus.transact(bytes.length, () => {
          bus.putOut(device.out, bytes)
          this.poke()
        })
      }
    }
    if (this.open && bus.armed(device.in, false) && this.canTake()) {
      const packet = bus.beginIn(device.in)
      bus.transact(packet.data.length, () => {
        if (this.#corrupts('bulk')) return
        const data = bus.takeIn(device.in, packet)
        if (data !== null && data.length > 0) this.onData(data)
        this.poke()
      })
    }
  }

  // ---- control transfers ---------------------------------------------------------------------------

  /** Queue one; then(data) gets an IN transfer's data, or null when the device refused. */
  request(type, request, value, index, dataOrLength, then = () => {}) {
    const data = type & IN ? null : Uint8Array.from(dataOrLength)
    const length = data === null ? dataOrLength : data.length
    const packet = [type, request, ...u16(value), ...u16(index), ...u16(length)]
    this.transfers.push({ packet, data, length, got: [], sent: 0, then, stage: 'setup' })
    this.poke()
  }

  #control(t) {
    const { bus } = this
    if (t.stage === 'between') return
    if (t.stage === 'setup') {
      this.deadline.schedule(ANSWER_NS)
      // Clear of the interrupt at a frame's start, which without a hold-off may take the time that there is.
      if (t.abandoned && bus.inFrame > 0.8 * MS) return this.#after(0.3 * MS, () => this.poke())
      return bus.transact(8, () => {
        if (t.abandoned) {
          bus.setup(t.abandoned)
          t.stage = 'between'
          return this.second.schedule(t.nanos)
        }
        bus.setup(Uint8Array.from(t.packet))
        t.stage = t.length > 0 ? 'data' : 'status'
        this.poke()
      })
    }
    const toDevice = (t.stage === 'data') === (t.data !== null)
    // The status stage runs against the data; without data it comes from the device.
    const out = t.stage === 'status' && t.length === 0 ? false : toDevice
    if (bus.stalled(0, out)) return this.#fail('was refused')
    if (!bus.armed(0, out)) return
    const packet = out ? { data: this.#nextOut(t) } : bus.beginIn(0)
    bus.transact(packet.data.length, () => {
      if (!out && this.#corrupts('control')) return
      if (out) bus.putOut(0, packet.data)
      else this.#gotIn(t, bus.takeIn(0, packet))
      this.#nextStage(t, out)
      this.poke()
    })
  }

  #secondSetup() {
    const t = this.transfers[0]
    this.bus.setup(Uint8Array.from(t.packet))
    this.#after(TOKEN_NS, () => {
      t.stage = 'data'
      this.poke()
    })
  }

  #nextOut(t) {
    if (t.stage === 'status') return new Uint8Array(0)
    return t.data.slice(t.sent, t.sent + PACKET)
  }

  #gotIn(t, data) {
    t.short = data !== null && data.length < PACKET
    if (t.stage === 'data' && data !== null) t.got.push(...data)
  }

  #nextStage(t, out) {
    if (t.stage === 'status') {
      this.deadline.cancel()
      this.transfers.shift()
      t.then(Uint8Array.from(t.got))
      return
    }
    if (out) t.sent += PACKET
    const over = out ? t.sent >= t.length : t.short || t.got.length >= t.length
    if (!over) return
    t.stage = 'status'
    this.bus.setToggle(0, !out, 1)
  }

  #fail(how) {
    this.deadline.cancel()
    const t = this.transfers.shift()
    this.failed.push(`request ${t.packet.map((b) => b.toString(16).padStart(2, '0')).join(' ')} ${how}`)
    t.then(null)
    this.poke()
  }

  // ---- attach and enumerate --------------------------------------------------------------------------

  #after(nanos, then) {
    this.later = then
    this.timer.schedule(nanos)
  }

  get #isUp() {
    return !!(this.usb.sieCtrl & PULLUP) && !!(this.usb.mainCtrl & CONTROLLER_ON)
  }

  #watchPullup() {
    const { usb } = this
    this.mcu.gpio[VBUS_SENSE].setInputValue(true)
    const write = usb.writeUint32.bind(usb)
    usb.writeUint32 = (offset, value) => {
      write(offset, value)
      const up = this.#isUp
      if (up && !this.pulledUp) this.#attach()
      this.pulledUp = up
    }
    usb.onUSBEnabled = undefined
    usb.onResetReceived = () => {
      if (this.state === 'reset') this.#after(DEBOUNCE_NS, () => this.#enumerate())
    }
  }

  #attach() {
    if (!this.plugged) return
    this.#enter('reset')
    this.device = {}
    this.#after(DEBOUNCE_NS, () => {
      this.usb.sieStatus &= ~SUSPENDED
      this.usb.sieStatus |= BUS_RESET | CONNECTED
      this.usb.sieStatusUpdated()
    })
  }

  #enumerate() {
    this.#enter('addressing')
    this.#descriptor(DEVICE, 0, 18, () =>
      this.request(0, SET_ADDRESS, ADDRESS, 0, [], () =>
        this.#descriptor(DEVICE, 0, 18, (device) =>
          this.#descriptor(CONFIGURATION, 0, 9, (head) => {
            if (device === null || head === null) return
            const length = head[2] | (head[3] << 8)
            this.#descriptor(CONFIGURATION, 0, length, (all) => this.#configure(device, all))
          }),
        ),
      ),
    )
  }

  #descriptor(kind, index, length, then) {
    this.request(IN, GET_DESCRIPTOR, (kind << 8) | index, kind === STRING ? 0x409 : 0, length, then)
  }

  #configure(device, all) {
    if (all === null || 2 * all[MAX_POWER] > this.bus.board.hubMilliamps) return
    const word = (at) => device[at] | (device[at + 1] << 8)
    this.device = { vendor: word(8), product: word(10), release: word(12), address: this.usb.addrEndp & 0x7f }
    this.device.class = [...device.slice(4, 7)]
    for (let at = 0; at < all.length && all[at] > 0; at += all[at]) {
      if (all[at + 1] !== ENDPOINT_DESCRIPTOR || (all[at + 3] & 3) !== BULK) continue
      this.device[all[at + 2] & IN ? 'in' : 'out'] = all[at + 2] & 15
    }
    const names = { manufacturer: device[14], name: device[15], serial: device[16] }
    for (const [key, index] of Object.entries(names)) {
      if (index === 0) continue
      this.#descriptor(STRING, index, 255, (text) => {
        if (text !== null) this.device[key] = Buffer.from(text.subarray(2, text[0])).toString('utf16le')
      })
    }
    this.request(0, SET_CONFIGURATION, all[5], 0, [], () => {
      this.bus.setToggle(this.device.in, false, 0)
      this.bus.setToggle(this.device.out, true, 0)
      this.#enter('configured')
      this.#tellLines()
    })
  }

  #tellLines() {
    if (this.open) this.#setRate(115200)
    this.request(TO_INTERFACE, SET_CONTROL_LINE_STATE, this.open ? DTR | RTS : 0, 0, [])
  }

  #setRate(rate) {
    this.request(TO_INTERFACE, SET_LINE_CODING, 0, 0, [...u16(rate & 0xffff), ...u16(rate >>> 16), 0, 0, 8])
  }
}
