// When the image does what on the sensors' bus, in emulated time with SPI words as long as on the wire; no sensor
// answers. Prints JSON, times in us. SRAM code is exact to some cycles; code in flash runs without cache misses.
//
//   node timing.mjs IMAGE.bin SECONDS
import fs from 'node:fs'

import { Machine } from './machine.mjs'
import { Board, BootRom } from './rom.mjs'

const SLOT_NS = 1e9 / 4400
const WORD_BITS = 16
const SAMPLE_COMMAND = 0x8000 // and above: the first bit of every sample command
const FIRST_SELECT = 17
const SELECTS = [FIRST_SELECT, 20, 21, 22, 26]
const TIMER_EXCEPTION = 16
const HIGH = 1

const [, , path, seconds] = process.argv
const commands = [] // when each sample command went out
const settles = [] // from a sample command's deselect to finger 0's select
const gaps = [] // from one finger's deselect to the next one's select
const interrupts = [] // how long the timer's took

const machine = new Machine(fs.readFileSync(path), ({ mcu }) => {
  const { core, clock, spi } = mcu
  new BootRom(mcu, new Board(), { onLoader() {}, onCut() {} })
  const wire = clock.createAlarm(() => spi[0].completeTransmit(0))
  spi[0].onTransmit = (word) => {
    if (word >= SAMPLE_COMMAND) commands.push(clock.nanos)
    wire.schedule((WORD_BITS * 1e9) / spi[0].clockFrequency)
  }
  watchSelects(mcu)
  const [enter, leave] = [core.exceptionEntry.bind(core), core.exceptionReturn.bind(core)]
  let entered = 0
  core.exceptionEntry = (number) => {
    if (number === TIMER_EXCEPTION) entered = clock.nanos
    enter(number)
  }
  core.exceptionReturn = (value) => {
    if (core.IPSR === TIMER_EXCEPTION) interrupts.push(clock.nanos - entered)
    leave(value)
  }
})

function watchSelects({ gpio, clock }) {
  const low = new Set()
  let released = null
  for (const pin of SELECTS) {
    gpio[pin].addListener((state) => {
      if (state === HIGH) {
        low.delete(pin)
        if (low.size === 0) released = clock.nanos
        return
      }
      // The first one after a sample command is finger 0's read, or the next slot's command.
      if (low.size === 0 && released !== null && commands.length > 0) {
        const list = pin === FIRST_SELECT ? settles : gaps
        list.push(clock.nanos - released)
      }
      low.add(pin)
    })
  }
}

machine.runUntil(Number(seconds) * 1e9)
commands.splice(0, 44) // the first round: its first slot is due the moment that sampling starts
const late = commands.map((at, k) => at - commands[0] - k * SLOT_NS)
const us = (ns) => ns / 1000
console.log(
  JSON.stringify({
    slots: commands.length,
    hz: ((commands.length - 1) / (commands.at(-1) - commands[0])) * 1e9,
    slot_deviation_us: [us(Math.min(...late)), us(Math.max(...late))],
    settle_us: us(Math.min(...settles)),
    gap_us: us(Math.min(...gaps)),
    interrupt_us: us(Math.max(...interrupts)),
    awake: 1 - machine.sleptNanos / machine.nanos,
  }),
)
