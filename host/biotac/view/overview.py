"""A whole recording for the page: how hard it was touched over time, with marks."""

from __future__ import annotations

from typing import Any

import numpy as np

from ..recording.reader import Recording

BINS = 600
EVENTS = 3000  # half an hour of touches each second


def overview(recording: Recording) -> dict[str, Any]:
    """``peaks_n``: the largest force of any finger in each of BINS equal times; ``marks``: labels, gaps, events."""
    begin_us, length_us = recording.begin_us, max(1, recording.end_us - recording.begin_us)
    force_n = np.nan_to_num(np.linalg.norm(recording.frames["force_n"], axis=1))
    peaks = np.zeros(BINS)
    at = np.clip((recording.frames["t_us"] - begin_us) * BINS // length_us, 0, BINS - 1)
    np.maximum.at(peaks, at, force_n)
    marks: list[dict[str, Any]] = [
        {"at_s": (max(label.t_us or begin_us, begin_us) - begin_us) / 1e6, "finger": label.finger, "name": label.line()}
        for label in recording.labels
    ]
    fingers: dict[tuple[int, str], list[int]] = {}  # one mark for a whole hand's touches within a tenth of a second
    for finger, kind, t_us in recording.events()[["finger", "kind", "t_us"]].tolist():
        fingers.setdefault(((t_us - begin_us) // 100_000, kind.lower()), []).append(finger)
    for (tenth, name), felt in list(fingers.items())[:EVENTS]:
        touched = " ".join(str(finger) for finger in sorted({*felt}))
        marks.append({"at_s": tenth / 10, "finger": None, "name": f"{name}, finger {touched}"})
    for gap in recording.gaps:
        marks.append(
            {
                "at_s": ((gap.next_t_us or gap.last_t_us or begin_us) - begin_us) / 1e6,
                "finger": None,
                "name": gap.line(),
            }
        )
    marks.sort(key=lambda mark: mark["at_s"])
    return {"length_s": length_us / 1e6, "peaks_n": np.round(peaks, 2).tolist(), "marks": marks}
