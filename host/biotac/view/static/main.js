// Puts the page together: the stream fills a model, one loop draws it, buttons send commands.

import { Limit, readTheme } from "./colours.js";
import { ThemeSwitch, wireControls } from "./controls.js";
import { Fingertip } from "./fingertip.js";
import { HandRow } from "./hand.js";
import { Model, SPECTRUM_SAMPLES, zoom } from "./model.js";
import { SpectrogramPlot, TimePlot, drawSpectrum } from "./plots.js";
import { Flags, Results, byId, number, showFaults, showHealth, showLink, showReply, showTare } from "./readout.js";
import { amplitudes } from "./spectrum.js";
import { Stream } from "./stream.js";
import { Timeline, savePicture } from "./timeline.js";

const READ_MS = 100; // numbers that change faster cannot be read
const LATE_MS = 1000;

// Functions from a frame to these components of a vector.
const parts = (name, ...indices) => indices.map((k) => (frame) => frame[name][k]);

class Page {
  constructor() {
    this.shown = 0;
    this.frozen = false; // pause of a board: only the picture stands still
    this.limit = new Limit();
    this.plots = [
      new TimePlot(byId("force-plot"), parts("forceN", 0, 1, 2), ["x", "y", "z"], { least: 1, digits: 1, zero: true, wide: parts("appliedN", 0, 1, 2), trust: true }),
      new TimePlot(byId("grip-plot"), parts("gripN", 0, 2), ["z", "x"], { least: 1, digits: 1, zero: true, halves: parts("gripN", 1, 3) }),
      new TimePlot(byId("pdc-plot"), [({ pdc }) => pdc], ["text"], { least: 20, digits: 0, zero: false }),
    ];
    this.spectrogram = new SpectrogramPlot(byId("spectrogram-plot"));
    this.readMs = 0;
    this.turn = false;
    this.themes = new ThemeSwitch(() => (this.theme = readTheme()));
    this.stream = new Stream({
      about: (facts) => this.onAbout(facts),
      update: (news) => this.onUpdate(news),
      gone: () => this.onDisconnect(),
    });
    wireControls({
      actions: {
        tare: () => this.command("tare", this.shown),
        "tare-all": () => this.command("tare"),
        record: () => this.command(this.model?.health?.recording ? "stop" : "record"),
        mark: () => this.mark(byId("mark-text").value || "mark"),
        pause: () => this.pause(),
        picture: () => savePicture(this.theme),
        save: () => this.command("save", null, zoom.s),
        again: () => this.command("again"),
        theme: () => this.themes.next(),
      },
      step: (by) => this.step(by),
    });
    byId("zoom").onchange = () => (zoom.s = Number(byId("zoom").value));
    requestAnimationFrame((ms) => this.loop(ms));
  }

  // ---- the stream --------------------------------------------------------------------------

  onAbout(about) {
    if (this.model) showReply("Reconnected to the viewer program.");
    this.model = new Model(about);
    this.tip = new Fingertip(byId("fingertip-canvas"), about.electrodes, { large: true });
    this.hand = new HandRow(byId("fingers"), about, (index) => this.pick(index));
    this.results = new Results(about);
    this.flags = new Flags(about);
    this.timeline = new Timeline(about.recording, (...words) => this.command(...words));
    this.masks = Object.fromEntries(about.flags.map(({ name, mask }) => [name, mask]));
    const hz = about.pac_hz / SPECTRUM_SAMPLES;
    byId("spectrum-words").textContent = `${SPECTRUM_SAMPLES} samples, ${number(hz, 1)} Hz apart`;
  }

  onUpdate(news) {
    const before = this.model.health;
    this.model.update(news);
    const { health } = this.model;
    if (!news.health) return;
    // By epochs: of a loss that is over within milliseconds, no news says that the board was lost.
    if (before?.epoch && before.epoch !== health.epoch) {
      this.hand.clear();
      if (health.live) showReply("The board is connected again.");
    }
    this.showState();
  }

  onDisconnect() {
    showLink("gone", "The viewer program does not answer. Retrying; is it still running?");
    if (this.model) this.model.health = null;
    this.showButtons();
  }

  async command(name, finger = null, value = null) {
    const { good, words } = await this.stream.command(name, finger, value);
    showReply(words.charAt(0).toUpperCase() + words.slice(1) + (good ? "." : ""), good);
    return good;
  }

  async mark(name) {
    const mark = { at_s: this.timeline.at, finger: this.shown, name };
    if ((await this.command("mark", this.shown, name)) && this.timeline.facts) this.timeline.add(mark);
  }

  // ---- commands of the user ----------------------------------------------------------------

  pick(index) {
    if (!this.model?.fingers.has(index)) return;
    this.shown = index;
    this.readMs = 0;
  }

  step(by) {
    const all = [...(this.model?.fingers.keys() ?? [])].sort((a, b) => a - b);
    if (all.length) this.pick(all[(all.indexOf(this.shown) + by + all.length) % all.length]);
  }

