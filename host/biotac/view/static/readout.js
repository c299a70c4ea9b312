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

// Writing the same text again still costs a layout.
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

// Digits after the point, by data-key of the page.
const VECTORS = { forceN: 2, appliedN: 2, torqueNmm: 1, pocMm: 2 };
const SCALARS = { pdc: 0, tac: 0, celsius: 1, slipLevel: 0, seq: 0 };

const cell = (key, axis) => document.querySelector(axis ? `[data-key=${key}][data-axis=${axis}]` : `[data-key=${key}]`);

export class Results {
  constructor(about) {
    [this.trusts, this.thermistor] = [about.trust, about.thermistor];
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
    for (const [key, digits] of Object.entries(VECTORS)) frame[key].forEach((v, k) => put(cell(key, "xyz"[k]), v, digits));
    for (const id of ["applied", "applied-key"]) byId(id).hidden = Number.isNaN(frame.appliedN[0]);
    const { a, b, beta_k, full_scale } = this.thermistor; // biotac_lab.features.thermal has the formula's source
    const celsius = frame.tdc < 1 ? NaN : beta_k / Math.log((full_scale * a) / frame.tdc - b) - 273.15;
    for (const [key, digits] of Object.entries(SCALARS)) put(cell(key), { ...frame, celsius }[key], digits);
    cell("slipLevel").dataset.kind = frame.slipLevel > 0 ? "warn" : "calm";
    this.showTrust(frame.trust);
    ["normalN", "shearN"].forEach((key, k) => {
      const [value, half] = frame.gripN.slice(2 * k);
      const place = cell(key);
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

// The electrodes that results do without, with the reasons, and the sensor's faults.
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

// By data-key; those with data-warns are to be 0.
const HEALTH = {
  framesPerS: (health) => health.frames_per_s,
  lost: ({ stats }) => stats.frames_lost,
  crc: ({ stats }) => stats.crc_errors,
  other: ({ stats }) => stats.other_errors,
  late: ({ status }) => status.slots_late,
  boardDropped: ({ status }) => status.messages_dropped,
  dropped: (_, dropped) => dropped,
};

export function showHealth(health, dropped) {
  for (const [key, of] of Object.entries(HEALTH)) {
    const value = of(health, dropped);
    put(cell(key), value, 0);
    cell(key).dataset.kind = cell(key).hasAttribute("data-warns") && value > 0 ? "warn" : "calm";
  }
  write(byId("board"), health.board);
  write(byId("source"), health.source);
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
