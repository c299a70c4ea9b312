// One fingertip on a canvas: the skin laid flat, the electrodes, the point of contact and the load there.

import { shade } from "./colours.js";

// The picture's edges in mm; the canvas has the shape of their ratio (style.css).
const LEFT = -9.5, RIGHT = 9.5, TOP = 9.8, BOTTOM = -17.2;
const SKIN = new Path2D("M -8.6 0 A 8.6 9 0 0 0 8.6 0 V -14.4 Q 8.6 -16.4 6.6 -16.4 H -6.6 Q -8.6 -16.4 -8.6 -14.4 Z");
const FIELD_W = 38, FIELD_H = 54;
const REACH_MM = 2.3; // of an electrode's colour
const REST_WEIGHT = 0.12; // far from every electrode the skin has the colour of rest
const ARROW_MM_PER_N = 2.2, RING_MM_PER_SQRT_N = 1.25, LONGEST_MM = 8;
const LIGHT_N = 0.1, LIGHT_NMM = 2; // less is noise
const FULL_NMM = 40; // of torque z: half a turn

export class Fingertip {
  constructor(canvas, electrodes, { large }) {
    this.canvas = canvas;
    this.large = large;
    this.electrodes = electrodes;
    this.context = canvas.getContext("2d");
    this.field = Object.assign(document.createElement("canvas"), { width: FIELD_W, height: FIELD_H });
    this.fieldContext = this.field.getContext("2d");
    this.pixels = this.fieldContext.createImageData(FIELD_W, FIELD_H);
    this.words = new Uint32Array(this.pixels.data.buffer);
    this.weights = weigh(electrodes);
  }

  draw(finger, theme, limit) {
    const scale = fit(this.canvas, RIGHT - LEFT);
    const c = this.context;
    c.clearRect(0, 0, this.canvas.width, this.canvas.height);
    c.save();
    c.scale(scale, -scale);
    c.translate(-LEFT, -TOP);
    const frame = finger?.latest;
    const signal = frame?.signal ?? null;
    c.save();
    c.clip(SKIN);
    this.drawField(signal, theme, limit);
    c.restore();
    c.lineWidth = (this.large ? 2 : 1.5) / scale * devicePixelRatio;
    c.strokeStyle = theme["skin-edge"];
    c.stroke(SKIN);
    this.drawElectrodes(signal, theme, limit, scale);
    if (frame?.mapMm && frame.touched) this.drawContact(finger, frame, theme, scale);
    if (this.large) this.drawNumbers(signal, theme, limit); // last: nothing hides them
    c.restore();
  }

  drawField(signal, theme, limit) {
    const { weights, words } = this;
    const { pixels } = theme.shades;
    const shares = this.electrodes.map((_, k) => (signal?.[k] || 0) / limit);
    const n = shares.length;
    for (let p = 0, at = 0; p < words.length; p++) {
      let sum = 0;
      for (let k = 0; k < n; k++, at++) sum += weights[at] * shares[k];
      words[p] = pixels[shade(sum)];
    }
    this.fieldContext.putImageData(this.pixels, 0, 0);
    const c = this.context;
    c.imageSmoothingEnabled = true;
    c.save();
    c.translate(LEFT, TOP);
    c.scale(1, -1);
    c.drawImage(this.field, 0, 0, RIGHT - LEFT, TOP - BOTTOM);
    c.restore();
  }

  drawElectrodes(signal, theme, limit, scale) {
    const c = this.context;
    const radius = this.large ? 0.82 : 0.75;
    c.lineWidth = (this.large ? 1.4 : 1) / scale * devicePixelRatio;
    for (const { a, b, dead, colour } of this.shown(signal, theme, limit)) {
      disc(c, a, b, radius);
      c.fillStyle = dead ? theme.card : `rgb(${colour.join(",")})`;
      c.fill();
      c.strokeStyle = theme["skin-edge"];
      c.setLineDash(dead ? [0.3, 0.3] : []);
      c.stroke();
      c.setLineDash([]);
    }
  }

  drawNumbers(signal, theme, limit) {
    for (const { a, b, name, dead, colour: [red, green, blue] } of this.shown(signal, theme, limit)) {
      const bright = red * 0.299 + green * 0.587 + blue * 0.114 > 140;
      label(this.context, dead ? "×" : name.slice(1), a, b, 0.92, dead ? theme.quiet : bright ? "#171b22" : "#ffffff");
    }
  }

  // Each electrode: place, colour, and whether it is missing from a frame.
  shown(signal, theme, limit) {
    return this.electrodes.map(({ across_mm: a, along_mm: b, name }, k) => {
      const value = signal ? signal[k] : NaN;
      const at = 4 * shade(Number.isNaN(value) ? 0 : value / limit);
      return { a, b, name, dead: signal && Number.isNaN(value), colour: theme.shades.bytes.subarray(at, at + 3) };
    });
  }

