// Times of the image on the sensors' bus, in device time with SPI words as long as on the wire. SRAM code is exact
// to some cycles; code in flash runs without cache misses.
import fs from 'node:fs'

import { GPIOPinState } from 'rp2040js'

import { CHIP_SELECTS } from './sensors.mjs'

const { bus, frame } = JSON.parse(fs.readFileSync(new URL('../../protocol/schema.json', import.meta.url))).sensor
const SLOT_NS = 1e9 / bus.slot_hz
const SAMPLE_COMMAND = 0x8000 // and above: the first bit of every sample command
const TIMER_EXCEPTION = 16

export class SlotTiming {
  constructor() {
    this.slots = 0
    this.firstNanos = 0
    this.lastNanos = 0
    this.earliest = Infinity
    this.latest = -Infinity
    this.settle = Infinity // from a sample command's deselect to finger 0's select
    this.gap = Infinity // from one finger's deselect to the next one's select
    this.interrupt = 0 // the timer's longest
  }

  /** After each power-up and reset; now() is device time in ns. */
  watch(mcu, now) {
    this.#watchSelects(mcu, now)
    const { core, clock } = mcu
    const [enter, leave] = [core.exceptionEntry.bind(core), core.exceptionReturn.bind(core)]
    let entered = 0
    core.exceptionEntry = (number) => {
      if (number === TIMER_EXCEPTION) entered = clock.nanos
      enter(number)
    }
    core.exceptionReturn = (value) => {
      if (core.IPSR === TIMER_EXCEPTION) this.interrupt = Math.max(this.interrupt, clock.nanos - entered)
      leave(value)
    }
  }

  sampled(mosi, nanos) {
    if (mosi < SAMPLE_COMMAND) return
    const slot = this.slots++ - frame.slots.length // the first round's first slot is due the moment that sampling starts
    if (slot < 0) return
    if (slot === 0) this.firstNanos = nanos
    this.lastNanos = nanos
    const late = nanos - this.firstNanos - slot * SLOT_NS
    this.earliest = Math.min(this.earliest, late)
    this.latest = Math.max(this.latest, late)
  }

  counters() {
    const us = (ns) => (Number.isFinite(ns) ? ns / 1000 : null)
    const intervals = this.slots - frame.slots.length - 1
    return {
      slots: this.slots,
      hz: intervals > 0 ? (intervals / (this.lastNanos - this.firstNanos)) * 1e9 : null,
      slot_deviation_us: [us(this.earliest), us(this.latest)],
      settle_us: us(this.settle),
      gap_us: us(this.gap),
      interrupt_us: us(this.interrupt),
    }
  }

  #watchSelects({ gpio }, now) {
    const low = new Set()
    let released = null
    CHIP_SELECTS.forEach((pin, finger) => {
      gpio[pin].addListener((state) => {
        if (state !== GPIOPinState.Low) {
          low.delete(pin)
          if (low.size === 0) released = now()
          return
        }
        // The first one after a sample command is finger 0's read, or the next slot's command.
        if (low.size === 0 && released !== null && this.slots > 0) {
          const kind = finger === 0 ? 'settle' : 'gap'
          this[kind] = Math.min(this[kind], now() - released)
        }
        low.add(pin)
      })
    })
  }
}
