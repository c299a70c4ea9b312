"""The whole chain in one run: simulated board, stream, recording, cross-check, report, picture."""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..hand.opening import shake_hands
from ..kernels.geometry import ELECTRODE_MM
from ..kernels.unroll import unroll
from ..picture import check_drawable, picture
from ..recording.crosscheck import CrossCheck
from ..recording.felt import Felt
from ..recording.reader import Recording
from ..sim.board import SimBoard
from ..sim.loading import load_source
from ..sim.scenario import FingerSpec
from ..sim.source import Source
from ..wire import messages_gen as wire
from ..wire import sensor_gen as sensor
from ..wire.batches import Batch, join
from ..wire.frames import electrode_signals
from ..wire.slots import FRAME_HZ, PAC_SLOT
from .answers import NAMES, OWN, POPULATION, answers_to, own_map

Show = Callable[[str], None]
#: The answers in the picture: color and label.
DRAWN = {
    OWN: ("#2563eb", f"felt, {NAMES[OWN]}"),
    POPULATION: ("#dc2626", f"felt, {NAMES[POPULATION]} (the default): demo.mcap"),
}


@dataclass(frozen=True)
class DemoRun:
    """The results of a demo: the source, all batches, finger 0's force by each map, the report's facts."""

    source: Source
    batch: Batch
    felt: dict[str, Felt]
    facts: dict[str, Any]

    @property
    def good(self) -> bool:
        """Nothing lost, nothing damaged, no result out of bounds, the recording equal to the stream."""
        return (
            self.facts["frames_lost"] == 0
            and self.facts["crc_errors"] == 0
            and self.facts["crosscheck"]["violations"] == 0
            and bool(self.facts["recording_matches"])
        )


def run_demo(
    source_name: str, folder: Path, *, fingers: int | None = None, seconds: float | None = None, show: Show = print
) -> DemoRun:
    """Play a source through a simulated board and leave demo.mcap, report.json and demo.png.

    Raises InputError when the source cannot be played or the folder cannot be written.
    """
    check_drawable()
    source = load_source(source_name, fingers=fingers, seconds=seconds)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(f"{folder}: cannot create the folder ({error.strerror}); choose another --out") from error
    recording_path = folder / "demo.mcap"
    wall = time.monotonic()
    # The board's counts are ready; from here on this process is a host with a board, and the host's cost is measured.
    with shake_hands(SimBoard(source, pace=0.0).link(f"sim:{source.name}")) as hand:
        # The board has no calibration. A calibrated board's results are computed below and drawn beside it.
        settings = hand.board.settings()
        has_pac = bool(np.any(source.samples[:, :, PAC_SLOT] <= 4095))
        recorder = hand.record(recording_path, overwrite=True)
        cpu = time.process_time()
        outcome = CrossCheck()
        batches: list[Batch] = []
        hand.stream("force", "poc", "torque", "pressure", *(["pac"] if has_pac else []))
        for batch in hand.batches():
            outcome.add(batch.wire, settings)
            batches.append(batch)
            show(f"{hand.stats.frames} of {source.samples.shape[0] * source.samples.shape[1]} frames")
        recorder.close()
        cpu = time.process_time() - cpu
        stats = hand.stats
        status = hand.status()
    joined = join(batches)
    own = None
    if source.emulated:
        show("calibrating finger 0 as `biotac calibrate wrench --live` does, which takes some ten seconds")
        finger = source.emulated[0]
        own = own_map(FingerSpec(finger.seed, finger.profile, source.serials[0]))
    at_0 = joined.wire["finger"] == 0
    frames, sent = joined.frames[at_0], joined.wire[at_0]
    answers, applied_n = answers_to(sent, settings, own), hand.applied_n(frames["finger"], frames["t_us"])
    felt = {name: Felt() for name in answers if applied_n is not None}
    for name, force in felt.items():
        force.add(applied_n, answers[name])  # type: ignore[arg-type]
    rows, played_fingers = source.samples.shape[:2]
    device_s = rows / FRAME_HZ
    recorded = Recording(recording_path)
    never_came = at_the_ends(source, joined)
    unsampled = max(0, expected_frames(source) - len(joined.frames) - stats.frames_lost - never_came)
    same = np.array_equal(recorded.wire, joined.wire) and np.array_equal(recorded.pac, joined.pac)
    facts: dict[str, Any] = {
        "source": source.name,
        "fingers": played_fingers,
        "rows": rows,
        "rows_skipped": source.skipped_frames,
        "frames": len(joined.frames),
        "frames_lost": stats.frames_lost + never_came,
        "rounds_unsampled": unsampled,  # a sensor was asked for its serial number meanwhile
        "pac_blocks": len(joined.pac),
        "crc_errors": stats.crc_errors,
        "other_errors": stats.other_errors,
        "board_dropped": status.messages_dropped,
        "board_slots_late": status.slots_late,
        "device_seconds": device_s,
        "wall_seconds": round(time.monotonic() - wall, 3),
        "host_cpu_seconds": round(cpu, 3),
        "host_cpu_percent": round(100 * cpu / device_s, 2),
        "bytes": stats.bytes_received,
        "recording_bytes": recording_path.stat().st_size,
        "recording_matches": bool(same),
        "tare_changes": tare_changes(joined.messages),
        "felt": {name: force.bands for name, force in felt.items()},
        "crosscheck": outcome.as_dict(),
        "recording": str(recording_path),
        "report": str(folder / "report.json"),
        "picture": str(folder / "demo.png"),
    }
    draw(source, frames, sent, applied_n, answers, folder / "demo.png")
    (folder / "report.json").write_text(json.dumps(facts, indent=1) + "\n", encoding="utf-8")
    return DemoRun(source, joined, felt, facts)


