// course.c with the sensors as WebAssembly: node course.mjs WASM TAPE < STEPS > WORDS
import fs from 'node:fs'
import { Sensors } from '../../tools/emulator/sensors.mjs'

const [, , wasm, tape] = process.argv
const { calls } = new Sensors(fs.readFileSync(wasm), fs.readFileSync(tape), 'BT12345678ABCDEF,,x')
const steps = fs.readFileSync(0)
const words = []
for (let at = 0; at < steps.length; at += 16) {
  const value = steps.readUInt32LE(at + 4)
  const nanos = Number(steps.readBigUInt64LE(at + 8))
  if (steps.readUInt32LE(at) === 0) calls.select(value, nanos)
  else words.push(calls.transfer(value, nanos))
}
for (let finger = 0; finger < 5; finger++) words.push(calls.early_reads(finger) & 0xffff)
fs.writeSync(1, Buffer.from(Uint16Array.from(words).buffer))
