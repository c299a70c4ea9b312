// Differences of rp2040js 1.4.1 from the chip, corrected from outside so that the package stays as published.
// Each was seen to matter: an image that relies on the wrong behaviour would hang, or run fast, on silicon.

const ENTRY_CYCLES = 15 // Cortex-M0+ manual, zero wait states
const RETURN_CYCLES = 13

const RESET = 0

/** Call then() whenever the program puts this block into reset, one of mcu.resetBits: as published, the state stays. */
export function onReset(mcu, block, then) {
  const { resets } = mcu.blocks
  const bit = mcu.resetBits[block]
  const write = resets.writeUint32.bind(resets)
  resets.writeUint32 = (offset, value) => {
    write(offset, value)
    if (offset === RESET && value & bit) then()
  }
}

/**
 * The core: sleep, masked interrupts, and the cycles of an exception.
 *
 * Methods are replaced, never properties redefined: an object with added accessors runs three times slower.
 */
export function correctCore(core) {
  // Something would end a WFI; PRIMASK has no say in that.
  core.wakes = () =>
    !!(core.pendingInterrupts & core.enabledInterrupts || core.pendingSystick || core.pendingPendSV || core.pendingNMI)

  // WFI with PRIMASK set must end without entering the handler, and must not begin when an interrupt is pending.
  // Published: it enters the handler, or sleeps on. Here a wait only ends; the next instruction decides the rest.
  const check = core.checkForInterrupts.bind(core)
  core.checkForInterrupts = () => (core.waiting ? core.wakes() : check())

  // Exceptions are free as published. The cycles are owed and paid with the next instruction: ticking the clock
  // in the middle of an entry would let alarms nest into it.
  core.owedCycles = 0
  const enter = core.exceptionEntry.bind(core)
  const leave = core.exceptionReturn.bind(core)
  core.exceptionEntry = (number) => {
    enter(number)
    core.owedCycles += ENTRY_CYCLES
  }
  core.exceptionReturn = (value) => {
    leave(value)
    core.owedCycles += RETURN_CYCLES
  }
}

/** One instruction; returns the cycles. */
export function execute(core) {
  const masked = core.PM
  const cycles = core.executeInstruction() + core.owedCycles
  core.owedCycles = 0
  // CPSIE must let an interrupt in that came while masked. Published: it stays out until another one comes.
  if (masked && !core.PM) core.interruptsUpdated = true
  return cycles
}

const TIMEHR = 0x08
const TIMELR = 0x0c
const ALARM0 = 0x10
const ALARM3 = 0x1c
const TIMERAWH = 0x24
const TIMERAWL = 0x28
const TICK_NS = 1000
const SPIN_NS = 100 // a loop that reads the time this often, and so often in a row, does nothing but wait for it
const SPIN_READS = 8

/**
 * The TIMER: alarms on whole microseconds, and a hold like the debugger's pause.
 *
 * Published: an alarm comes up to 1 us before the counter shows that time, and one that is set to a time already
 * past comes at once. On the chip it comes 71 minutes later, which is how such a mistake shows itself.
 */
export class DeviceTime {
  constructor(mcu) {
    this.mcu = mcu
    this.clock = mcu.clock
    this.spin = { pc: 0, reads: 0, untilNanos: 0 } // where the time was read last, how often, until when it may be again
    this.lost = mcu.clock.nanos // counts from the reset
    this.heldAt = null
    this.onHold = [] // others that must stand still
    this.onRelease = []
    this.timer = mcu.blocks.timer
    this.watchdog = mcu.blocks.watchdog
    this.#correctAlarms()
    this.#holdWatchdogToo()
  }

  /** Device time in ns: the clock less the time on hold. */
  get nanos() {
    return (this.heldAt ?? this.clock.nanos) - this.lost
  }

  get held() {
    return this.heldAt !== null
  }

  hold() {
    if (this.held) return
    this.heldAt = this.clock.nanos
    for (const alarm of this.timer.alarms) alarm.clockAlarm.cancel()
    this.#stopWatchdog()
    for (const stop of this.onHold) stop()
  }

  release() {
    if (!this.held) return
    this.lost += this.clock.nanos - this.heldAt
    this.heldAt = null
    for (const alarm of this.timer.alarms) if (alarm.armed) this.#schedule(alarm)
    for (const go of this.onRelease) go()
    this.watchdog.timer.enable = this.watchdog.alarm.enable = this.watchdog.enable && this.watchdog.tickEnable
  }

  #schedule(alarm) {
    const now = Math.floor(this.nanos / TICK_NS)
    const ahead = (alarm.targetMicros - now) >>> 0 || 2 ** 32
    alarm.clockAlarm.schedule((now + ahead) * TICK_NS - this.nanos)
  }

  #correctAlarms() {
    const { timer } = this
    const read = timer.readUint32.bind(timer)
    const write = timer.writeUint32.bind(timer)
    timer.readUint32 = (offset) => {
      const ticks = Math.floor(this.nanos / TICK_NS)
      switch (offset) {
        case TIMELR:
          timer.latchedTimeHigh = Math.floor(ticks / 2 ** 32)
          return ticks >>> 0
        case TIMERAWH:
          return Math.floor(ticks / 2 ** 32)
        case TIMERAWL:
          this.#skipSpin((ticks + 1) * TICK_NS - this.nanos)
          return ticks >>> 0
        case TIMEHR:
          return timer.latchedTimeHigh
      }
      return read(offset)
    }
    timer.writeUint32 = (offset, value) => {
      if (offset < ALARM0 || offset > ALARM3) return write(offset, value)
      const alarm = timer.alarms[(offset - ALARM0) / 4]
      alarm.armed = true
      alarm.targetMicros = value >>> 0
      if (!this.held) this.#schedule(alarm)
    }
  }

  /** Such a loop goes on when the next time is there, or an alarm: most of a boot's cost here was in such turns. */
  #skipSpin(leftNanos) {
    const { mcu, clock, spin } = this
    spin.reads = mcu.core.PC === spin.pc && clock.nanos <= spin.untilNanos ? spin.reads + 1 : 0
    const nanos = Math.min(leftNanos, clock.nanosToNextAlarm || Infinity)
    const cycles = spin.reads < SPIN_READS ? 0 : Math.floor((nanos * mcu.clkSys) / 1e9)
    mcu.core.owedCycles += cycles
    spin.pc = mcu.core.PC
    spin.untilNanos = clock.nanos + (cycles * 1e9) / mcu.clkSys + SPIN_NS
  }

  #stopWatchdog() {
    this.watchdog.timer.enable = this.watchdog.alarm.enable = false
  }

  #holdWatchdogToo() {
    const write = this.watchdog.writeUint32.bind(this.watchdog)
    this.watchdog.writeUint32 = (offset, value) => {
      write(offset, value)
      if (this.held) this.#stopWatchdog()
    }
  }
}
