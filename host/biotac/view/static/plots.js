// Plots over time and over frequency.

import { fit } from "./fingertip.js";
import { rgb } from "./colours.js";
import { COLUMNS, HISTORY_S, zoom } from "./model.js";

const MARGIN = { left: 46, right: 10, top: 16, bottom: 22 }; // the top holds the marks' texts, off the lines
const TRUST_STEP = 4, TRUST_HEIGHT = 14; // pixels: of the band below the force
const GAP_S = 0.05; // a line breaks where frames are missing
const DASHES = { y: [7, 4], z: [2, 3] }; // by colour, for whoever does not see it; the others are drawn through
const FONT = '11px system-ui, "DejaVu Sans", sans-serif';

// A plot's frame: where it is, and how values become pixels.
class Area {
  constructor(canvas) {
    fit(canvas);
    this.c = canvas.getContext("2d");
    const ratio = devicePixelRatio;
    this.c.setTransform(ratio, 0, 0, ratio, 0, 0);
    this.c.font = FONT;
    this.c.clearRect(0, 0, canvas.clientWidth, canvas.clientHeight);
    this.left = MARGIN.left;
    this.right = canvas.clientWidth - MARGIN.right;
    this.top = MARGIN.top;
    this.bottom = canvas.clientHeight - MARGIN.bottom;
  }

  x(share) {
    return this.left + share * (this.right - this.left);
  }

  y(share) {
    return this.bottom - share * (this.bottom - this.top);
  }

  tick(theme, { x, y, text }) {
    const { c } = this;
    c.strokeStyle = theme.grid;
    c.lineWidth = 1;
    c.beginPath();
    if (y !== undefined) {
      c.moveTo(this.left, Math.round(y) + 0.5);
      c.lineTo(this.right, Math.round(y) + 0.5);
    } else {
      c.moveTo(Math.round(x) + 0.5, this.top);
      c.lineTo(Math.round(x) + 0.5, this.bottom);
    }
    c.stroke();
    c.fillStyle = theme.quiet;
    c.textAlign = y !== undefined ? "right" : "center";
    c.textBaseline = y !== undefined ? "middle" : "top";
    if (y !== undefined) c.fillText(text, this.left - 6, y);
    else c.fillText(text, Math.min(Math.max(x, this.left + 10), this.right - 14), this.bottom + 6);
  }

  timeTicks(theme) {
    const step = zoom.s / 5;
    for (let k = -5; k <= 0; k++) this.tick(theme, { x: this.x(1 + k / 5), text: k ? `−${Number((-k * step).toFixed(1))}` : "0 s" });
  }
}

export class TimePlot {
  // lines: functions from a frame to a value; wide: those drawn behind them; colours: of both in the theme; least: the smallest
  // span shown; halves: to the half width of the band about each line
  constructor(canvas, lines, colours, { least, digits, zero, wide = [], halves = [], trust = false }) {
    Object.assign(this, { canvas, lines, colours, least, digits, zero, wide, halves, trust });
  }

  // marks: events of this finger, { t_us, name }
  draw(finger, theme, marks = []) {
    const area = new Area(this.canvas);
    const { c } = area;
    const endS = finger?.latest?.tS ?? 0;
    const shown = (finger?.frames ?? []).filter(({ tS }) => endS - tS <= zoom.s);
    const [low, high] = this.span(shown);
    area.timeTicks(theme);
    if (this.trust) this.band(area, theme, shown, endS);
    const step = niceStep((high - low) / 4);
    for (let v = Math.ceil(low / step) * step; v <= high; v += step) {
      area.tick(theme, { y: area.y((v - low) / (high - low)), text: v.toFixed(step < 1 ? this.digits : 0).replace("-", "−") });
    }
    let free = area.right; // the newest comes first; a text that would reach into it is left out
    for (const mark of marks.toReversed()) free = this.mark(area, theme, 1 - (endS - mark.t_us / 1e6) / zoom.s, mark.name, free);
    c.lineJoin = "round";
    this.halves.forEach((halfOf, line) => {
      [c.strokeStyle, c.lineWidth, c.globalAlpha] = [theme[this.colours[line]], 2, 0.15];
      c.beginPath();
      for (const frame of shown) {
        const [v, half] = [this.lines[line](frame), halfOf(frame)];
        if (Number.isNaN(half)) continue;
        const x = area.x(1 - (endS - frame.tS) / zoom.s);
        for (const end of [v - half, v + half]) c[end < v ? "moveTo" : "lineTo"](x, area.y(Math.min(Math.max((end - low) / (high - low), 0), 1)));
      }
      c.stroke();
    });
    [...this.wide, ...this.lines].forEach((value, k) => {
      const line = k % this.lines.length;
      const wide = k < this.wide.length;
      c.strokeStyle = theme[this.colours[line]];
      [c.lineWidth, c.globalAlpha] = wide ? [7, 0.3] : [1.75, 1];
      c.setLineDash((!wide && DASHES[this.colours[line]]) || []);
      c.beginPath();
      let before = -Infinity;
      for (const frame of shown) {
        const v = value(frame);
        if (Number.isNaN(v)) {
          before = -Infinity;
          continue;
        }
        const x = area.x(1 - (endS - frame.tS) / zoom.s);
        const y = area.y((v - low) / (high - low));
        if (frame.tS - before > GAP_S) c.moveTo(x, y);
        else c.lineTo(x, y);
        before = frame.tS;
      }
      c.stroke();
    });
    c.setLineDash([]);
  }

