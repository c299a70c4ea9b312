"""Light holds against the residue of presses: does the board spare the former and tare the latter?

In a recording of presses nobody holds anything: it has only residues. Holds are made from it. The last row of an
unloading with at least a given share of the press's peak pressure is repeated for two seconds. That row is from a real
finger but stiller than any hand: if the board tares it, it would tare a hold. Without a recording the same is done to
an emulated finger, new and worn, with creeping and undershooting pressure.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from biotac import Finger, FrameFlags, RecordingError, TareReason, TareState
from biotac.wire import messages

from ..report import Options, Report, Table, check, claim
from . import laboratory
from .plate_normal import emulated
from .trial import Floats, Rows, Words

RECORDING = "E and PDC of presses"

SHARES = (0.5, 0.3, 0.2, 0.1, 0.05, 0.04, 0.03)
SAFE_SHARE = 0.1  # holds of this share of the peak and more are never tared
LIGHT_LIMIT = 0.1  # the largest share of lighter holds that may be tared
# protocol/SPEC.md (Tare) defines rest after a press: less than a 40th of the peak, 4 to 10 counts. Holding that is no
# hold, and most spliced at 3 % of a peak are that light, for the tare in force has some residue in it.
REST_SHARE, REST_COUNTS = 1 / 40, (4.0, 10.0)
HOLD_ROWS = 200  # 2 s of rounds
PRESSED_COUNTS, PRESSED_ROWS = 60, 8  # a press is this far above rest for this long
REST_ROWS = (25, 8)  # rows before a press; their median is the rest

EMULATED_NOTE = "emulated: the model's pressure creeps and undershoots"
OUTCOMES = {"tared": "#b91c1c", "doubt": "#c2410c", "contact": "#1d4ed8"}  # with their colours
RELEASES = (TareReason.RELEASE, TareReason.RESIDUE, TareReason.SHIFT)


@dataclass(frozen=True)
class Press:
    """Rows of a press: the first, the peak, where the next press begins; PDC at rest before it and at the peak."""

    first: int
    peak: int
    end: int
    rest: float
    top: float

    @property
    def calm_counts(self) -> float:
        """Below this pressure above the tare the finger is at rest after the press, by the protocol."""
        return float(np.clip(REST_SHARE * (self.top - self.rest), *REST_COUNTS))


@dataclass(frozen=True)
class Hold:
    """The outcome of one spliced hold; ``above`` is PDC above the tare then in force, counts."""

    press: int
    share: float
    above: float
    outcome: str  # a key of OUTCOMES


@dataclass(frozen=True)
class Case:
    """One finger: the original rows with the re-zeros among them, and the holds spliced in."""

    name: str
    pdc: Words
    rows: Rows
    presses: list[Press]
    holds: list[Hold]

    @property
    def rezeros(self) -> list[int]:
        """Rows where a contact ended in a new tare."""
        changed = (self.rows["flags"] & FrameFlags.TARE_CHANGED) != 0
        return [int(k) for k in np.flatnonzero(changed & np.isin(self.rows["tare_reason"], RELEASES))]

    def above(self, row: int) -> float:
        """PDC above rest around ``row``, with any tare of the board; the rest is the 5th percentile of 20 s."""
        near = self.pdc[max(row - 1000, 0) : row + 1000].astype(float)
        return float(self.pdc[row] - np.percentile(near, 5))

    @property
    def seen(self) -> list[bool]:
        """For each press, whether the board was in contact from the fourth row to the peak."""
        state = self.rows["tare_state"]
        return [bool((state[p.first + 3 : p.peak + 1] == TareState.CONTACT).all()) for p in self.presses]


def presses_of(pdc: Words) -> list[Press]:
    """Where PDC exceeds the rest around there by PRESSED_COUNTS for at least PRESSED_ROWS."""
    known = np.where(pdc == messages.INVALID_COUNT, np.nan, pdc.astype(float))
    rest = np.array([np.nanpercentile(known[max(k - 1000, 0) : k + 1000], 5) for k in range(0, len(pdc), 50)])
    over = known - np.repeat(rest, 50)[: len(pdc)] > PRESSED_COUNTS
    edges = np.flatnonzero(np.diff(np.concatenate([[0], over.astype(int), [0]])))
    runs = [(int(a), int(b)) for a, b in zip(edges[0::2], edges[1::2], strict=True) if b - a >= PRESSED_ROWS]
    out = []
    for k, (a, b) in enumerate(runs):
        end = runs[k + 1][0] - REST_ROWS[1] if k + 1 < len(runs) else len(pdc)
        peak = a + int(np.nanargmax(known[a:b]))
        before = known[max(a - REST_ROWS[0], 0) : max(a - REST_ROWS[1], 1)]
        quiet = float(np.nanmin([np.nanmedian(before), rest[peak // 50]]))
        out.append(Press(a, peak, end, quiet, float(known[peak])))
    return out


def spliced(pdc: Words, press: Press, share: float) -> int | None:
    """The last row of the unloading with at least this share of the press's peak; None if it never falls below."""
    above = pdc[press.peak : press.end].astype(float) - press.rest
    low = np.flatnonzero(above < share * (press.top - press.rest))
    return press.peak + int(low[0]) - 1 if len(low) and low[0] > 0 else None


