// Buttons and keys. A key does the work of a button, and is refused when that is.

import { byId } from "./readout.js";

export function wireControls({ actions, step }) {
  for (const [id, act] of Object.entries(actions)) byId(id).addEventListener("click", act);
  const keys = byId("keys");
  byId("help").addEventListener("click", () => keys.showModal());
  document.addEventListener("keydown", (event) => {
    if (event.target.matches("input:not([type=range]), select")) return; // these have keys themselves
    if (event.target.matches("input") && event.key.startsWith("Arrow")) return; // the seek bar uses arrows, but no letters
    if (event.ctrlKey || event.metaKey || event.altKey || event.repeat || keys.open) return;
    const button = document.querySelector(`button[aria-keyshortcuts="${CSS.escape(event.key.toUpperCase())}"]`);
    if (button && !button.hidden) button.click();
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
