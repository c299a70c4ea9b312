// The state machines of PIO0 in emulated time, a cycle a step. As published they run by wall clock, a thousand steps at
// a time, those that are not enabled among them.
//
// A machine that waits in a loop of its own comes back to the same state again and again: once all have done so over a
// window, the cycles until something changes are left out, by whole windows, so that they are found in the very step
// that they would have come to.
const CYCLE_NS = 8
const WINDOW = 12 // cycles: a multiple of the length of every loop that a program waits in, or it is only slow
const QUANTUM = 4 // cycles between two looks at what else goes on: what the machines cause comes so much later at most
const PIN_CONDITION = 6
const FROM_PINS = 0

export class PioTime {
  constructor(mcu) {
    this.mcu = mcu
    this.pio = mcu.pio[0]
    this.inputs = 0 // what the pads carry, bit by pin
    this.at = mcu.clock.nanos // stepped until here
    this.running = []
    this.repeats = false
    this.before = []
    this.left = WINDOW
    this.due = false
    this.alarm = mcu.clock.createAlarm(() => this.#look())
    this.#correct()
  }

  /** A pin's level as it is from now on. */
  input(pin, high) {
    this.advance()
    this.inputs = high ? this.inputs | (1 << pin) : this.inputs & ~(1 << pin)
    this.mcu.gpio[pin].setInputValue(high)
    this.#wake()
  }

  /** Step until now. */
  advance() {
    let cycles = Math.floor((this.mcu.clock.nanos - this.at) / CYCLE_NS + 1e-6)
    if (this.repeats || this.running.length === 0) {
      const skipped = this.running.length === 0 ? cycles : cycles - (cycles % WINDOW)
      this.at += skipped * CYCLE_NS
      cycles -= skipped
    }
    for (; cycles > 0; cycles--) this.#step()
  }

  #step() {
    for (const machine of this.running) machine.step()
    this.pio.checkChangedPins()
    this.at += CYCLE_NS
    if (!this.repeats && --this.left === 0) this.#compare()
  }

  #compare() {
    this.left = WINDOW
    let same = true
    let k = 0
    for (const m of this.running) {
      const now = [m.pc, m.x, m.y, m.inputShiftReg, m.outputShiftReg, m.inputShiftCount, m.outputShiftCount]
      now.push(m.rxFIFO.itemCount, m.txFIFO.itemCount)
      for (const value of now) {
        same &&= this.before[k] === value
        this.before[k++] = value
      }
    }
    this.repeats = same
  }

  #wake() {
    this.repeats = false
    this.left = WINDOW
    this.before = []
    if (this.due || this.running.length === 0) return
    this.due = true
    this.alarm.schedule(QUANTUM * CYCLE_NS)
  }

  #look() {
    this.due = false
    this.advance()
    if (this.repeats || this.running.length === 0) return
    this.due = true
    this.alarm.schedule(QUANTUM * CYCLE_NS)
  }

  #correct() {
    const { pio } = this
    pio.run = () => {}
    const [read, write] = [pio.readUint32.bind(pio), pio.writeUint32.bind(pio)]
    pio.readUint32 = (offset) => {
      this.advance()
      const value = read(offset)
      this.#wake() // a FIFO may have room again
      return value
    }
    pio.writeUint32 = (offset, value) => {
      this.advance()
      write(offset, value)
      this.running = pio.machines.filter((machine) => machine.enabled)
      this.#wake()
    }
    // As published these ask all thirty pins, each through a chain of getters.
    for (const machine of pio.machines) {
      const [from, condition] = [machine.inSourceValue.bind(machine), machine.jmpCondition.bind(machine)]
      machine.inSourceValue = (source) => {
        if (source !== FROM_PINS) return from(source)
        const base = machine.inBase
        return base ? (this.inputs << (32 - base)) | (this.inputs >>> base) : this.inputs
      }
      machine.jmpCondition = (which) =>
        which === PIN_CONDITION ? ((this.inputs >>> machine.jmpPin) & 1) === 1 : condition(which)
    }
  }
}