def _hold(counts: Words, pdc: Words, row: int) -> tuple[str, float]:
    finger = Finger()
    before = finger.feed(counts[: row + 1], pdc[: row + 1])
    held = finger.feed(np.repeat(counts[row : row + 1], HOLD_ROWS, axis=0), np.repeat(pdc[row], HOLD_ROWS))
    above = float(pdc[row]) - float(before["pdc_tare_q4"][-1]) / 16
    state = held["tare_state"]
    if np.isin(held["tare_reason"][(held["flags"] & FrameFlags.TARE_CHANGED) != 0], RELEASES).any():
        return "tared", above
    return ("doubt" if state[-1] == TareState.DOUBT else "contact"), above


def judge(name: str, counts: Words, pdc: Words) -> Case:
    """Run the rows as they are, and once more with each hold that can be made from them."""
    presses = presses_of(pdc)
    holds = []
    for k, press in enumerate(presses):
        for share in SHARES:
            row = spliced(pdc, press, share)
            if row is not None:
                outcome, above = _hold(counts, pdc, row)
                holds.append(Hold(k, share, above, outcome))
    return Case(name, pdc, Finger().feed(counts, pdc), presses, holds)


def run(options: Options) -> Report:
    """The outcomes of the holds by share, and the re-zeros; on a recording, or an emulated finger, new and worn."""
    tables, checks, cases = [], [], []
    trials = laboratory.trials(options, emulated, "presses on", ("PDC",))
    for name, trial in trials.items():
        case = judge(name, trial.counts, trial.pdc)
        if not case.presses:
            raise RecordingError(
                f"{options.recording}: PDC is never {PRESSED_COUNTS} counts above rest for {PRESSED_ROWS} rows: "
                "expected presses; check that PDC is in counts"
            )
        cases.append(case)
        outcomes = {share: [hold.outcome for hold in case.holds if hold.share == share] for share in SHARES}
        rows = [
            [f"{share:.0%}", len(found), *[found.count(name) for name in OUTCOMES]] for share, found in outcomes.items()
        ]
        before_n = np.linalg.norm(case.rows["force_100un"][np.array(case.rezeros, np.intp) - 1] / 1e4, axis=1)
        most = f", with at most {before_n.max():.2f} N just before" if len(before_n) else ""
        pressed = [row for row in case.rezeros if case.above(row) > PRESSED_COUNTS]
        safe = [hold for hold in case.holds if hold.share >= SAFE_SHARE]
        light = [hold for hold in case.holds if hold.share < SAFE_SHARE]
        held = [hold for hold in light if hold.above >= case.presses[hold.press].calm_counts]
        tared = sum(hold.outcome == "tared" for hold in held)
        text = (
            f"{len(case.presses)} presses, {sum(case.seen)} seen; {len(case.rezeros)} re-zeros{most}. Of {len(light)} "
            f"holds below {SAFE_SHARE:.0%}, {len(light) - len(held)} are as light as what the protocol calls rest."
        )
        head = ["share of peak", "holds", "tared", "in doubt", "contact"]
        tables.append(Table(f"Holds, {case.name}", head, rows, text))
        checks += [
            claim(f"{case.name}: every press is seen", all(case.seen)),
            check(f"{case.name}: re-zeros with PDC more than {PRESSED_COUNTS} counts above rest", len(pressed), 0, ""),
            check(f"{case.name}: holds of {SAFE_SHARE:.0%} or more that are tared",
                  sum(hold.outcome == "tared" for hold in safe), 0, f"of {len(safe)}"),
            check(f"{case.name}: share of the lighter holds, above rest, that are tared",
                  tared / len(held) if held else float("nan"), LIGHT_LIMIT, f"of {len(held)}"),
        ]  # fmt: skip
    notes = [f"a hold is one row repeated for {HOLD_ROWS / 100:g} s; shares are of a press's peak PDC above its rest"]
    notes += trials["recorded"].notes if "recorded" in trials else [EMULATED_NOTE]
    return Report(options.source, tables, checks, notes, lambda figure: _draw(options.source, cases, figure))


def _draw(source: str, cases: list[Case], figure: Any) -> None:
    """Pressure with the board's states and re-zeros; outcomes of holds by share."""
    figure.set_size_inches(13, 4.2 * len(cases))
    axes = figure.subplots(len(cases), 2, squeeze=False)
    figure.suptitle(f"Hold or residue: {source}")
    for (left, right), case in zip(axes, cases, strict=True):
        time_s: Floats = np.arange(len(case.pdc)) / 100.0
        left.plot(time_s, case.pdc, color="#111111", linewidth=0.6, label="PDC")
        left.plot(time_s, case.rows["pdc_tare_q4"] / 16.0, color="#15803d", linewidth=1, label="its tare")
        doubt = case.rows["tare_state"] == TareState.DOUBT
        left.fill_between(time_s, *left.get_ylim(), where=doubt, color="#c2410c", alpha=0.25, label="in doubt")
        left.plot(time_s[case.rezeros], case.pdc[case.rezeros], "v", color="#15803d", markersize=5, label="re-zero")
        known = case.pdc[case.pdc != messages.INVALID_COUNT]
        left.set(
            xlabel="time in rounds [s]", ylabel="PDC [counts]", title=case.name, ylim=(known.min() - 20, known.max())
        )
        left.legend(fontsize=8)
        for outcome, color in OUTCOMES.items():
            holds = [hold for hold in case.holds if hold.outcome == outcome]
            right.plot([hold.share for hold in holds], [max(hold.above, 0.5) for hold in holds], "o", color=color,
                       markersize=4, label=f"{outcome}: {len(holds)}")  # fmt: skip
        right.set(
            xlabel="share of the press's peak", ylabel="PDC above the last tare [counts]", xscale="log", yscale="log"
        )
        right.legend(fontsize=8)
        for axis in (left, right):
            axis.grid(alpha=0.25)
