// Numbers and words. Every number also stands unrounded in data-value, for tests and other programs.

const MINUS = "−";
export const NONE = "–";

export function number(value, digits) {
  if (!Number.isFinite(value)) return NONE;
  const text = value.toFixed(digits);
  return Number(text) === 0 ? text.replace("-", "") : text.replace("-", MINUS);
}

export function age(ms) {
  const s = ms / 1000;
  if (s < 120) return `${s.toFixed(1)} s ago`;
  if (s < 7200) return `${Math.floor(s / 60)} min ago`;
  return `${Math.floor(s / 3600)} h ago`;
}

export const byId = (id) => document.getElementById(id);

// Writing what stands there already costs a layout all the same.
function write(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

function put(element, value, digits) {
  write(element, number(value, digits));
  element.dataset.value = String(value);
}

export function make(tag, properties = {}, data = {}) {
  const element = Object.assign(document.createElement(tag), properties);
  Object.assign(element.dataset, data);
  return element;
}

const VECTORS = [
  { key: "forceN", name: "Force", unit: "N", digits: 2 },
  { key: "appliedN", name: "Applied", unit: "N", digits: 2 },
  { key: "torqueNmm", name: "Torque", unit: "N·mm", digits: 1 },
  { key: "pocMm", name: "Contact", unit: "mm", digits: 2 },
];
const SCALARS = [
  { key: "pdc", name: "Pressure, count" },
  { key: "tac", name: "Flux, count" },
  { key: "celsius", name: "Temperature, °C", digits: 1 },
  { key: "slipLevel", name: "Slip, count" },
];

export class Results {
  constructor(about) {
    [this.trusts, this.thermistor] = [about.trust, about.thermistor];
    const table = byId("results");
    table.replaceChildren();
    this.cells = VECTORS.map(({ key, name, unit }) => {
      const row = make("tr");
      const cells = ["x", "y", "z"].map((axis) => make("td", {}, { key, axis }));
      row.append(make("th", { scope: "row", textContent: name }), ...cells, make("td", { textContent: unit }));
      table.append(row);
      return cells;
    });
    this.scalars = pairs(byId("scalars"), [...SCALARS, { key: "seq", name: "Frame" }]);
    const list = byId("electrodes");
    list.replaceChildren();
    this.electrodes = about.electrodes.map(({ name }) => {
      const item = make("li");
      const value = make("span", {}, { electrode: name });
      item.append(make("b", { textContent: name }), value);
      list.append(item);
      return value;
    });
  }

  show(frame) {
    const panel = byId("numbers");
    panel.dataset.seq = frame.seq;
    panel.dataset.finger = frame.finger;
    panel.dataset.flags = frame.flags;
    VECTORS.forEach(({ key, digits }, row) => frame[key].forEach((v, k) => put(this.cells[row][k], v, digits)));
    for (const element of [this.cells[1][0].parentNode, byId("applied-key")]) element.hidden = Number.isNaN(frame.appliedN[0]);
    const { a, b, beta_k, full_scale } = this.thermistor; // biotac.features.thermal has the formula's source
    const celsius = frame.tdc < 1 ? NaN : beta_k / Math.log((full_scale * a) / frame.tdc - b) - 273.15;
    for (const { key, digits = 0 } of SCALARS) put(this.scalars[key], { ...frame, celsius }[key], digits);
    this.scalars.slipLevel.dataset.kind = frame.slipLevel > 0 ? "warn" : "calm";
    put(this.scalars.seq, frame.seq, 0);
    this.showTrust(frame.trust);
    ["normalN", "shearN"].forEach((key, k) => {
      const [value, half] = frame.gripN.slice(2 * k);
      const place = document.querySelector(`.grip[data-key=${key}]`);
      write(place, `${number(value, 2)} ± ${number(half, 2)}`);
      [place.dataset.value, place.dataset.half] = [value, half];
    });
    this.electrodes.forEach((cell, k) => put(cell, frame.signal ? frame.signal[k] : NaN, 0));
  }

  showTrust(trust) {
    const { name, words } = this.trusts[trust];
    const chip = byId("trust");
    write(chip, `trust: ${name}`);
    chip.dataset.kind = { NONE: "warn", HOLD: "warn", ACT: "on" }[name] ?? "calm";
    write(byId("trust-words"), words);
  }
}

// A description list's values by their keys.
function pairs(list, rows) {
  list.replaceChildren();
  return Object.fromEntries(rows.map(({ key, name }) => {
    const value = make("dd", {}, { key });
    list.append(make("dt", { textContent: name }), value);
    return [key, value];
  }));
}

export class Flags {
  constructor(about) {
    this.flags = about.flags;
    this.contact = about.flags.find(({ name }) => name === "CONTACT").mask;
    this.shown = null;
  }

  show(flags) {
    if (flags === this.shown) return;
    this.shown = flags;
    const atRest = (name) => name === "OUTSIDE" && !(flags & this.contact); // it is set then, and warns of nothing
    const active = this.flags.filter(({ name, mask }) => flags & mask && !atRest(name));
    const items = (wanted) => active.filter(({ warns }) => warns === wanted).map(({ name, words, warns }) => {
      const item = make("li", {}, { flag: name, kind: warns ? "warn" : "calm" });
      item.append(make("b", { textContent: name.replaceAll("_", " ") }), words);
      return item;
    });
    byId("flags").replaceChildren(...items(true));
    byId("notices").replaceChildren(...items(false));
  }
}

// Which electrodes results do without and why, and what is wrong with the sensor.
export function showFaults(about, facts) {
  const out = about.electrodes.filter((_, k) => (facts?.electrodes_out >> k) & 1).map(({ name }) => name);
  const words = out.length ? [`${out.join(", ")}: ${about.sensor_faults[facts.electrode_fault]}.`] : [];
  if (facts?.sensor_fault) words.push(`Sensor: ${about.sensor_faults[facts.sensor_fault]}.`);
  write(byId("fault-words"), words.join(" "));
}

export function showTare(about, facts) {
  const state = about.tare_states[facts?.tare_state];
  const reason = about.tare_reasons[facts?.tare_reason];
  const chip = byId("tare-state");
  write(chip, state?.name ?? "unknown");
  chip.dataset.kind = !state || ["INIT", "FAULT"].includes(state.name) ? "warn" : "calm";
  write(byId("tare-words"), state?.words ?? "not reported by the board yet");
  const known = facts && "tare_age_ms" in facts && facts.tare_reason !== undefined;
  const tared = known && facts.tare_reason !== 0;
  byId("tare-age").dataset.value = tared ? facts.tare_age_ms : "";
  write(byId("tare-age"), tared ? `${age(facts.tare_age_ms)}:` : "");
  write(byId("tare-reason"), reason?.words ?? "");
}

const HEALTH = [
  { key: "framesPerS", name: "Frames per second", of: (health) => health.frames_per_s },
  { key: "lost", name: "Frames lost", warns: true, of: ({ stats }) => stats.frames_lost },
  { key: "crc", name: "CRC errors", warns: true, of: ({ stats }) => stats.crc_errors },
  { key: "other", name: "Other wire errors", warns: true, of: ({ stats }) => stats.other_errors },
  { key: "late", name: "Late slots on the board", warns: true, of: ({ status }) => status.slots_late },
  { key: "boardDropped", name: "Messages dropped by the board", warns: true, of: ({ status }) => status.messages_dropped },
  { key: "dropped", name: "Frames not drawn by this page", of: (_, dropped) => dropped },
];

export class Link {
  constructor() {
    this.values = pairs(byId("health"), HEALTH);
  }

  show(health, dropped) {
    for (const { key, warns, of } of HEALTH) {
      const value = of(health, dropped);
      put(this.values[key], value, 0);
      this.values[key].dataset.kind = warns && value > 0 ? "warn" : "calm";
    }
    write(byId("board"), health.board);
    write(byId("source"), health.source);
  }
}

export function showLink(link, words, isSilent = false) {
  byId("link").dataset.link = link;
  write(byId("link-words"), words);
  const stale = isSilent || !["live", "playing", "paused", "over"].includes(link);
  document.body.toggleAttribute("data-stale", stale);
}

export function showReply(words, good = true) {
  const place = byId("reply");
  place.dataset.kind = good ? "good" : "bad";
  write(place, words);
}
