// Colours as numbers, read from the style sheet so that a theme is written down once.

const NAMES = ["text", "quiet", "card", "x", "y", "z", "point", "grid", "skin-edge", "rest", "compressed", "bulged", "accent", "warn"];

export function readTheme() {
  const style = getComputedStyle(document.documentElement);
  const theme = {};
  for (const name of NAMES) theme[name] = style.getPropertyValue(`--${name}`).trim();
  theme.shades = table([theme.compressed, theme.rest, theme.bulged].map(rgb));
  return theme;
}

export function rgb(hex) {
  return [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
}

// A theme's scale as a table of pixels (RGBA in memory's order), mixed once: half a million are looked up a second.
const SHADES = 511; // odd: the middle one is rest

function table([low, rest, high]) {
  const bytes = new Uint8ClampedArray(SHADES * 4);
  for (let k = 0; k < SHADES; k++) {
    const share = (2 * k) / (SHADES - 1) - 1;
    const end = share < 0 ? low : high;
    for (let j = 0; j < 3; j++) bytes[4 * k + j] = rest[j] + (end[j] - rest[j]) * Math.abs(share);
    bytes[4 * k + 3] = 255;
  }
  return { pixels: new Uint32Array(bytes.buffer), bytes };
}

// Index of a shade; share: -1 fully compressed to 1 fully bulged.
export function shade(share) {
  const index = ((share + 1) * (SHADES - 1)) / 2 + 0.5;
  return index < 0 ? 0 : index >= SHADES ? SHADES - 1 : index | 0;
}

// The colour scale's end in counts: grows at once, shrinks only after a while, in steps that can be read.
export class Limit {
  constructor() {
    this.counts = STEPS[0];
    this.seenMs = 0;
  }

  follow(largest, nowMs) {
    const wanted = STEPS.find((step) => step >= largest) ?? STEPS.at(-1);
    if (wanted >= this.counts) {
      this.counts = wanted;
      this.seenMs = nowMs;
    } else if (nowMs - this.seenMs > HOLD_MS) {
      this.counts = wanted;
    }
  }
}

const STEPS = [20, 50, 100, 200, 500, 1000, 2000, 4095];
const HOLD_MS = 8000;
