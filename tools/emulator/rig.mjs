// The whole rig: a machine, its sensors, the USB host and the port, and a test's verbs.
import fs from 'node:fs'

import { Latency } from './latency.mjs'
import { Loader } from './loader.mjs'
import { Machine } from './machine.mjs'
import { Board } from './rom.mjs'
import { SlotTiming } from './timing.mjs'
import { Uart } from './uart.mjs'
import { UsbHost } from './usb.mjs'
import { Vcd } from './vcd.mjs'

export class Rig {
  /** port, uartPort: a Pty or something like it; no uartPort: nothing on either UART's pins. hold: device time stands
   * still from the first sample on until release(). */
  constructor({ image, chip, sensors, port, uartPort, hold, lossless }) {
    this.port = port
    this.uartPort = uartPort
    this.readsFrom = 0 // world ns: the host reads
    this.plugged = true
    this.waiting = hold // for release()
    this.latency = new Latency()
    this.timing = new SlotTiming()
    this.events = [] // [world ns, verb], sorted
    this.sensors = sensors
    this.lossless = lossless
    this.board = new Board(chip)
    this.loaders = 0 // starts of the UF2 loader
    this.loader = null // while it is there
    this.images = 0 // that the loader has taken whole
    this.vcd = null // a logic analyser's recording, once asked for
    this.machine = new Machine(image, (machine) => this.#attach(machine), chip)
  }

  /** Device time stands still, and the board has done all that can be done meanwhile. */
  get still() {
    return this.machine.time.held && this.machine.quiet && !this.usb.bus.busy && !this.uarts.some((one) => one.busy)
  }

  /** Run for so long in emulated time, less when everything stands still. */
  run(nanos) {
    this.usb.setOpen(this.port.up)
    this.usb.poke()
    for (const one of this.uarts) one.poke()
    const end = this.machine.nanos + nanos
    while (this.machine.nanos < end) {
      const world = this.machine.worldNanos
      while (this.events.length > 0 && this.events[0][0] <= world) this.act(this.events.shift()[1])
      const stands = this.sensors.standsAt ?? Infinity
      if (world >= stands) this.machine.time.hold() // the next round has not come
      const next = this.machine.time.held ? Infinity : Math.min(stands, this.events[0]?.[0] ?? Infinity) - world
      this.machine.runUntil(Math.min(end, this.machine.nanos + next))
      if (this.powerFailed) {
        this.powerFailed = false
        this.act('cut power')
      }
      if (this.still) break
    }
    this.vcd?.flush(this.still ? Infinity : this.machine.worldNanos)
  }

  release() {
    this.waiting = false
    this.machine.time.release()
  }

  /** The next round came. */
  goOn() {
    if (!this.waiting && this.machine.worldNanos < (this.sensors.standsAt ?? Infinity)) this.machine.time.release()
  }

  /** Have a verb done at a time of the world; seconds since the first power-up. */
  plan(seconds, verb) {
    this.events.push([Math.round(seconds * 1e9), verb])
    this.events.sort((a, b) => a[0] - b[0])
  }

  /** Throws an Error for a verb that there is not. */
  act(verb) {
    const verbs = {
      'stop reading for (\\d+) ms': (ms) => (this.readsFrom = this.machine.worldNanos + ms * 1e6),
      // A main loop that nothing wakes any more: the watchdog's business.
      'lose interrupts': () => (this.machine.mcu.core.enabledInterrupts = 0),
      'touch at 1200 baud': () => this.usb.touch(1200),
      'stretch a word': () => (this.sensors.stretched = true),
      'pace the DMA ([0-9.]+) times as slowly': (times) => (this.board.dmaSlowness = Number(times)),
      'corrupt a (bulk|control) handshake': (kind) => (this.usb.corrupting = kind),
      'wear the flash out': () => Object.assign(this.board, { eraseNanos: 400e6, programNanos: 3e6 }), // data sheet
      'erase in (\\d+) ms': (ms) => (this.board.eraseNanos = Number(ms) * 1e6),
      'flash chip (\\w{6})': (id) => (this.board.flashId = [...Buffer.from(id, 'hex')]),
      'chip revision (\\d)': (n) => (this.board.revision = Number(n)),
      'hub gives (\\d+) mA': (ma) => (this.board.hubMilliamps = Number(ma)),
      'supply at (\\d+) mV': (mv) => (this.board.supplyMv = Number(mv)),
      'clock ([0-9.]+) times as fast': (times) => (this.board.frameNanos = Math.round(1e6 * Number(times))),
      'lose a start of frame in (\\d+)': (n) => (this.board.lostFrames = Number(n)),
      'hang ([0-9.]+) of late armings': (share) => (this.usb.bus.lateHangs = Number(share)),
      'hang as if asleep': () => (this.usb.bus.hungAsleep = true),
      'tell of a suspend (late|falsely)': (how) => this.usb.bus.tellSuspended(how === 'late'),
      'open and close (\\d+) times': (times) => this.usb.flap(Number(times)),
      'flip a written bit': () => (this.machine.mcu.flash[this.board.writtenAt + 40] ^= 1),
      'misread the image in (\\d+) starts': (n) => (this.board.misreads = Number(n)),
      'fault before main in (\\d+) starts': (n) => (this.board.faultyStarts = Number(n)),
      unplug: () => this.#cable(false),
      plug: () => this.#cable(true),
      suspend: () => this.usb.setAsleep(true),
      resume: () => this.usb.setAsleep(false),
      'sleep for (\\d+) ms while it erases': (ms) => (this.board.atErase = () => this.usb.nap(Number(ms))),
      'answer setups with what is armed': () => (this.usb.bus.holdsOff = false),
      'cut power': () => {
        this.sensors.powerCycle()
        this.machine.powerCycle()
      },
      'cut power after (\\d+) flash bytes': (bytes) => (this.board.cutAfter = Number(bytes)),
      'two setups (\\d+)': (nanos) => this.usb.hurry(Number(nanos)), // so far apart
      'slow the core ([0-9.]+) times': (times) => (this.machine.slowness = Number(times)),
      'write vcd (.+)': (file) => {
        this.vcd = new Vcd(file)
        this.#analyse()
      },
      'late bits above ([0-9.]+) MHz': (mhz) => (this.sensors.lateAboveHz = Number(mhz) * 1e6),
      'finger (\\d) feels ([0-9.]+) of (\\w+)': (finger, share, channel) => this.sensors.weaken(Number(finger), channel, Number(share)),
      'lead (\\w+) to (\\w+)': (name, end) => this.sensors.connect(name, end === 'nothing' ? null : end),
      'write uf2 (.+)': (file) => {
        if (this.loader === null) throw new Error('no drive to write a UF2 to: the board is not in its loader')
        this.loader.copy(fs.readFileSync(file))
      },
    }
    for (const [words, run] of Object.entries(verbs)) {
      const said = new RegExp(`^${words}$`).exec(verb)
      if (said === null) continue
      run(...said.slice(1))
      return this.usb.poke()
    }
    throw new Error(`no verb ${verb}: expected one of ${Object.keys(verbs).join(', ')}`)
  }

  counters() {
    const { machine, usb } = this
    return {
      emulated_s: machine.nanos / 1e9,
      boots: machine.boots,
      watchdog_resets: machine.watchdogResets,
      instructions: machine.instructions,
      slept: machine.sleptNanos / Math.max(1, machine.nanos),
      loaders: this.loaders,
      images: this.images,
      loader: this.loader === null ? null : this.loader.counters(),
      flash: this.board.counters,
      latency: this.latency.counters(),
      timing: this.timing.counters(),
      sensors: this.sensors.counters(),
      usb: {
        state: usb.state,
        device: usb.device,
        failed: usb.failed,
        hurried: usb.hurried,
        driven_unpowered: usb.drivenUnpowered,
        ...usb.bus.counters,
      },
      uart: this.uarts.find((one) => one.wired)?.counters ?? null,
    }
  }

  /** The program's device is on the bus only while the program runs; the loader's own is not modelled. */
  #cable(plugged) {
    this.plugged = plugged
    this.usb.setPlugged(plugged && this.loader === null)
  }

