// Runs a bench image on rp2040js and prints, as JSON, a row per run between two marks: name,
// instructions, cycles, and the value that the closing mark was given.
// usage: node count.mjs IMAGE.bin ADDRESS_OF_BENCH_MARK
// rp2040js counts cycles by the Cortex-M0+ manual, with no flash wait states and no bus contention.
import fs from 'node:fs'
import { ConsoleLogger, LogLevel, RP2040 } from 'rp2040js'

const [, , imagePath, markText] = process.argv
const image = fs.readFileSync(imagePath)
const mark = parseInt(markText, 16)
const FLASH = 0x10000000
const OFFSET = 0x100 // behind where the second-stage boot would be

const mcu = new RP2040()
mcu.logger = new ConsoleLogger(LogLevel.Error, true)
mcu.flash.set(image, OFFSET)
mcu.core.VTOR = FLASH + OFFSET
mcu.core.SP = image.readUInt32LE(0)
mcu.core.PC = image.readUInt32LE(4) & ~1

function nameAt(address) {
  let text = ''
  for (let at = address - FLASH; mcu.flash[at] !== 0; at++) text += String.fromCharCode(mcu.flash[at])
  return text
}

const rows = []
let open = null
for (let instructions = 0; instructions < 4e8; instructions++) {
  if (mcu.core.PC === mark) {
    const address = mcu.core.registers[0]
    if (address !== 0) {
      const name = nameAt(address)
      if (name === 'end') {
        console.log(JSON.stringify(rows))
        process.exit(0)
      }
      open = { name, instructions, cycles: mcu.core.cycles }
    } else {
      rows.push([open.name, instructions - open.instructions, mcu.core.cycles - open.cycles, mcu.core.registers[1] >>> 0])
    }
  }
  mcu.core.executeInstruction()
}
console.error('the image did not reach its end')
process.exit(1)
