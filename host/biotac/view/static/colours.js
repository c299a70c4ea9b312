// Colours as numbers, read from the style sheet so that a theme is written down once.

const NAMES = ["text", "quiet", "card", "x", "y", "z", "point", "grid", "skin-edge", "rest", "compressed", "bulged", "accent"];

export function readTheme() {
  const style = getComputedStyle(document.documentElement);
  const theme = {};
  for (const name of NAMES) theme[name] = style.getPropertyValue(`--${name}`).trim();
  theme.scale = [theme.compressed, theme.rest, theme.bulged].map(rgb);
  return theme;
}

function rgb(hex) {
  return [1, 3, 5].map((at) => parseInt(hex.slice(at, at + 2), 16));
}

// share: -1 fully compressed to 1 fully bulged. Writes three bytes into out.
export function mix(scale, share, out, at) {
  const [low, rest, high] = scale;
  const end = share < 0 ? low : high;
  const s = Math.min(Math.abs(share), 1);
  for (let k = 0; k < 3; k++) out[at + k] = rest[k] + (end[k] - rest[k]) * s;
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
