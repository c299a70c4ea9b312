// One emulated Pico: the chip with an image in flash, run instruction by instruction in emulated time.
import { DeviceTime, execute } from './faults.mjs'
import { rp2040 } from './rp2040.mjs'

const REASON_TIMER = 1
const LOADER_DONE = Symbol('the boot ROM has a whole image')

export class Machine {
  /** attach(machine) wires up the chip's surroundings; it is called again after each reset. */
  constructor(image, attach, chip = rp2040) {
    chip.checkImage(image)
    this.chip = chip
    this.attach = attach
    this.flash = new Uint8Array(chip.flashBytes).fill(0xff)
    this.flash.set(image)
    this.boots = 0
    this.watchdogResets = 0
    this.instructions = 0
    this.sleptNanos = 0
    this.slowness = 1 // factor on the core's time: a load beside the program's own
    this.#start(0, 0)
  }

  /** Emulated ns since the first power-up. Goes on over resets and holds. */
  get nanos() {
    return this.mcu.clock.nanos
  }

  /** The world's time, for sensors and their tape. Stands still on hold. */
  get worldNanos() {
    return this.worldBefore + this.time.nanos
  }

  /** Nothing will happen any more unless somebody outside does something. */
  get quiet() {
    const { core, clock } = this.mcu
    return core.waiting && !core.wakes() && clock.nextAlarm === null && this.resetAsked === null
  }

  /** Run until the emulated time, or until nothing more will happen while time is held. */
  runUntil(nanos) {
    while (this.nanos < nanos) {
      if (this.resetAsked !== null) this.#reset()
      if (this.mcu.core.waiting) {
        if (!this.#sleep(nanos)) return
      } else {
        this.#work(nanos)
      }
    }
  }

  #work(nanos) {
    const { core, clock } = this.mcu
    let instructions = 0
    while (!core.waiting && clock.nanos < nanos && this.resetAsked === null) {
      clock.tick(execute(core) * this.nanosPerCycle * this.slowness)
      instructions++
    }
    this.instructions += instructions
  }

  /** Sleep until something wakes the core; false when nothing ever will. */
  #sleep(nanos) {
    const { core, clock } = this.mcu
    while (!core.wakes()) {
      if (clock.nextAlarm === null && this.time.held) return false
      const left = nanos - clock.nanos
      if (left <= 0 || this.resetAsked !== null) return true
      const asleep = clock.nextAlarm === null ? left : Math.min(left, clock.nanosToNextAlarm)
      this.sleptNanos += asleep
      clock.tick(asleep)
    }
    core.waiting = false
    core.interruptsUpdated = true
    return true
  }

  /** Power off and on again, at this instant: RAM is lost, flash stays. */
  powerCycle() {
    this.#start(this.nanos, this.worldNanos)
  }

  /** The loader is done and restarts the chip, after the present instruction. */
  restart() {
    this.resetAsked = LOADER_DONE
  }

  #reset() {
    if (this.resetAsked === LOADER_DONE) return this.powerCycle() // the ROM has used RAM for itself
    const { sram, blocks } = this.mcu
    this.#start(this.nanos, this.worldNanos, { sram, scratch: blocks.watchdog.scratchData, reason: this.resetAsked })
    if (!this.inLoader) this.watchdogResets++
  }

  #start(nanos, worldNanos, kept = null) {
    if (this.mcu) this.flash.set(this.mcu.flash.subarray(0, this.flash.length))
    const mcu = this.chip.make(nanos)
    mcu.flash.set(this.flash)
    this.mcu = mcu
    this.time = new DeviceTime(mcu)
    this.worldBefore = worldNanos
    this.boots++
    this.resetAsked = null
    this.nanosPerCycle = 1e9 / mcu.clkSys
    mcu.addClockListener((hz) => (this.nanosPerCycle = 1e9 / hz))
    const { watchdog } = mcu.blocks
    watchdog.onWatchdogTrigger = () => {
      this.resetAsked = watchdog.reason || REASON_TIMER
      watchdog.timer.enable = false // published: it fires again and again at this instant, and time stops
    }
    if (kept !== null) {
      // RAM, scratch registers and the reason outlive a watchdog reset.
      mcu.sram.set(kept.sram)
      watchdog.scratchData.set(kept.scratch)
      watchdog.reason = kept.reason
    }
    this.inLoader = !this.chip.boot(mcu)
    if (this.inLoader) mcu.core.PM = mcu.core.waiting = true // the ROM's own code, which is not here
    this.attach(this)
  }
}
