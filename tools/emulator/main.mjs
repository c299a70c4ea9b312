// An emulated Pico on a pty. `biotac sim --board pico` and biotac.open("emu:pico?source=...") start it.
//
//   node main.mjs --image BIN --wasm sensors.wasm --tape FILE --pty PATH --master FD
//                 [--pace X] [--hold] [--serials A,B,...] [--uart-master FD] [--do VERB]...
//   node main.mjs --image BIN --sensor BIN --sensor-pty PATH --sensor-master FD --tape FILE --pty PATH --master FD
//                 [--endless] ...
//
// --chip rp2350 --emulator FILE: a Pico 2, by rp2350js, which is not fetched with the rest (host/docs/develop/pico2.md).
//
// The second form has a second Pico in place of the sensors (sensor_board.mjs). It writes "sensor PATH" once that board's
// port can be opened, and gives the first one power when stdin says "power". --endless: the tape's length does not
// matter, somebody else feeds the sensors, and time does not end with it.
//
// --live N in place of --tape: a program feeds N fingers round by round (control.mjs), and time stands still until it has
// sent the next round. Writes "control PORT" first; the board boots once the first round has come.
//
// --uart-master has another pty on the pins of the UART that the image uses.
//
// FD is the open master side of a pty, non-blocking; PATH is the name of the other side, to be printed.
// Writes "pty PATH" once the port can be opened, and "end" once the tape is played and
// all of it handed over; "run" on stdin ends a hold, the end of stdin ends the process. More lines for stdin:
//   [@SECONDS] VERB   one of rig.mjs, such as `unplug`: now, or at a time of the sensors' world. --do has it done before
//                     the board boots
//   counters          answers "counters JSON"
//   arrivals          answers "counters [[t_us, finger, device us of the last byte with the host], ...]", one a FRAME
//   until SECONDS JSON  answers likewise once the counters are those of JSON, or "never JSON" with their values when
//                     so much emulated time has passed or nothing will happen any more
import fs from 'node:fs'
import { parseArgs } from 'node:util'

import { Control } from './control.mjs'
import { Pty } from './pty.mjs'
import { Rig } from './rig.mjs'
import { rp2040 } from './rp2040.mjs'
import { rp2350 } from './rp2350.mjs'
import { SensorBoard } from './sensor_board.mjs'
import { Sensors } from './sensors.mjs'

const STRETCH_NS = 1e6
const BOOT_NS = 10e9 // a board that has not begun to sample by then will not
const POLL_MS = 1
const text = { type: 'string' }
const { values: options } = parseArgs({
  options: {
    image: text,
    chip: { type: 'string', default: 'rp2040' },
    emulator: text,
    wasm: text,
    sensor: text,
    'sensor-pty': text,
    'sensor-master': text,
    tape: text,
    live: text,
    pty: text,
    master: text,
    'uart-master': text,
    pace: { type: 'string', default: '1' },
    serials: { type: 'string', default: '' },
    endless: { type: 'boolean', default: false },
    hold: { type: 'boolean', default: false },
    do: { type: 'string', multiple: true, default: [] },
  },
})

function die(what, why) {
  console.error(`emulator: ${what}: ${why}`)
  process.exit(2)
}

const pace = Number(options.pace)
const pty = new Pty(Number(options.master))
const sensorPty = options.sensor === undefined ? null : new Pty(Number(options['sensor-master']))
const uartPty = options['uart-master'] === undefined ? null : new Pty(Number(options['uart-master']))
const ports = uartPty === null ? [pty] : [pty, uartPty]
const tape = options.live === undefined ? read(options.tape) : null
const chip = await chipOf(options)
let sensors = null
let rig = null // once the gateway has power

function read(path) {
  try {
    return fs.readFileSync(path)
  } catch (error) {
    return die(path, error.message)
  }
}

async function chipOf({ chip, emulator }) {
  if (chip === 'rp2040') return rp2040
  if (chip !== 'rp2350') return die(chip, 'no such chip: expected --chip rp2040 or rp2350')
  try {
    return await rp2350(emulator)
  } catch (error) {
    return die(emulator ?? '--emulator', `${error.message}: expected rp2350js as host/docs/develop/pico2.md builds it`)
  }
}

function plugIn() {
  try {
    if (sensorPty === null) sensors = new Sensors(read(options.wasm), tape, options.serials, Number(options.live))
    else sensors = new SensorBoard({ image: read(options.sensor), tape, endless: options.endless, port: sensorPty })
  } catch (error) {
    die(options.sensor ?? options.tape ?? '--live', error.message)
  }
}

function power() {
  try {
    rig = new Rig({ image: read(options.image), chip, sensors, hold: options.hold, port: pty, uartPort: uartPty, lossless: pace === 0 })
    for (const verb of options.do) rig.act(verb)
  } catch (error) {
    die(options.image, error.message)
  }
  boot()
}

