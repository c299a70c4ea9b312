// Buttons and keys. A key does what its button does, and is refused when that is.

import { byId, make } from "./readout.js";

const KEYS = [
  ["T", "tare the finger shown"],
  ["A", "tare all fingers"],
  ["R", "start or stop a recording"],
  ["M", "mark this moment in the recording"],
  ["P", "pause or resume"],
  ["I", "save a picture of the charts"],
  ["S", "save what the charts show of a recording"],
  ["G", "play again, after the end"],
  ["0 … 4", "show that finger"],
  ["← →", "show the previous or next finger"],
  ["↑ ↓, Enter", "in the marks: move, go to that time"],
  ["D", "theme: system, light, dark"],
  ["?", "this list"],
  ["Tab, Enter", "move to a button, press it"],
];
const BUTTONS = { t: "tare", a: "tare-all", r: "record", m: "mark", p: "pause", i: "picture", s: "save", g: "again", d: "theme", "?": "help" };

export function wireControls({ actions, pick, step }) {
  for (const [id, act] of Object.entries(actions)) byId(id).addEventListener("click", act);
  const keys = byId("keys");
  byId("help").addEventListener("click", () => keys.showModal());
  byId("key-list").replaceChildren(...KEYS.flatMap(([key, words]) => {
    const term = make("dt");
    term.append(make("kbd", { textContent: key }));
    return [term, make("dd", { textContent: words })];
  }));
  document.addEventListener("keydown", (event) => {
    if (event.target.matches("input, select")) return; // which has its own keys
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat || keys.open) return;
    const button = byId(BUTTONS[event.key.toLowerCase()] ?? "");
    if (button && !button.hidden) button.click();
    else if (/^[0-9]$/.test(event.key)) pick(Number(event.key));
    else if (event.key === "ArrowLeft") step(-1);
    else if (event.key === "ArrowRight") step(1);
    else return;
    event.preventDefault();
  });
}

const THEMES = ["system", "light", "dark"];

export class ThemeSwitch {
  constructor(changed) {
    this.changed = changed;
    this.system = matchMedia("(prefers-color-scheme: dark)");
    this.system.addEventListener("change", () => this.set(this.theme));
    this.set(localStorage.getItem("theme") ?? "system");
  }

  next() {
    this.set(THEMES[(THEMES.indexOf(this.theme) + 1) % THEMES.length]);
  }

  set(theme) {
    this.theme = THEMES.includes(theme) ? theme : "system";
    localStorage.setItem("theme", this.theme);
    const isDark = this.theme === "dark" || (this.theme === "system" && this.system.matches);
    document.documentElement.dataset.theme = isDark ? "dark" : "light";
    byId("theme-words").textContent = this.theme;
    this.changed();
  }
}
