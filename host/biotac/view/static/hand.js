// The fingers side by side, each a button that shows it large.

import { Fingertip } from "./fingertip.js";
import { NONE, make, number } from "./readout.js";

export class HandRow {
  constructor(place, about, pick) {
    this.place = place;
    this.about = about;
    this.pick = pick;
    this.clear();
  }

  clear() {
    this.entries = new Map();
    this.place.replaceChildren();
  }

  // Fingers appear when they first send, and stay.
  sync(fingers) {
    if (fingers.size === this.entries.size) return;
    this.clear();
    for (const index of [...fingers.keys()].sort((a, b) => a - b)) {
      const button = make("button", { type: "button", className: "finger" }, { finger: index });
      button.setAttribute("aria-keyshortcuts", String(index));
      const canvas = make("canvas");
      canvas.setAttribute("aria-hidden", "true");
      const force = make("span", { className: "force" });
      const name = make("b", { innerHTML: `<span class="hidden">Finger </span>${index}` });
      button.append(canvas, name, force);
      button.addEventListener("click", () => this.pick(index));
      this.place.append(button);
      this.entries.set(index, { button, force, tip: new Fingertip(canvas, this.about.electrodes, { large: false }) });
    }
  }

  mark(shown) {
    for (const [index, { button }] of this.entries) button.setAttribute("aria-pressed", String(index === shown));
  }

  draw(fingers, theme, limit) {
    for (const [index, { tip }] of this.entries) tip.draw(fingers.get(index), theme, limit);
  }

  read(model, untared) {
    for (const [index, { button, force }] of this.entries) {
      const { latest } = model.fingers.get(index);
      button.toggleAttribute("data-untouched", !latest.touched);
      const newtons = Math.hypot(...latest.forceN);
      const words = Number.isFinite(newtons) ? `${number(newtons, 1)} N` : latest.flags & untared ? "no tare" : "no force";
      force.textContent = model.isSilent(index) ? NONE : words;
    }
  }
}
