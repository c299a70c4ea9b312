"""The demo's picture: the unrolled fingertip with its PoC, and force over time against the truth."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..core.unroll import unroll
from ..picture import picture
from ..sim.source import Source
from ..wire import messages_gen as wire
from ..wire import sensor_gen as sensor
from ..wire.batches import Batch
from ..wire.frames import electrode_signals
from .demo_answers import Answers

AXIS_COLORS = ("#c2410c", "#15803d", "#1d4ed8")  # x, y, z: dark enough for white paper


def draw(source: Source, batch: Batch, source_rows: NDArray[np.int64], answers: Answers, path: Path) -> None:
    """Write a PNG of finger 0; ``source_rows`` (n,) says which row of the source each frame is."""
    mine = batch.frames["finger"] == 0
    frames, messages = batch.frames[mine], batch.wire[mine]
    with picture(path) as figure:
        figure.set_size_inches(13, 5.6)
        axes = figure.subplots(1, 2, width_ratios=(1, 1.9))
        figure.suptitle(f"{source.name}: finger 0 through the simulated board")
        draw_fingertip(figure, axes[0], frames, messages)
        lin_n, calibrated_n = answers.lin_n[mine], answers.calibrated_n[mine]
        draw_force(axes[1], source, frames, source_rows[mine], replace(answers, lin_n=lin_n, calibrated_n=calibrated_n))


def draw_fingertip(figure: Any, axes: Any, frames: Any, messages: Any) -> None:
    """Electrodes at the strongest moment, and every PoC of the contacts."""
    electrodes = np.array(sensor.ELECTRODE_UM) / 1000
    across, along = unroll(electrodes)
    signals = np.nan_to_num(electrode_signals(messages)) if len(messages) else np.zeros((1, 19))
    tared = (frames["flags"] & wire.FrameFlags.UNTARED) == 0
    energy = np.where(tared, (signals**2).sum(axis=1), 0.0) if len(messages) else np.zeros(1)
    strongest = int(np.argmax(energy))
    limit = max(float(np.abs(signals[strongest]).max()), 1.0)
    dots = axes.scatter(
        across, along, c=signals[strongest], s=520, cmap="RdBu", vmin=-limit, vmax=limit, edgecolors="#444444"
    )
    for name, a, b in zip(sensor.ELECTRODE_NAMES, across, along, strict=True):
        axes.annotate(name, (a, b), ha="center", va="center", fontsize=7)
    flags = frames["flags"]
    contact = ((flags & wire.FrameFlags.CONTACT) != 0) & ((flags & wire.FrameFlags.POC_LOW) == 0)
    poc_across, poc_along = unroll(frames["poc_mm"][contact])
    axes.plot(poc_across, poc_along, ".", color="#7c3aed", markersize=3, alpha=0.5, label="point of contact")
    if len(frames) and contact.any():
        a, b = unroll(frames["poc_mm"][strongest : strongest + 1])
        axes.plot(a, b, "x", color="#7c3aed", markersize=13, markeredgewidth=3, label="at the strongest moment")
        axes.set_title(f"electrodes at {frames['t_us'][strongest] / 1e6:.2f} s", fontsize=10)
    axes.set(xlabel="around the finger [mm], + is E11's side", ylabel="along the finger [mm], tip up")
    axes.set_aspect("equal")
    axes.margins(0.15)
    axes.legend(loc="lower center", bbox_to_anchor=(0.5, 1.06), fontsize=8, ncols=2, frameon=False)
    figure.colorbar(dots, ax=axes, shrink=0.7, label="signal [count]: compressed < 0 < bulged")


def draw_force(axes: Any, source: Source, frames: Any, rows: NDArray[np.int64], answers: Answers) -> None:
    """Force on the finger over device time by both answers, with the source's own force behind them."""
    t_s = frames["t_us"] / 1e6
    truth_n = source.known_force_n
    for axis, color in enumerate(AXIS_COLORS):
        if truth_n is not None:
            truth = truth_n[rows, 0, axis]
            axes.plot(t_s, truth, color=color, linewidth=4, alpha=0.25, label=f"{'xyz'[axis]}, truth")
        axes.plot(t_s, answers.lin_n[:, axis], ":", color=color, linewidth=1, label=f"{'xyz'[axis]}, Lin")
        axes.plot(t_s, answers.calibrated_n[:, axis], color=color, linewidth=1, label=f"{'xyz'[axis]}, calibrated")
    contact = (frames["flags"] & wire.FrameFlags.CONTACT) != 0
    axes.fill_between(
        t_s, 0, 1, where=contact, transform=axes.get_xaxis_transform(), color="#000000", alpha=0.06, label="contact"
    )
    axes.set(xlabel="device time [s]", ylabel="force on the finger [N]")
    words = f"force: calibrated (thin: {answers.calibrated_by}), Lin's scales as shipped (dotted)"
    axes.set_title(f"{words}, truth (broad)" if truth_n is not None else words, fontsize=10)
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8, ncols=5, loc="upper center", bbox_to_anchor=(0.5, -0.12), frameon=False)
