// The stream, finger by finger: the latest frame and ten seconds of history, in users' units.

import { amplitudes } from "./spectrum.js";

export const HISTORY_S = 10;
export const zoom = { s: HISTORY_S }; // of history, in the charts
export const SPECTRUM_SAMPLES = 1024;
const STALE_MS = 500; // the slowest news of a healthy board are some 100 ms apart on a busy computer
const HISTORY_ROWS = 1100; // a little more than HISTORY_S of frames
const TRAIL_POINTS = 40;
const COLUMN_SAMPLES = 128; // of the spectrogram: 58 ms
const COLUMN_BLOCKS = 5; // of 10 ms, from one to the next
export const COLUMNS = HISTORY_S * 20;

export class Model {
  constructor(about) {
    this.about = about;
    this.column = Object.fromEntries(about.frame_row.map((name, k) => [name, k]));
    this.fingers = new Map();
    this.health = null;
    this.dropped = 0;
    this.beganMs = this.newestMs = performance.now(); // of this playing, and of the newest frame, by the browser's clock
    this.aheadMs = Infinity; // of the viewer program's clock, as far as the fastest news tell
    this.lateMs = 0; // how much slower the latest news were: behind a slow line they are old
  }

  // Whether a finger stands still, by now or, in a paused recording, beside the others: then the last force is old.
  isSilent(index) {
    const nowMs = this.health?.live ? performance.now() : this.newestMs;
    return nowMs - (this.fingers.get(index)?.addedMs ?? this.beganMs) > STALE_MS;
  }

  finger(index) {
    if (!this.fingers.has(index)) this.fingers.set(index, new Finger());
    return this.fingers.get(index);
  }

  update(news) {
    const health = news.health;
    const apartMs = performance.now() - news.sent_ms;
    this.aheadMs = Math.min(this.aheadMs, apartMs);
    this.lateMs = apartMs - this.aheadMs;
    if (health) {
      if (this.health && this.health.epoch !== health.epoch) { // another playing has begun
        this.fingers.clear();
        this.beganMs = performance.now();
      }
      this.health = health;
    }
    for (const row of news.frames) {
      const frame = this.inUnits(row);
      this.finger(frame.finger).add(frame);
      this.newestMs = performance.now();
    }
    // A finger is there once it has sent a frame.
    for (const [finger, , tUs, pac] of news.pac) this.fingers.get(finger)?.addPac(tUs / 1e6, pac);
    this.dropped = news.dropped;
  }

  // A frame of a row; without values, of an empty one.
  inUnits(row) {
    const { column, about } = this;
    const scaled = (name, scale = name) => {
      const values = row[column[name]];
      return values ? values.map((v) => (v === null ? NaN : v / about.scales[scale])) : null;
    };
    const plain = (name) => row[column[name]] ?? NaN;
    return {
      finger: plain("finger"),
      seq: plain("seq"),
      tS: row[column.t_us] / 1e6,
      flags: row[column.flags] ?? 0,
      trust: row[column.trust] ?? 0,
      signal: scaled("signal_q4"),
      pdc: plain("pdc"),
      tac: plain("tac"),
      tdc: plain("tdc"),
      slipLevel: plain("slip_level"),
      pocMm: scaled("poc_um") ?? [NaN, NaN, NaN],
      forceN: scaled("force_100un") ?? [NaN, NaN, NaN],
      appliedN: scaled("applied_100un", "force_100un") ?? [NaN, NaN, NaN],
      gripN: scaled("grip_mn") ?? [NaN, NaN, NaN, NaN],
      torqueNmm: scaled("torque_mnmm") ?? [NaN, NaN, NaN],
      mapMm: row[column.map_um]?.map((um) => um / about.scales.poc_um) ?? null,
    };
  }
}

export class Finger {
  constructor() {
    this.latest = null;
    this.addedMs = 0; // when the latest came, by the browser's clock
    this.frames = []; // HISTORY_ROWS of them, oldest first
    this.pac = new Float64Array(SPECTRUM_SAMPLES);
    this.pacSamples = 0;
    this.spectrogram = []; // { t, values }: amplitudes of counts, oldest first
    this.trail = [];
  }

  add(frame) {
    this.latest = frame;
    this.addedMs = performance.now();
    this.frames.push(frame);
    if (this.frames.length > HISTORY_ROWS) this.frames.shift();
    this.trail.push(frame.mapMm);
    if (this.trail.length > TRAIL_POINTS) this.trail.shift();
  }

  addPac(t, samples) {
    const n = samples.length;
    this.pac.copyWithin(0, n);
    for (let k = 0; k < n; k++) {
      // A missing sample repeats the one before it: a hole would be a click at all frequencies.
      const at = SPECTRUM_SAMPLES - n + k;
      this.pac[at] = samples[k] ?? this.pac[at - 1];
    }
    this.pacSamples += n;
    if (this.pacSamples < COLUMN_SAMPLES || (this.pacSamples / n) % COLUMN_BLOCKS) return;
    this.spectrogram.push({ t, values: amplitudes(this.pac.slice(-COLUMN_SAMPLES)) });
    if (this.spectrogram.length > COLUMNS) this.spectrogram.shift();
  }

  get pacIsFull() {
    return this.pacSamples >= SPECTRUM_SAMPLES;
  }
}