  #enterLoader(machine) {
    this.loaders++
    this.loader = new Loader({
      clock: machine.mcu.clock,
      flash: machine.mcu.flash,
      chip: machine.chip,
      board: this.board,
      onDone: () => {
        this.images++
        machine.restart()
      },
      onCut: () => this.#failPower(machine),
    })
    this.#cable(this.plugged)
  }

  /** Power is gone; run() turns it on again. */
  #failPower(machine) {
    this.powerFailed = true
    const { core } = machine.mcu // it does nothing more
    core.PM = core.waiting = true
    core.enabledInterrupts = 0
  }

  /** After each power-up and reset of the chip. */
  #attach(machine) {
    this.loader = null
    this.rom = new machine.chip.Rom(machine, this.board, {
      onLoader: () => this.#enterLoader(machine),
      onCut: () => this.#failPower(machine),
    })
    this.sensors.wire(machine.mcu, () => machine.worldNanos)
    this.timing.watch(machine.mcu, () => machine.time.nanos)
    const spi = machine.mcu.spi[0]
    const transmit = spi.onTransmit
    spi.onTransmit = (mosi) => {
      transmit(mosi)
      this.latency.sampled(mosi, machine.time.nanos)
      this.timing.sampled(mosi, machine.time.nanos)
      if ((this.waiting && this.sensors.started) || this.sensors.over) machine.time.hold()
    }
    this.usb = new UsbHost(machine.mcu, this.board, {
      time: machine.time,
      onData: (bytes) => {
        this.latency.received(bytes, machine.time.nanos)
        this.port.put(bytes)
      },
      canTake: () => machine.worldNanos >= this.readsFrom && (this.lossless || this.port.hasRoom),
      take: (n) => {
        const bytes = this.port.take(n)
        if (bytes?.length > 0) this.latency.asked(machine.time.nanos)
        return bytes
      },
    })
    this.usb.setPlugged(this.plugged)
    this.usb.setOpen(this.port.up)
    this.uarts = this.uartPort === null ? [] : [0, 1].map((number) => new Uart(machine.mcu, number, this.uartPort))
    this.#analyse()
    if (machine.inLoader) this.#enterLoader(machine)
  }

  #analyse() {
    this.vcd?.watch(this.machine.mcu, () => this.machine.worldNanos, this.uarts)
  }
}
