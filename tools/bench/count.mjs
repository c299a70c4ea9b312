// Runs a bench image on rp2040js. Prints JSON: {rows: [[kernel, scene, instructions, cycles], ...], results:
// [...]}, a row per run between two marks, in the order they came.
// usage: node count.mjs IMAGE.bin MARK NAME RESULT END        (addresses of the functions in mark.h)
// rp2040js counts cycles by the Cortex-M0+ manual, with no flash wait states and no bus contention.
import fs from 'node:fs'
import { ConsoleLogger, LogLevel, RP2040 } from 'rp2040js'

const [, , imagePath, ...addresses] = process.argv
const image = fs.readFileSync(imagePath)
const [mark, name, result, end] = addresses.map((text) => parseInt(text, 16))
const FLASH = 0x10000000
const OFFSET = 0x100 // behind where the second-stage boot would be
const LIMIT = 4e9

const mcu = new RP2040()
mcu.logger = new ConsoleLogger(LogLevel.Error, true)
mcu.flash.set(image, OFFSET)
mcu.core.VTOR = FLASH + OFFSET
mcu.core.SP = image.readUInt32LE(0)
mcu.core.PC = image.readUInt32LE(4) & ~1

function textAt(address) {
  let text = ''
  for (let at = address - FLASH; mcu.flash[at] !== 0; at++) text += String.fromCharCode(mcu.flash[at])
  return text
}

const rows = []
const results = []
let names = null
let open = null
let done = false
for (let instructions = 0; instructions < LIMIT && !done; instructions++) {
  const at = mcu.core.PC
  if (at === mark) {
    if (open === null) {
      open = { instructions, cycles: mcu.core.cycles }
    } else {
      rows.push([...names, instructions - open.instructions, mcu.core.cycles - open.cycles])
      open = null
    }
  } else if (at === name) {
    names = [textAt(mcu.core.registers[0]), textAt(mcu.core.registers[1])]
  } else if (at === result) {
    results.push(mcu.core.registers[0] >>> 0)
  } else if (at === end) {
    done = true
  }
  mcu.core.executeInstruction()
}
if (done) {
  // process.exit would cut off the bytes still in a pipe, all beyond 64 KiB
  process.stdout.write(JSON.stringify({ rows, results }))
} else {
  console.error('the image did not reach its end')
  process.exitCode = 1
}
