"""Every kernel variant (tools/bench/variants): its error against the exact result, and its time against the others'.

Errors are distances to exact sums finished in extended precision (errors.c): over random frames of six classes, and
the worst that hill climbing finds. Times are ratios to the shipped kernel within one run: interleaved rounds, warmed
buffers, medians.
"""

from __future__ import annotations

import re
from dataclasses import asdict, dataclass
from functools import cache, partial
from pathlib import Path
from typing import Any

import cffi
import numpy as np
from numpy.typing import NDArray

import boards
from biotac.core.compiled import FORCE_GAINS, TORQUE_GAINS, default_settings
from biotac.lab.bench.timing import Contestant, timed
from biotac.wire.messages_gen import PocWeights

from . import limit, signals
from .limit import QUANTITIES, rms

ffi = cffi.FFI()
ffi.cdef(re.sub("^#.*", "", Path(__file__).with_name("errors.h").read_text(encoding="utf-8"), flags=re.MULTILINE))

WEIGHT_NAMES: dict[PocWeights, str] = dict(zip(PocWeights, boards.WEIGHTS, strict=True))
SHIPPED = "shipped"
Facts = dict[str, Any]
ROUNDS = 15
TIMED_FRAMES = 2000
SEED = 2013


@dataclass(frozen=True)
class Effort:
    """How hard to search for errors: frames per class, and hill climbing."""

    frames: int = 50_000
    restarts: int = 8
    steps: int = 10_000


@cache
def compiled() -> Any:
    """errors.c and the variants, compiled for this machine."""
    build = boards.BUILD / "accuracy"
    boards.command("cmake", "-S", boards.ROOT, "-B", build, "-DBIOTAC_BENCH=ON")
    boards.command("cmake", "--build", build, "--target", "biotac_errors")
    return ffi.dlopen(str(build / "tools" / "bench" / "libbiotac_errors.so"))


@cache
def names() -> list[str]:
    """The variants, in the order of the C table."""
    lib = compiled()
    return [ffi.string(lib.bt_kernel_name(k)).decode() for k in range(lib.bt_kernel_variants())]


def measure(effort: Effort) -> Facts:
    """Errors by quantity and time ratios of every variant, by name and weights, with the default gains; as JSON types.

    ``one_adc_step_at_1n`` has limit.one_step() by weights; a kernel may add up to ``budget_share`` of it.
    """
    variants: Facts = {name: {} for name in names()}
    limits = {}
    for weights, label in WEIGHT_NAMES.items():
        case = _case(weights)
        frames = _frames(weights, effort.frames)
        pressed = limit.frames_q4()
        ratios = _ratios(case, signals.bumps(np.random.default_rng(SEED), TIMED_FRAMES, weights))
        for index, name in enumerate(variants):
            found = {scene: _errors(index, case, e_q4) for scene, e_q4 in frames.items()}
            at_1n = _errors(index, case, pressed)
            errors = {
                quantity: _error(
                    at_1n[:, kind],
                    {scene: rows[:, kind] for scene, rows in found.items()},
                    _climb(index, case, kind, effort),
                )
                for kind, quantity in enumerate(QUANTITIES)
            }
            variants[name][label] = {"host_times_shipped": ratios[index], "errors": errors}
        limits[label] = limit.one_step(weights)
    return {
        "effort": asdict(effort),
        "quantities": QUANTITIES,
        "one_adc_step_at_1n": limits,
        "budget_share": limit.BUDGET_SHARE,
        "variants": variants,
    }


def _case(weights: PocWeights) -> Any:
    settings = default_settings()
    return ffi.new(
        "bt_kernel_case *",
        {
            "poc_weights": int(weights),
            "force_nn": [settings[s] for s in FORCE_GAINS],
            "torque_nn": [settings[s] for s in TORQUE_GAINS],
        },
    )


def _frames(weights: PocWeights, n: int) -> dict[str, signals.Signals]:
    random = np.random.default_rng([SEED, int(weights)])
    return {name: make(random, n, weights) for name, make in signals.CLASSES.items()}


def _errors(index: int, case: Any, e_q4: signals.Signals) -> NDArray[np.float64]:
    out = np.empty((len(e_q4), len(QUANTITIES)))
    rows = ffi.from_buffer("int32_t[]", e_q4), ffi.from_buffer("double[]", out)
    compiled().bt_kernel_errors(index, case, len(e_q4), *rows)
    return out


def _error(pressed: NDArray[np.float64], found: dict[str, NDArray[np.float64]], adversarial: float) -> Facts:
    """One quantity of one variant. ``unanswered`` is the share of frames with a point for which the variant gives none.

    ``at_1n`` is the RMS over the frames of limit.py, the only ones that the budget applies to. ``classes`` have RMS and
    maximum for each class of frames, 0 where no frame of it has such a result.
    """
    answered = {scene: column[np.isfinite(column)] for scene, column in found.items()}
    denied = sum(int(np.isinf(column).sum()) for column in found.values())
    everything = np.concatenate(list(answered.values()))
    classes = {scene: {"rms": rms(column), "max": float(column.max(initial=0.0))} for scene, column in answered.items()}
    max_in = max(classes, key=lambda scene: classes[scene]["max"])
    return {
        "at_1n": rms(pressed[np.isfinite(pressed)]),
        "rms": rms(everything),
        "max": classes[max_in]["max"],
        "max_in": max_in,
        "adversarial": adversarial,
        "unanswered": denied / max(denied + len(everything), 1),
        "classes": classes,
    }


def _climb(index: int, case: Any, kind: int, effort: Effort) -> float:
    return float(compiled().bt_kernel_climb(index, case, kind, SEED, effort.restarts, effort.steps))


def _ratios(case: Any, e_q4: signals.Signals) -> list[float]:
    """For each variant, its median time over that of the shipped kernel."""
    taken = (case, len(e_q4), ffi.from_buffer("int32_t[]", e_q4))
    runs = [partial(compiled().bt_kernel_run, index, *taken) for index in range(len(names()))]
    rows = timed([Contestant(name, len(e_q4), run) for name, run in zip(names(), runs, strict=True)], ROUNDS)
    return [row.median_ns / rows[names().index(SHIPPED)].median_ns for row in rows]