/** A program sent something to the sensors. The board samples as it boots: it gets power once there is a round. */
function fed() {
  if (rig !== null) rig.goOn()
  else if (sensors.hasRound) power()
}

let asked = false // to end the hold
let told = false // that the tape is over
let polled = 0
let awaited = null // {counters, nanos} of `until`
let base = null // [wall ms, world ms] that pacing counts from

/** Boot to the first sample, so that the host later meets the same board every time. */
function boot() {
  while (options.hold && !rig.still) {
    if (rig.machine.nanos > BOOT_NS) {
      die(options.image, `does not sample within ${BOOT_NS / 1e9} s of its time: expected the gateway's image`)
    }
    rig.run(STRETCH_NS)
  }
  console.log(`pty ${options.pty}`)
}

function answer(word) {
  console.log(`${word} ${JSON.stringify(rig.counters())}`)
}

/** Some of the counters, groups of them included, are these. */
function are(counters, wanted) {
  return Object.entries(wanted).every(([name, value]) =>
    value !== null && typeof value === 'object' ? are(counters[name] ?? {}, value) : counters[name] === value,
  )
}

function tellAwaited(nothingElse) {
  if (awaited === null) return
  const so = are(rig.counters(), awaited.counters)
  if (!so && !nothingElse && rig.machine.nanos < awaited.nanos) return
  awaited = null
  answer(so ? 'counters' : 'never')
}

function ahead() {
  if (pace === 0 || rig.machine.time.held) {
    base = null
    return false
  }
  const [wall, world] = [performance.now(), rig.machine.worldNanos / 1e6]
  base ??= [wall, world]
  return (world - base[1]) / pace > wall - base[0]
}

/** The sensors' board, while the gateway has no power or stands still; true when it has nothing to do. */
function sensorsAlone() {
  if (sensorPty === null) return true
  sensors.runAlone(STRETCH_NS)
  return sensorPty.received.length === 0
}

/** One turn; returns true when there is nothing to do for a while. */
function turn() {
  let news = false
  if (performance.now() - polled >= POLL_MS || !rig || rig.still) {
    polled = performance.now()
    for (const port of ports) {
      news = port.poll() || news
      port.flush()
    }
    sensorPty?.poll()
    sensorPty?.flush()
  }
  if (!rig) return sensorsAlone()
  if (pace === 0 && ports.some((port) => port.pendingBytes > 0)) {
    for (const port of ports) port.flush()
    return sensorsAlone() // unpaced nothing is dropped: emulated time waits for the program that reads
  }
  if (rig.still && !news && pty.up === rig.usb.open) {
    if (asked && rig.waiting) {
      rig.release()
    } else {
      if (sensors.over && !told) {
        told = true
        console.log('end')
      }
      tellAwaited(true)
      if (sensors.live && !rig.waiting) sensors.calls.report()
      return sensorsAlone()
    }
  }
  if (ahead()) return true
  rig.run(STRETCH_NS)
  sensors.follow()
  tellAwaited(false)
  return false
}

function line(words) {
  if (words === 'power') {
    power()
  } else if (words === 'run') {
    asked = true
  } else if (words === 'counters') {
    answer('counters')
  } else if (words === 'arrivals') {
    console.log(`counters ${JSON.stringify(rig.latency.arrivals)}`)
  } else if (words.startsWith('until ')) {
    const [, seconds, counters] = words.match(/^until ([0-9.]+) (.*)$/)
    awaited = { counters: JSON.parse(counters), nanos: rig.machine.nanos + Number(seconds) * 1e9 }
  } else {
    const [, seconds, verb] = words.match(/^(?:@([0-9.]+) )?(.*)$/)
    if (seconds === undefined) rig.act(verb)
    else rig.plan(Number(seconds), verb)
  }
}

let unfinished = ''
const waitingLines = []
process.stdin.on('data', (chunk) => {
  const lines = (unfinished + chunk).split('\n')
  unfinished = lines.pop()
  waitingLines.push(...lines)
})
process.stdin.on('end', () => process.exit(0)) // whoever started us is gone

function loop() {
  // Commands after `run` meet a running board: a host's time-out would pass while the board's time stands still.
  while (waitingLines.length > 0 && !(asked && rig?.waiting)) line(waitingLines.shift())
  if (turn()) setTimeout(loop, POLL_MS)
  else setImmediate(loop)
}

plugIn()
if (sensors.live) {
  sensors.linkBytes = () => pty.putBytes
  await new Control(sensors, fed).listen()
} else if (sensorPty === null) {
  power()
} else {
  console.log(`sensor ${options['sensor-pty']}`)
}
loop()
