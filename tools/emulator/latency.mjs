// Latencies in device time: from the sample of a round's last electrode to the FRAMEs' last byte with the host, from
// the slot of an EVENT, and from the host's latest bytes to a REPLY. A TRUST, which is sent behind the round's
// FRAMEs and not in a slot, is counted apart from the other EVENTs. Watches the bus for sample commands and the USB for
// messages; the image knows nothing of it.
import fs from 'node:fs'

const SCHEMA = JSON.parse(fs.readFileSync(new URL('../../protocol/schema.json', import.meta.url)))
const FRAME_ID = SCHEMA.link.message.FRAME.id
const EVENT_ID = SCHEMA.link.message.EVENT.id
const TRUST = SCHEMA.link.enum.event_kind.TRUST.value
const REPLY_ID = SCHEMA.link.message.REPLY.id
const command = (name) => SCHEMA.sensor.channel.find((channel) => channel.name === name).command << 8
const SLOTS = SCHEMA.sensor.frame.slots
const SLOT_US = 1e6 / SCHEMA.sensor.bus.slot_hz
const MARK_AT = SLOTS.findIndex((name) => name !== 'PAC') // the first slot that comes once a round
const MARK = command(SLOTS[MARK_AT])
const LAST = command(SLOTS.findLast((name) => /^E\d+$/.test(name)))
const T_US_AT = 3 // in a FRAME: id, seq, then the time of the first slot; in an EVENT, of the slot that shows it
const FINGER_AT = T_US_AT + 4
const KIND_AT = FINGER_AT + 2 // of an EVENT
const HEAD_BYTES = KIND_AT + 1
const SAME_ROUND_US = 200 // t_us is read shortly before the command goes out
const ROUNDS = 8 // that are remembered: no FRAME is later than that

/** The first bytes of a COBS frame, decoded; shorter when the frame is. */
function head(encoded, wanted) {
  const out = []
  let at = 0
  while (at < encoded.length && out.length < wanted) {
    const code = encoded[at]
    out.push(...encoded.slice(at + 1, at + code))
    at += code
    if (code < 0xff && at < encoded.length) out.push(0)
  }
  return Uint8Array.from(out.slice(0, wanted))
}

export class Latency {
  constructor() {
    this.rounds = [] // [device us of the first slot, of the last electrode]
    this.unfinished = []
    this.us = [] // one a FRAME
    this.arrivals = [] // likewise [t_us, finger, device us with the host]
    this.askedUs = null // when bytes last went to the board
    this.replyUs = 0 // the longest
    this.events = 0
    this.eventUs = 0 // from an EVENT's slot until it is with the host, the longest
    this.trustUs = 0 // likewise of TRUST
    this.unmatched = 0 // FRAMEs of a round not seen on the bus
  }

  sampled(mosi, nanos) {
    if (mosi === MARK) {
      this.rounds.push([nanos / 1000 - MARK_AT * SLOT_US, null])
      if (this.rounds.length > ROUNDS) this.rounds.shift()
    } else if (mosi === LAST && this.rounds.length > 0) {
      this.rounds.at(-1)[1] = nanos / 1000
    }
  }

  /** Bytes have gone to the board. */
  asked(nanos) {
    this.askedUs = nanos / 1000
  }

  /** Bytes that the host has got by now. */
  received(bytes, nanos) {
    for (const byte of bytes) {
      if (byte !== 0) {
        this.unfinished.push(byte)
        continue
      }
      const start = head(this.unfinished, HEAD_BYTES)
      if (start.length === HEAD_BYTES && start[0] === FRAME_ID) this.#frame(start, nanos / 1000)
      if (start.length === HEAD_BYTES && start[0] === EVENT_ID) this.#event(start, nanos / 1000)
      if (start[0] === REPLY_ID && this.askedUs !== null) {
        this.replyUs = Math.max(this.replyUs, nanos / 1000 - this.askedUs)
        this.askedUs = null
      }
      this.unfinished = []
    }
  }

  counters() {
    const sorted = Float64Array.from(this.us).sort()
    const at = (share) => sorted[Math.floor(share * (sorted.length - 1))] ?? null
    const events = { events: this.events, event_us: this.eventUs, trust_us: this.trustUs }
    return { frames: sorted.length, unmatched: this.unmatched, ...events, reply_us: this.replyUs, median_us: at(0.5), p99_us: at(0.99), worst_us: at(1) }
  }

  #event(start, us) {
    const late = us - new DataView(start.buffer).getUint32(T_US_AT, true)
    this.events++
    if (start[KIND_AT] === TRUST) this.trustUs = Math.max(this.trustUs, late)
    else this.eventUs = Math.max(this.eventUs, late)
  }

  #frame(start, us) {
    const t_us = new DataView(start.buffer).getUint32(T_US_AT, true)
    this.arrivals.push([t_us, start[FINGER_AT], us])
    const round = this.rounds.find(([first]) => Math.abs((first % 2 ** 32) - t_us) < SAME_ROUND_US)
    if (!round || round[1] === null) {
      this.unmatched++
      return
    }
    this.us.push(us - round[1])
  }
}