  drawContact(finger, frame, theme, scale) {
    const c = this.context;
    const [a, b] = frame.mapMm;
    const [xN, yN, zN] = frame.forceN;
    const torqueZ = frame.torqueNmm[2];
    const width = ((this.large ? 3 : 2) * devicePixelRatio) / scale;
    const spot = this.large ? 0.65 : 0.45; // a ring around an electrode's number; a dot where there are none
    if (this.large) this.drawTrail(finger.trail, theme, a, b, spot);
    halo(c, theme, width, () => {
      if (zN > LIGHT_N) {
        disc(c, a, b, Math.min(RING_MM_PER_SQRT_N * Math.sqrt(zN), LONGEST_MM / 2));
        c.stroke();
      }
      disc(c, a, b, spot);
      c.stroke();
    });
    if (!this.large) {
      c.fillStyle = theme.point;
      disc(c, a, b, spot);
      c.fill();
    }
    // Seen from the palm's side x points up and y to the right, as on the map.
    const sideN = Math.hypot(xN, yN);
    if (sideN > LIGHT_N) {
      const mmPerN = Math.min(ARROW_MM_PER_N, LONGEST_MM / sideN);
      const from = this.large ? Math.min(spot / sideN, mmPerN / 2) : 0; // the ring's rim
      halo(c, theme, width, () => arrow(c, a + yN * from, b + xN * from, a + yN * mmPerN, b + xN * mmPerN));
    }
    if (this.large && Math.abs(torqueZ) > LIGHT_NMM) {
      // z points away from a viewer of the palm's side: a positive turn, x to y, is clockwise.
      const turn = -Math.max(-1, Math.min(1, torqueZ / FULL_NMM)) * 0.9 * Math.PI;
      halo(c, theme, width * 0.8, () => arc(c, 0, 0, 7.2, turn));
    }
  }

  drawTrail(trail, theme, a, b, free) {
    const c = this.context;
    c.fillStyle = theme.point;
    trail.forEach((place, k) => {
      if (!place || Math.hypot(place[0] - a, place[1] - b) < free) return; // inside of the ring is a number's place
      c.globalAlpha = (k / trail.length) * 0.35;
      disc(c, place[0], place[1], 0.18);
      c.fill();
    });
    c.globalAlpha = 1;
  }
}

function weigh(electrodes) {
  const n = electrodes.length;
  const weights = new Float32Array(FIELD_W * FIELD_H * n);
  for (let row = 0; row < FIELD_H; row++) {
    for (let col = 0; col < FIELD_W; col++) {
      const a = LEFT + ((col + 0.5) / FIELD_W) * (RIGHT - LEFT);
      const b = TOP - ((row + 0.5) / FIELD_H) * (TOP - BOTTOM);
      const near = electrodes.map((e) => Math.exp(-((e.across_mm - a) ** 2 + (e.along_mm - b) ** 2) / (2 * REACH_MM ** 2)));
      const sum = near.reduce((x, y) => x + y, REST_WEIGHT);
      near.forEach((w, k) => (weights[(row * FIELD_W + col) * n + k] = w / sum));
    }
  }
  return weights;
}

// Sizes a canvas to the place it has, in device pixels; returns pixels per unit of width.
export function fit(canvas, units = 1) {
  const ratio = devicePixelRatio;
  const width = Math.round(canvas.clientWidth * ratio);
  const height = Math.round(canvas.clientHeight * ratio);
  if (canvas.width !== width || canvas.height !== height) {
    canvas.width = width;
    canvas.height = height;
  }
  return width / units;
}

function disc(c, x, y, radius) {
  c.beginPath();
  c.arc(x, y, radius, 0, 2 * Math.PI);
}

function label(c, text, x, y, size, colour) {
  c.save();
  c.translate(x, y);
  c.scale(1, -1);
  c.font = `600 ${size}px system-ui, "DejaVu Sans", sans-serif`;
  c.textAlign = "center";
  c.textBaseline = "middle";
  c.fillStyle = colour;
  c.fillText(text, 0, 0.05);
  c.restore();
}

// Draws twice: first broad in the card's colour, so that it can be seen on any skin.
function halo(c, theme, width, draw) {
  c.lineCap = c.lineJoin = "round";
  c.lineWidth = width * 2.2;
  c.strokeStyle = theme.card;
  draw();
  c.lineWidth = width;
  c.strokeStyle = theme.point;
  draw();
}

function head(c, x, y, angle, size) {
  c.beginPath();
  for (const side of [2.6, -2.6]) {
    c.moveTo(x, y);
    c.lineTo(x + size * Math.cos(angle + side), y + size * Math.sin(angle + side));
  }
  c.stroke();
}

function arrow(c, x0, y0, x1, y1) {
  c.beginPath();
  c.moveTo(x0, y0);
  c.lineTo(x1, y1);
  c.stroke();
  head(c, x1, y1, Math.atan2(y1 - y0, x1 - x0), Math.min(1.2, Math.hypot(x1 - x0, y1 - y0) * 0.6));
}

function arc(c, x, y, radius, turn) {
  const begin = Math.PI / 2;
  c.beginPath();
  c.arc(x, y, radius, begin, begin + turn, turn < 0);
  c.stroke();
  const end = begin + turn;
  head(c, x + radius * Math.cos(end), y + radius * Math.sin(end), end + (turn > 0 ? 1 : -1) * (Math.PI / 2), 1.1);
}