def expected_frames(source: Source) -> int:
    """Frames that the board must send: one for each round of a finger with at least one good word."""
    return int(np.count_nonzero(np.any((source.samples <= 4095), axis=2)))


def at_the_ends(source: Source, came: Batch) -> int:
    """Those of ``expected_frames`` before each finger's first frame and after its last: no sequence number tells."""
    good, missing = np.any(source.samples <= 4095, axis=2), 0
    for finger in range(good.shape[1]):
        own = came.frames[came.frames["finger"] == finger]
        first = int(own["seq"][0]) if len(own) else 0
        since = first + round((own["t_us"][-1] - own["t_us"][0]) * FRAME_HZ / 1e6) + 1 if len(own) else 0
        missing += first + int(np.count_nonzero(good[since:, finger]))
    return missing


def tare_changes(messages: list[Any]) -> list[dict[str, Any]]:
    return [
        {"finger": m.finger, "seq": m.seq, "reason": wire.TareReason(m.reason).name}
        for m in messages
        if isinstance(m, wire.Tare)
    ]


def draw(source: Source, frames: Any, messages: Any, applied_n: Any, answers: dict[str, Any], path: Path) -> None:
    """Write a PNG of finger 0, with the applied force in the frames (n, 3), if known, and the answers, in N."""
    with picture(path) as figure:
        figure.set_size_inches(13, 5.6)
        axes = figure.subplots(1, 2, width_ratios=(1, 1.9))
        figure.suptitle(f"{source.name}, played to a simulated board: where a finger is touched, and with what force")
        draw_fingertip(figure, axes[0], frames, messages)
        draw_force(axes[1], frames, applied_n, answers)


def draw_fingertip(figure: Any, axes: Any, frames: Any, messages: Any) -> None:
    """Electrodes at the moment of largest force, and every PoC of the contacts."""
    across, along = unroll(ELECTRODE_MM)
    signals = np.nan_to_num(electrode_signals(messages)) if len(messages) else np.zeros((1, 19))
    tared = (frames["flags"] & wire.FrameFlags.UNTARED) == 0
    energy = np.where(tared, (signals**2).sum(axis=1), 0.0) if len(messages) else np.zeros(1)
    strongest = int(np.argmax(energy))
    limit = max(float(np.abs(signals[strongest]).max()), 1.0)
    dots = axes.scatter(
        across, along, c=signals[strongest], s=520, cmap="RdBu", vmin=-limit, vmax=limit, edgecolors="#444444"
    )
    for name, a, b, signal in zip(sensor.ELECTRODE_NAMES, across, along, signals[strongest], strict=True):
        dark = abs(signal) > limit / 2
        axes.annotate(name, (a, b), ha="center", va="center", fontsize=7, color="white" if dark else "black")
    flags = frames["flags"]
    contact = ((flags & wire.FrameFlags.CONTACT) != 0) & ((flags & wire.FrameFlags.POC_LOW) == 0)
    poc_across, poc_along = unroll(frames["poc_mm"][contact])
    axes.plot(poc_across, poc_along, ".", color="#7c3aed", markersize=3, alpha=0.5, label="point of contact")
    if len(frames) and contact.any():
        a, b = unroll(frames["poc_mm"][strongest : strongest + 1])
        axes.plot(a, b, "o", color="#7c3aed", markersize=15, markeredgewidth=2, fillstyle="none", label="at that time")
        axes.set_title(f"what the electrodes read at {frames['t_us'][strongest] / 1e6:.1f} s", fontsize=10)
    axes.set(xlabel="around the finger [mm], + towards E11", ylabel="along the finger [mm], tip up")
    axes.set_aspect("equal")
    axes.margins(0.15)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.06), fontsize=8, ncols=2, frameon=False)
    figure.colorbar(dots, ax=axes, shrink=0.7, label="signal [count]: compressed < 0 < bulged")


def draw_force(axes: Any, frames: Any, applied_n: Any, answers: dict[str, Any]) -> None:
    """The force's size over device time, by each of ``DRAWN`` that is known, with the applied one behind them."""
    t_s = frames["t_us"] / 1e6
    if applied_n is not None:
        axes.plot(t_s, np.linalg.norm(applied_n, axis=1), color="#999999", linewidth=6, alpha=0.5, label="applied")
    for name, (color, label) in DRAWN.items():
        if name in answers:
            axes.plot(t_s, np.linalg.norm(answers[name], axis=1), color=color, linewidth=1.5, label=label)
    axes.set(xlabel="device time [s]", ylabel="size of the force on the finger, |F| [N]")
    axes.set_title("size of the force (not its direction): applied, and what the board makes of it", fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=9, loc="upper left")
