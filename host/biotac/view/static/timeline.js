// A whole recording: a bar to seek in, speed, and marks; of a board, the latest marks.

import { fit } from "./fingertip.js";
import { byId, make, number } from "./readout.js";

function clock(s) {
  const tenths = Math.round(s * 10);
  return `${Math.floor(tenths / 600)}:${((tenths % 600) / 10).toFixed(1).padStart(4, "0")}`;
}

export class Timeline {
  // facts: overview.py's, null for a board; command(name, finger, value)
  constructor(facts, command) {
    Object.assign(this, { facts, command, at: 0, listed: "" });
    byId("timeline").hidden = !facts;
    if (!facts) return;
    this.seek = byId("seek");
    this.seek.max = facts.length_s;
    this.seek.oninput = () => this.show(Number(this.seek.value), true);
    this.seek.onchange = () => this.go(Number(this.seek.value));
    byId("pace").onchange = () => command("pace", null, Number(byId("pace").value));
    this.list(facts.marks);
    byId("marks").onkeydown = (event) => { // one stop for Tab, however many there are
      const item = event.target.closest("li");
      const next = { ArrowDown: item ? item.nextSibling : event.target.firstChild, ArrowUp: item?.previousSibling }[event.key];
      if (!next) return;
      next.querySelector("button").focus();
      event.preventDefault();
    };
  }

  async go(atS) {
    this.moving = true;
    this.show(atS, true);
    await this.command("seek", null, atS);
    this.moving = false;
  }

  // Where the recording is; while somebody moves the bar, that counts.
  show(atS, moved = false) {
    if (!this.facts || atS === null || ((this.moving || this.seek.matches(":active")) && !moved)) return;
    this.at = atS;
    this.seek.value = atS;
    this.seek.setAttribute("aria-valuetext", `${number(atS, 1)} s of ${number(this.facts.length_s, 1)} s`);
    byId("time").textContent = `${clock(atS)} of ${clock(this.facts.length_s)}`;
  }

  draw(theme) {
    if (!this.facts) return;
    const canvas = byId("overview");
    fit(canvas);
    const c = canvas.getContext("2d");
    const { width, height } = canvas;
    const { peaks_n: peaks, marks, length_s: lengthS } = this.facts;
    const top = Math.max(1, ...peaks);
    c.clearRect(0, 0, width, height);
    c.fillStyle = theme.quiet;
    for (const mark of marks) c.fillRect((mark.at_s / lengthS) * width, 0, devicePixelRatio, height / 4);
    c.fillStyle = theme.accent;
    peaks.forEach((v, k) => c.fillRect((k / peaks.length) * width, height * (1 - v / top), width / peaks.length, height));
    c.fillStyle = theme.text;
    c.fillRect((this.at / lengthS) * width - devicePixelRatio, 0, 2 * devicePixelRatio, height);
  }

  add(mark) {
    this.facts.marks = [...this.facts.marks, mark].sort((a, b) => a.at_s - b.at_s);
    this.list(this.facts.marks);
  }

  // marks: { at_s, finger, name }; in a recording, a click on one seeks to that time.
  list(marks) {
    const words = JSON.stringify(marks);
    if (words === this.listed) return;
    this.listed = words;
    byId("marks").replaceChildren(...marks.map(({ at_s: atS, finger, name }) => {
      const item = make("li");
      const text = `${name}${finger === null ? "" : `, finger ${finger}`}`;
      const what = this.facts ? make("button", { type: "button", tabIndex: -1, textContent: text }) : make("span", { textContent: text });
      if (this.facts) what.onclick = () => this.go(Math.max(0, atS - 0.5));
      item.append(make("b", { textContent: clock(atS) }), what);
      return item;
    }));
  }
}

// The charts and the fingertip as one PNG, saved by the browser.
export function savePicture(theme) {
  const shown = [...document.querySelectorAll("#fingertip canvas, .plots canvas")];
  const picture = make("canvas");
  picture.width = Math.max(...shown.map(({ width }) => width));
  picture.height = shown.reduce((sum, { height }) => sum + height + 16, 16);
  const c = picture.getContext("2d");
  c.fillStyle = theme.card;
  c.fillRect(0, 0, picture.width, picture.height);
  let y = 16;
  for (const canvas of shown) {
    c.drawImage(canvas, 0, y);
    y += canvas.height + 16;
  }
  picture.toBlob((data) => {
    const link = make("a", { href: URL.createObjectURL(data), download: "biotac.png" });
    link.click();
    URL.revokeObjectURL(link.href);
  });
}
