// The state machines of PIO0 in emulated time, a cycle a step. As published they run by wall clock, a thousand steps at
// a time, those that are not enabled among them.
//
// A machine that waits, stalled or in a loop, is skipped until a pin or a FIFO changes that it has looked at. Whole
// rounds of the loop are skipped then, so that it is found in the very step that it would have come
// to. Machines here know nothing of one another: neither flags nor pins that one drives and another sees.
const CYCLE_NS = 8
const QUANTUM = 4 // cycles between two looks at the others: effects of the machines come so much later at most
const PIN_CONDITION = 6
const FROM_PINS = 0
const WAITS_FOR_PIN = 1 // rp2040js's WaitType
const ALL = 0xffffffff
const [FIFOS, FIFOS_END, INTERRUPTS] = [0x10, 0x30, 0x128] // registers

class Stepper {
  constructor(machine, pio, onPins) {
    this.onPins = onPins
    this.machine = machine
    this.pio = pio
    this.at = 0 // ns, stepped until here
    this.wake()
  }

  /** Something changed. */
  wake() {
    this.round = 0 // cycles after which it is where it was, once that is known
    this.mark = null // the state after the last jump back
    this.pins = 0 // that it has looked at since
    this.since = 0
  }

  /** It may do something else once this pin changes. */
  sees(bit) {
    return this.round === 0 || (this.pins & bit) !== 0
  }

  advance(nanos) {
    let cycles = Math.floor((nanos - this.at) / CYCLE_NS + 1e-6)
    while (cycles > 0) {
      if (this.round > 0) {
        const left = cycles % this.round
        this.at += (cycles - left) * CYCLE_NS
        cycles = left
        if (left === 0) return
      }
      this.#step()
      cycles--
    }
  }

  #step() {
    const { machine, pio } = this
    const from = machine.pc
    machine.step()
    this.at += CYCLE_NS
    if (this.round > 0) return
    this.since++
    if (pio.pinValues !== pio.oldPinValues || pio.pinDirections !== pio.oldPinDirections) {
      this.onPins(this.at)
      this.mark = null // a loop that drives pins is no waiting
    }
    if (machine.waiting) {
      this.round = 1
      this.pins = machine.waitType === WAITS_FOR_PIN ? 1 << machine.waitIndex : 0
    } else if (machine.pc <= from) {
      this.#compare()
    }
  }

  #compare() {
    const { machine: m, mark } = this
    const shifted = [m.inputShiftReg, m.inputShiftCount, m.outputShiftReg, m.outputShiftCount]
    const state = [m.pc, m.x, m.y, ...shifted, m.rxFIFO.itemCount, m.txFIFO.itemCount]
    if (mark !== null && state.every((value, k) => value === mark[k])) {
      this.round = this.since
      return
    }
    this.mark = state
    this.since = this.pins = 0
  }
}

export class PioTime {
  constructor(mcu) {
    this.mcu = mcu
    this.pio = mcu.pio[0]
    this.inputs = 0 // levels of the pads, bit by pin
    this.running = []
    this.due = false
    this.alarm = mcu.clock.createAlarm(() => this.#look())
    this.nanos = 0 // when pins that are changing do so
    this.steppers = this.pio.machines.map((machine) => new Stepper(machine, this.pio, (nanos) => this.#drive(nanos)))
    this.steppers.forEach((stepper) => this.#correct(stepper))
    this.#correctRegisters()
  }

  /** A pin's level as it is from now on. */
  input(pin, high) {
    const bit = 1 << pin
    const { nanos } = this.mcu.clock
    for (const stepper of this.running) if (stepper.sees(bit)) stepper.advance(nanos)
    this.inputs = high ? this.inputs | bit : this.inputs & ~bit
    this.mcu.gpio[pin].setInputValue(high)
    for (const stepper of this.running) if (stepper.sees(bit)) stepper.wake()
    this.#lookAgain()
  }

  /** Step until now. */
  #advance() {
    for (const stepper of this.running) stepper.advance(this.mcu.clock.nanos)
  }

  #drive(nanos) {
    this.nanos = nanos
    this.pio.checkChangedPins()
  }

  #wake(steppers) {
    for (const stepper of steppers) stepper.wake()
    this.#lookAgain()
  }

  #look() {
    this.due = false
    for (const stepper of this.running) if (stepper.round === 0) stepper.advance(this.mcu.clock.nanos)
    this.#lookAgain()
  }

  #lookAgain() {
    if (this.due) return
    for (const stepper of this.running) {
      if (stepper.round > 0) continue
      this.due = true
      this.alarm.schedule(QUANTUM * CYCLE_NS)
      return
    }
  }

  #correctRegisters() {
    const { pio } = this
    pio.run = () => {}
    const [read, write] = [pio.readUint32.bind(pio), pio.writeUint32.bind(pio)]
    pio.readUint32 = (offset) => {
      this.#advance()
      const value = read(offset)
      if (offset >= FIFOS && offset < FIFOS_END) this.#wake([this.#ownerOf(offset)]) // it may have room again
      return value
    }
    pio.writeUint32 = (offset, value) => {
      this.#advance()
      write(offset, value)
      if (offset >= INTERRUPTS) return
      if (offset >= FIFOS && offset < FIFOS_END) return this.#wake([this.#ownerOf(offset)])
      const before = this.running
      this.running = this.steppers.filter(({ machine }) => machine.enabled)
      for (const stepper of this.running) if (!before.includes(stepper)) stepper.at = this.mcu.clock.nanos
      this.#wake(this.running)
    }
  }

  #ownerOf(offset) {
    return this.steppers[(offset >> 2) & 3]
  }

  /** As published it asks all thirty pins, each through a chain of getters. */
  #correct(stepper) {
    const { machine } = stepper
    const [from, condition] = [machine.inSourceValue.bind(machine), machine.jmpCondition.bind(machine)]
    machine.inSourceValue = (source) => {
      if (source !== FROM_PINS) return from(source)
      const base = machine.inBase
      const count = this.pio.instructions[machine.pc] & 0x1f
      const isIn = this.pio.instructions[machine.pc] >>> 13 === 2
      const seen = isIn && count > 0 ? (1 << count) - 1 : ALL
      stepper.pins |= (seen << base) | (base ? seen >>> (32 - base) : 0)
      return base ? (this.inputs << (32 - base)) | (this.inputs >>> base) : this.inputs
    }
    machine.jmpCondition = (which) => {
      if (which !== PIN_CONDITION) return condition(which)
      const bit = 1 << machine.jmpPin
      stepper.pins |= bit
      return (this.inputs & bit) !== 0
    }
  }
}