  pause() {
    const { health } = this.model ?? {};
    if (!health) return;
    if (health.live) {
      this.frozen = !this.frozen;
      this.showState();
    } else {
      this.command(health.link === "paused" ? "resume" : "pause");
    }
  }

  // ---- the display -------------------------------------------------------------------------

  // The last force of a finger, or of a program, that stands still is not to look like the present one.
  showState() {
    const { health, lateMs } = this.model;
    if (!health) return;
    const isThere = this.model.fingers.has(this.shown);
    if (this.frozen && health.link === "live") showLink("paused", "Paused: the picture is frozen; the board and any recording keep running.");
    else if (lateMs > LATE_MS) showLink(health.link, `What is shown is ${number(lateMs / 1000, 0)} s old: the line from the viewer program is slow.`, true);
    else if (health.link === "live" && this.model.isSilent(this.shown)) showLink("live", isThere ? "No new frames come from this finger: what is shown is old." : "No frames come from this finger.", true);
    else showLink(health.link, health.words);
    this.showButtons();
  }

  showButtons() {
    const health = this.model?.health;
    const board = health?.link === "live";
    const playing = ["live", "playing", "paused"].includes(health?.link);
    const recording = health?.recording;
    const paused = this.frozen || health?.link === "paused";
    byId("mark").disabled = !(recording || (playing && !health.live));
    for (const id of ["tare", "tare-all", "record"]) byId(id).disabled = !board;
    byId("pause").disabled = !playing;
    byId("again").hidden = !["over", "taken"].includes(health?.link);
    byId("record").setAttribute("aria-pressed", String(Boolean(recording)));
    byId("record").title = recording ? recording.path : "";
    byId("record-words").textContent = recording ? `Stop, ${Math.floor(recording.seconds)} s` : "Record";
    byId("pause").setAttribute("aria-pressed", String(paused));
    byId("pause-words").textContent = paused ? "Resume" : "Pause";
  }

  loop(nowMs) {
    requestAnimationFrame((ms) => this.loop(ms));
    if (!this.model) return;
    const { fingers } = this.model;
    if (!fingers.has(this.shown) && fingers.size) this.shown = Math.min(...fingers.keys());
    if (!this.frozen) this.draw(nowMs); // drawing asks for sizes: after a write that would cost a layout
    if (nowMs - this.readMs >= READ_MS) this.read(nowMs);
  }

  draw(nowMs) {
    const { fingers, about } = this.model;
    this.hand.sync(fingers);
    this.hand.mark(this.shown);
    let largest = 0;
    for (const { latest } of fingers.values()) {
      if (!latest) continue;
      latest.touched = Boolean(latest.flags & this.masks.CONTACT);
      for (const v of latest.signal ?? []) if (Math.abs(v) > largest) largest = Math.abs(v);
    }
    this.limit.follow(largest, nowMs);
    const finger = fingers.get(this.shown);
    this.tip.draw(finger, this.theme, this.limit.counts);
    // Small and slow parts take turns: drawn in every second picture, they allow a weak computer its 60 a second.
    this.turn = !this.turn;
    if (this.turn) {
      const marks = (this.model.health?.events ?? []).filter((mark) => mark.finger === this.shown);
      for (const plot of this.plots) plot.draw(finger, this.theme, marks);
    } else {
      this.hand.draw(fingers, this.theme, this.limit.counts);
      const pascals = finger?.pacIsFull ? amplitudes(finger.pac).map((v) => v * about.pac_pa_per_count) : null;
      drawSpectrum(byId("spectrum-plot"), pascals, about.pac_hz, this.theme);
      this.spectrogram.draw(finger, about.pac_hz, about.pac_pa_per_count, this.theme);
    }
  }

  read(nowMs) {
    this.readMs = nowMs;
    this.showState();
    const { fingers, about, health, dropped } = this.model;
    if (health) {
      showHealth(health, dropped);
      this.timeline.show(health.position_s);
      this.timeline.draw(this.theme);
      if (health.live) this.timeline.list(health.events.toReversed().map(({ t_us: tUs, finger, name }) => ({ at_s: tUs / 1e6, finger, name })));
    }
    if (this.frozen) return;
    byId("shown").textContent = String(this.shown);
    byId("scale-low").textContent = number(-this.limit.counts, 0);
    byId("scale-high").textContent = `+${this.limit.counts}`;
    const facts = health?.fingers.find(({ finger }) => finger === this.shown);
    showTare(about, facts);
    showFaults(about, facts);
    const latest = fingers.get(this.shown)?.latest;
    const frame = latest ?? this.model.inUnits([]);
    this.results.show(frame);
    this.flags.show(frame.flags);
    this.hand.read(this.model, this.masks.UNTARED);
    const touched = byId("touched");
    const isKnown = latest && !document.body.hasAttribute("data-stale");
    touched.textContent = !isKnown ? "not known" : frame.flags & this.masks.CONTACT ? "contact" : "no contact";
    touched.dataset.kind = isKnown && frame.flags & this.masks.CONTACT ? "on" : "calm";
    byId("numbers").toggleAttribute("data-untouched", !(frame.flags & this.masks.CONTACT));
  }
}

new Page();