  // Below the lines, in room of their own: where the force is not to be acted on as it is; NONE is the highest.
  band(area, theme, shown, endS) {
    const { c } = area;
    c.fillStyle = theme.warn;
    for (const { tS, trust } of shown) {
      const height = TRUST_STEP * (3 - trust);
      if (height > 0) c.fillRect(area.x(1 - (endS - tS) / zoom.s), area.bottom - height, 1.5, height);
    }
    area.bottom -= TRUST_HEIGHT;
  }

  // Returns where it begins, in pixels.
  mark(area, theme, share, words, free) {
    if (share < 0 || share > 1) return free;
    const { c } = area;
    const x = Math.round(area.x(share)) + 0.5;
    c.strokeStyle = c.fillStyle = words === "slip" ? theme.warn : theme.quiet;
    c.lineWidth = words === "slip" ? 2 : 1;
    c.beginPath();
    c.moveTo(x, 2);
    c.lineTo(x, area.bottom);
    c.stroke();
    c.textAlign = "left";
    c.textBaseline = "top";
    if (x + 5 + c.measureText(words).width <= free) c.fillText(words, x + 3, 2);
    return x;
  }

  span(shown) {
    let low = Infinity, high = -Infinity;
    [...this.lines, ...this.wide].forEach((value, line) => {
      const halfOf = this.halves[line];
      for (const frame of shown) {
        const v = value(frame);
        const top = v + (halfOf?.(frame) || 0);
        if (v < low) low = v;
        if (top > high) high = top;
      }
    });
    if (low > high) return [-this.least / 2, this.least / 2];
    if (this.zero) [low, high] = [Math.min(low, 0), Math.max(high, 0)];
    const lack = Math.max(0, this.least - (high - low));
    const air = (high - low) * 0.06;
    return [low - lack / 2 - air, high + lack / 2 + air];
  }
}

const DECADES = [-2, 3]; // of the amplitude in Pa

// values: amplitudes in Pa from 0 to half of rateHz, or null
export function drawSpectrum(canvas, values, rateHz, theme) {
  const area = new Area(canvas);
  const { c } = area;
  const [low, high] = DECADES;
  const share = (v) => Math.max(0, Math.min(1, (Math.log10(v) - low) / (high - low)));
  for (let d = low; d <= high; d++) {
    area.tick(theme, { y: area.y((d - low) / (high - low)), text: d < 0 ? (10 ** d).toFixed(-d) : String(10 ** d) });
  }
  const top = rateHz / 2;
  for (let hz = 0; hz <= top; hz += 200) area.tick(theme, { x: area.x(hz / top), text: hz ? String(hz) : "0 Hz" });
  if (!values) return;
  c.beginPath();
  values.forEach((v, k) => c.lineTo(area.x(k / (values.length - 1)), area.y(share(v))));
  c.strokeStyle = theme.accent;
  c.lineWidth = 1.5;
  c.stroke();
  c.lineTo(area.right, area.bottom);
  c.lineTo(area.left, area.bottom);
  c.closePath();
  c.globalAlpha = 0.18;
  c.fillStyle = theme.accent;
  c.fill();
  c.globalAlpha = 1;
}

// Amplitude over time and frequency: the stronger, the more colour.
export class SpectrogramPlot {
  constructor(canvas) {
    this.canvas = canvas;
    this.picture = document.createElement("canvas");
    this.painted = []; // the newest column, and the colour: a change of either means painting anew
  }

  draw(finger, rateHz, paPerCount, theme) {
    const area = new Area(this.canvas);
    const { c } = area;
    const top = rateHz / 2;
    const columns = finger?.spectrogram ?? [];
    if (columns.length) {
      const wanted = [columns.at(-1), theme.accent];
      if (wanted.some((one, k) => one !== this.painted[k])) this.paint(columns, paPerCount, rgb(theme.accent));
      this.painted = wanted;
      c.imageSmoothingEnabled = false;
      const from = COLUMNS * (1 - zoom.s / HISTORY_S);
      c.drawImage(this.picture, from, 0, COLUMNS - from, this.picture.height, area.left, area.top, area.right - area.left, area.bottom - area.top);
    }
    for (let hz = 0; hz <= top; hz += 250) area.tick(theme, { y: area.y(hz / top), text: hz ? String(hz) : "0 Hz" });
    area.timeTicks(theme);
  }

  paint(columns, paPerCount, colour) {
    const [low, high] = DECADES;
    const rows = columns[0].values.length;
    const endS = columns.at(-1).t;
    this.picture.width = COLUMNS;
    this.picture.height = rows;
    const c = this.picture.getContext("2d");
    const image = c.createImageData(COLUMNS, rows);
    const { data } = image;
    for (const { t, values } of columns) {
      const x = COLUMNS - 1 - Math.round(((endS - t) / HISTORY_S) * COLUMNS);
      if (x < 0) continue;
      values.forEach((v, k) => {
        const share = (Math.log10(v * paPerCount) - low) / (high - low);
        const at = 4 * ((rows - 1 - k) * COLUMNS + x);
        [data[at], data[at + 1], data[at + 2]] = colour;
        data[at + 3] = 255 * share; // which bounds it
      });
    }
    c.putImageData(image, 0, 0);
  }
}

function niceStep(raw) {
  const power = 10 ** Math.floor(Math.log10(raw));
  return [1, 2, 5, 10].find((m) => m * power >= raw) * power;
}
