// Every opcode of 16 bits, twice, on two cores: one as published, and one that tools/emulator/speed.mjs has sped
// up. Prints {executed, differences: [...]}; the list must be empty.
import { RP2040 } from '../../tools/node_modules/rp2040js/dist/esm/index.js'
import { speedUp } from '../../tools/emulator/speed.mjs'

const SRAM = 0x20000000
const CODE = SRAM + 0x8000
const [ROUNDS, WIDE, DATA_BYTES] = [2, 0xe800, 0x400]
const BREAKPOINTS = [0xbe, 0xde] // they stop, on either

let seed = 19
const random = () => (seed = (Math.imul(seed, 1664525) + 1013904223) >>> 0)

const DATA = Uint8Array.from({ length: DATA_BYTES }, () => random() >>> 24)
const chips = [new RP2040(), new RP2040()]
speedUp(chips[1])
for (const chip of chips) chip.logger = { debug() {}, info() {}, warn() {}, error() {} }
console.warn = () => {} // SIO's, of addresses that are nowhere

function prepared(chip, opcode, values, flags) {
  const { core } = chip
  chip.sramView.setUint16(CODE - SRAM, opcode, true)
  chip.sram.set(DATA)
  values.forEach((value, k) => (core.registers[k] = value))
  core.SP = SRAM + 0x200
  core.PC = CODE
  core.APSR = flags << 28
  core.PM = core.waiting = core.interruptsUpdated = core.pendingSVCall = core.eventRegistered = false
  return core
}

function after(chip, cycles) {
  const { core } = chip
  const state = [cycles, core.cycles, core.xPSR, core.PM, core.waiting, core.pendingSVCall, ...core.registers]
  return state.join()
}

const differences = []
let executed = 0
for (let opcode = 0; opcode < WIDE; opcode++) {
  if (BREAKPOINTS.includes(opcode >> 8)) continue
  for (let round = 0; round < ROUNDS; round++) {
    // Addresses in SRAM, small offsets, and anything.
    const values = Array.from({ length: 13 }, () => [SRAM + (random() >>> 24) * 4, random() >>> 26, random()][(random() >>> 8) % 3])
    const flags = random() >>> 28
    const [published, quick] = chips.map((chip) => {
      try {
        return after(chip, prepared(chip, opcode, values, flags).executeInstruction())
      } catch (error) {
        return error.message
      }
    })
    executed++
    const written = chips.map((chip) => chip.sram.subarray(0, DATA_BYTES))
    if (published !== quick || Buffer.compare(...written) !== 0) differences.push(opcode.toString(16))
  }
}
console.log(JSON.stringify({ executed, differences }))
