// Another project's driver on the leads of the sensors' board: one select, held up between words.
//
//   node other_driver.mjs IMAGE.bin HOST-BYTES COURSE.json
//
// HOST-BYTES are sent to the board first. COURSE: [{mosi, hz, wait_us}, ...], a word each and how long the select
// stays high behind it; {power: true} cuts the power and gives it back. Writes {words: [...], said, counters}; said
// is the board's answer, in hexadecimal.
import fs from 'node:fs'

import { SELECTS, SensorBoard } from '../../tools/emulator/sensor_board.mjs'

const SETTLED_MS = 400 // enumerated, and told, two sectors of flash erased if that was asked for
const SETUP_NS = 500

const [image, said, course] = process.argv.slice(2).map((path) => fs.readFileSync(path))
let at = 0
const answers = []
const port = {
  up: true,
  hasRoom: true,
  put: (bytes) => answers.push(Buffer.from(bytes)),
  take(n) {
    const part = said.subarray(at, at + n)
    at += part.length
    return part.length > 0 ? part : null
  },
}
const board = new SensorBoard({ image, tape: Buffer.alloc(24), port })
let now

function settle() {
  for (let ms = 0; ms < SETTLED_MS; ms++) board.runAlone(1e6)
  now = board.machine.nanos + 1e6
}

settle()
const words = []
for (const { power, mosi, hz, wait_us } of JSON.parse(course)) {
  if (power) {
    board.powerCycle()
    settle()
    continue
  }
  board.lead(now, SELECTS[0], false)
  now += SETUP_NS
  now += board.clockOut(now, mosi, 16, 1e9 / hz) + 1e9 / hz
  board.lead(now, SELECTS[0], true)
  board.runUntil(now)
  words.push(board.word)
  now += wait_us * 1000
}
console.log(JSON.stringify({ words, said: Buffer.concat(answers).toString('hex'), counters: board.counters() }))
