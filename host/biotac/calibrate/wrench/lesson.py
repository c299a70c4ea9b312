"""The lesson of a map that was fitted to a run: how the run's rows look to the map, and the default map's error on
these rows, which that map has not seen.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...core.compute import compute
from ...errors import InputError
from ...kernels.geometry import grip_parts
from ...map.fitted import WrenchMap
from ...map.lesson import Lesson, fit_lesson
from ...map.margin import Margin, fit_margin, published_parts
from ...map.population import likeness_of
from ...wire.frames import FORCE_LSB_PER_N, Q4_PER_COUNT, tare_to_q4
from ...wire.sensor_gen import FULL_SCALE_COUNT
from .plate_recording import Run

_FIRM_N = 1.0  # lighter touches' pressure is drift, too
_MOST_MN = 65534  # with too few rows for an estimate


def lesson_of(run: Run, fitted: WrenchMap) -> Lesson | None:
    """None for a map that no board can hold."""
    counts = np.clip(np.rint(run.counts), 0, FULL_SCALE_COUNT).astype(np.uint16)
    tare_q4 = tare_to_q4(np.broadcast_to(run.tare, counts.shape))
    pdc_q4 = np.zeros(len(counts), np.int32) if run.pdc is None else np.rint(run.pdc * Q4_PER_COUNT).astype(np.int32)
    late = np.clip(np.arange(len(counts)) - int(np.median(fitted.lag_rows)), 0, len(counts) - 1)
    force_n = run.truth[late, :3]
    try:
        seen = fitted.on_board().seen(counts, tare_q4, pdc_q4)
    except InputError:
        return None
    felt = compute(counts, np.clip(run.tare, 0, FULL_SCALE_COUNT))
    scale = float((felt["force_n"] * force_n).sum() / (felt["force_n"] ** 2).sum())
    parts, truth = published_parts(scale * felt["force_n"], felt["poc_mm"]), grip_parts(force_n, felt["poc_mm"])
    guess_n = likeness_of(counts, tare_q4).guess_n * scale
    margin = fit_margin(parts, truth, force_n, guess_n)
    margin = Margin((min(margin.base_mn[0], _MOST_MN), min(margin.base_mn[1], _MOST_MN)), margin.share_q8)
    normal_n, shear_n = published_parts(seen.force_100un / FORCE_LSB_PER_N, felt["poc_mm"]).T
    lesson = fit_lesson(seen, np.linalg.norm(force_n, axis=1), scale, margin, shear_n)
    firm = normal_n > _FIRM_N
    if run.pdc is None or not firm.any():
        return lesson
    per_n = np.median(run.pdc[firm] / normal_n[firm])
    return replace(lesson, counts_per_n=int(np.rint(per_n)) if 0.5 <= per_n < 255.5 else 0)
