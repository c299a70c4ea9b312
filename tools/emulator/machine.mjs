// One emulated Pico: the chip with an image in its flash, run instruction by instruction in emulated time.
import { ConsoleLogger, LogLevel, RP2040 } from 'rp2040js'

import { crcStep } from './dma.mjs'
import { correctCore, DeviceTime, execute, wakes } from './faults.mjs'
import { speedUp } from './speed.mjs'

export const FLASH_BYTES = 2 * 1024 * 1024 // of a Pico
const BOOT2_BYTES = 0x100
const BOOT2_AT = 0x20041f00 // where the boot ROM copies the first 256 bytes of flash, and jumps to
const SRAM = 0x20000000
const REASON_TIMER = 1
const LOADER_DONE = Symbol('the boot ROM has a whole image')

/** The boot ROM would run this second-stage boot, and not go to its loader: its CRC-32 is right, with no final inversion. */
function bootable(flash) {
  const stored = Buffer.from(flash.subarray(BOOT2_BYTES - 4, BOOT2_BYTES)).readUInt32LE(0)
  return flash.subarray(0, BOOT2_BYTES - 4).reduce(crcStep, 0xffffffff) === stored
}

/** Throws an Error that says why the boot ROM would not start this image. */
function checkImage(image) {
  if (image.length <= BOOT2_BYTES || image.length > FLASH_BYTES) {
    throw new Error(`has ${image.length} bytes: expected a flash image of 257 bytes to 2 MiB`)
  }
  if (!bootable(image)) {
    throw new Error('does not begin with a second-stage boot and its CRC: expected the .bin of a Pico image')
  }
}

export class Machine {
  /** attach(machine) wires up what surrounds the chip; it is called again after each reset. */
  constructor(image, attach) {
    checkImage(image)
    this.attach = attach
    this.flash = new Uint8Array(FLASH_BYTES).fill(0xff)
    this.flash.set(image)
    this.boots = 0
    this.watchdogResets = 0
    this.instructions = 0
    this.sleptNanos = 0
    this.slowness = 1 // how many times as long the core takes for what it does: a load beside the program's own
    this.#start(0, 0)
  }

  /** Emulated ns since the first power-up. Goes on over resets and holds. */
  get nanos() {
    return this.mcu.clock.nanos
  }

  /** The world's time: what sensors and their tape live in. Stands still on hold. */
  get worldNanos() {
    return this.worldBefore + this.time.nanos
  }

  /** Nothing will happen any more unless somebody outside does something. */
  get quiet() {
    const { core, clock } = this.mcu
    return core.waiting && !wakes(core) && clock.nextAlarm === null && this.resetAsked === null
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
    while (!wakes(core)) {
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

  /** The loader is done and restarts the chip, as soon as what runs now is over. */
  restart() {
    this.resetAsked = LOADER_DONE
  }

  #reset() {
    if (this.resetAsked === LOADER_DONE) return this.powerCycle() // the ROM has used RAM for itself
    const scratch = this.mcu.peripherals[0x40058].scratchData
    const reason = this.resetAsked
    const { sram } = this.mcu
    this.watchdogResets++
    this.#start(this.nanos, this.worldNanos)
    // A watchdog reset keeps RAM, its scratch registers and its reason.
    this.mcu.sram.set(sram)
    this.#enterBoot2()
    this.mcu.peripherals[0x40058].scratchData.set(scratch)
    this.mcu.peripherals[0x40058].reason = reason
  }

  #start(nanos, worldNanos) {
    if (this.mcu) this.flash.set(this.mcu.flash.subarray(0, FLASH_BYTES))
    const mcu = new RP2040()
    mcu.clock.nanosCounter = nanos
    mcu.logger = new ConsoleLogger(LogLevel.Error, true)
    mcu.flash.set(this.flash)
    correctCore(mcu.core)
    speedUp(mcu)
    this.mcu = mcu
    this.time = new DeviceTime(mcu)
    this.worldBefore = worldNanos
    this.boots++
    this.resetAsked = null
    this.nanosPerCycle = 1e9 / mcu.clkSys
    mcu.addClockListener((hz) => (this.nanosPerCycle = 1e9 / hz))
    const watchdog = mcu.peripherals[0x40058]
    watchdog.onWatchdogTrigger = () => {
      this.resetAsked = watchdog.reason || REASON_TIMER
      watchdog.timer.enable = false // published: it fires again and again at this instant, and time stops
    }
    this.#enterBoot2()
    this.attach(this)
  }

  /** What the boot ROM does: the first 256 bytes run from SRAM and find their own way to the image. */
  #enterBoot2() {
    const { core, sram, flash } = this.mcu
    this.inLoader = !bootable(flash)
    if (this.inLoader) {
      core.PM = core.waiting = true // the ROM's own code, which is not here
      return
    }
    sram.set(flash.subarray(0, BOOT2_BYTES), BOOT2_AT - SRAM)
    core.SP = BOOT2_AT
    core.LR = 0
    core.PC = BOOT2_AT
  }
}
