"""PNG: force and pressure of all fingers over time, with labels and gaps."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..picture import picture
from ..recording.reader import Recording
from .columns import Show, Table

KINDS_APART = False
_COLOURS = ("C0", "C1", "C2", "C3", "C4")


def write(path: Path, made: list[Table], recording: Recording, show: Show) -> None:
    """Draw it. Texts of labels that would overprint are omitted; `biotac info` has them all."""
    begin_us, end_us = recording.begin_us, recording.end_us
    name_of = {finger: name for name, finger in recording.names.items()}
    with picture(path) as page:
        page.set_size_inches(12, 6)
        force, pressure = axes = page.subplots(2, 1, sharex=True)
        for k, table in enumerate(made):
            show(k / len(made))
            if table.kind != "frames":
                continue
            t_s = (table.arrays["t_us"] - begin_us) / 1e6
            finger = table.finger or 0
            name = name_of.get(finger, str(finger))
            force.plot(t_s, np.linalg.norm(table.arrays["force_n"], axis=1), _COLOURS[finger], lw=0.8, label=name)
            if recording.applied_n is not None:
                applied_n = np.linalg.norm(recording.applied_n[recording.frames["finger"] == finger], axis=1)
                force.plot(t_s, applied_n, _COLOURS[finger], lw=4, alpha=0.25, label=f"{name}, applied")
            rest = np.nanmedian(table.arrays["pdc_tare"]) if np.isfinite(table.arrays["pdc_tare"]).any() else 0.0
            pdc = np.where(table.arrays["pdc"] == 65535, np.nan, table.arrays["pdc"] - rest)
            pressure.plot(t_s, pdc, _COLOURS[finger], lw=0.8)
        for gap in recording.gaps:  # after a restart, the rows before it are of another clock and in another file
            last_us = None if gap.reason == "rebooted" else gap.last_t_us
            if last_us is not None:
                until_us = gap.next_t_us if gap.next_t_us is not None else last_us + gap.seconds * 1e6
                for axis in axes:
                    axis.axvspan((last_us - begin_us) / 1e6, (until_us - begin_us) / 1e6, color="0.85")
        free_s = [-np.inf, -np.inf]  # of two rows of texts
        for label in (label for label in recording.labels if label.t_us is not None):
            times_us = (label.t_us or 0, label.end_us or label.t_us or 0)
            at_s, until_s = (max(0, t_us - begin_us) / 1e6 for t_us in times_us)
            for axis in axes:
                axis.axvspan(at_s, until_s, color="C5", alpha=0.25)
            row = 0 if at_s >= free_s[0] else 1
            if at_s >= free_s[row]:
                up = 1.0 + 0.06 * row
                force.text(at_s, up, label.text, transform=force.get_xaxis_transform(), va="bottom", fontsize=8)
                free_s[row] = at_s + len(label.text) * (end_us - begin_us) / 1e6 / 150  # as wide as the letters
        force.set_title(recording.path.name, pad=28)
        force.set(ylabel="size of the force on the finger, N")
        force.legend(loc="upper right")
        pressure.set(xlabel="time, s", ylabel="pressure above rest, count")
