"""biotac-lab slip"""

from __future__ import annotations

import argparse
from collections import defaultdict
from pathlib import Path
from typing import Any

import numpy as np

from biotac import EventKind, Finger, InputError
from biotac.core import geometry as surface
from biotac.grip import PENDING_ROUNDS, SLIPS_FROM_COUNTS
from biotac.sim import SimFinger, States, sample
from biotac.wire import messages, slots

from ..report import Outcome, Report, Show, Table, check, claim

ABOUT = (
    "Squeeze, poke, hold and slide simulated fingers, play recordings of real ones, and count what is called a slip."
)
EXAMPLE = "biotac-lab slip --fingers 10"
SLOW_N_S, FAST_N_S = (0.5, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0), (8.0, 10.0)
RATTLES = (1.25, 2.5, 5.0)  # counts of PAC in a squeeze of 1 N/s: the ends and the middle of biotac.sim's range
PLACES_MM = ((-3.0, 0.0), (-5.0, 5.0))  # on the pad and off it
REST_S, AGAIN_S, SOON_S, SLIDING_M_S, TAPPED, HELD_S = 3.0, 0.1, 0.05, 0.002, 95, 4.2
NO_LEVEL = 255  # in slip_level
SQUEEZED, RELEASED, CALM = "squeezed: SLIP", "let go: SLIP", ("at rest and in still holds: level 0", 99)
KNOWN = " as strong as biotac.grip awaits it"  # which knows that it squeezes
MOST = {SQUEEZED: (5, 20), RELEASED: (5, 20), SQUEEZED + KNOWN: (2, 2), RELEASED + KNOWN: (2, 2)}  # slow, fast
Found = dict[tuple[str, float, float], list[bool]]  # by kind of load, N/s and rattle


def add_arguments(parser: argparse.ArgumentParser) -> None:
    """Add how many fingers, and real recordings."""
    parser.add_argument("--fingers", type=int, default=10, metavar="N", help="simulated fingers (default 10)")
    parser.add_argument("--seed", type=int, default=101, metavar="N", help="of the first (default 101)")
    parser.add_argument("--slides", type=Path, metavar="NPZ", help="real slides: mM_K_frame, _t, _cv, _cv_t")
    parser.add_argument("--taps", type=Path, metavar="NPZ", help="real handovers: handover_X_signals (n, 600)")
    parser.add_argument("--check", action="store_true", help="exit 1 when a figure misses its limit")


def run(args: argparse.Namespace, show: Show) -> Outcome:
    """Squeeze, poke, hold and slide."""
    if args.fingers < 1:
        raise InputError(f"--fingers is {args.fingers}, expected 1 or more")
    found: Found = defaultdict(list)
    for seed in range(args.seed, args.seed + args.fingers):
        show(f"finger {seed}")
        for rattle, place in ((rattle, place) for rattle in RATTLES for place in PLACES_MM):
            finger = SimFinger(seed)
            finger.rattle_per_n_s = rattle
            _press(found, finger, place)
    percent = {key: 100 * float(np.mean(hits)) for key, hits in found.items()}
    kinds = sorted({(case, n_s) for case, n_s, _ in found})
    rows = [(case, n_s, *[percent[case, n_s, rattle] for rattle in RATTLES]) for case, n_s in kinds]
    tables = [Table("Simulated", ("% of", "N/s", *[f"rattle {rattle:g}" for rattle in RATTLES]), rows, digits=1)]
    checks = []
    for case, limits in MOST.items():
        for rates, limit in zip((SLOW_N_S, FAST_N_S), limits, strict=True):
            worst = max(np.mean([percent[case, n_s, rattle] for n_s in rates]) for rattle in RATTLES)
            checks.append(check(f"{case}, {rates[0]:g} to {rates[-1]:g} N/s", float(worst), limit, "%"))
    for case, n_s in kinds:
        if case not in (*MOST, "poked: SLIP"):
            seen, least = min(percent[case, n_s, rattle] for rattle in RATTLES), CALM[1] if case == CALM[0] else 80
            checks.append(claim(f"{case}, {n_s:g} N/s: {seen:.1f} %, at least {least}", seen >= least))
    for path, play in ((args.slides, _real_slides), (args.taps, _real_taps)):
        if path is not None:
            tables.append(Table(path.stem, ("real", ""), play(np.load(path)), digits=1))
    source = f"{args.fingers} simulated fingers from seed {args.seed}, on the pad and off it"
    return Report(source, tables, checks, [], lambda figure: None).outcome("slip", ABOUT)


def _felt(finger: SimFinger, at: tuple[float, float], *legs: tuple[float, float], mm_s: float = 0.0) -> Any:
    """When each of the legs (s, N at their end) ends after rest, and a SLIP came, in s; and each round's level.

    ``mm_s``: it slides for 0.3 s from 0.2 s into the third leg.
    """
    force_n, ends_s = np.zeros(round(REST_S * 100) + 1), [REST_S]
    for seconds, end_n in legs:
        force_n = np.append(force_n, np.linspace(force_n[-1], end_n, max(round(seconds * 100), 1) + 1)[1:])
        ends_s.append((len(force_n) - 1) / 100)
    n, none, slides = len(force_n), np.zeros(len(force_n)), np.zeros(len(force_n))
    slides[round(ends_s[2] * 100) + 20 :][:30] = mm_s
    contact = np.tile(surface.on_surface(np.array([at])), (n, 1))
    words = sample(finger, States(contact, force_n, np.zeros((n, 3)), none, none + 3.5, none, slides))
    channels = slots.ELECTRODE_SLOT, slots.PDC_SLOT, slots.TAC_SLOT, slots.TDC_SLOT, slots.PAC_SLOT
    given = [words[:, slot] for slot in channels]
    level = Finger(quantities=messages.QuantityFlags.EVENTS).feed(*given)["slip_level"]
    return ends_s, _times(Finger().events(*given))[0], level


def _times(events: Any) -> list[Any]:
    return [events["t_us"][events["kind"] == kind] / 1e6 for kind in (EventKind.SLIP, EventKind.STUCK)]


def _press(found: Found, finger: SimFinger, at: tuple[float, float]) -> None:
    rattle = finger.rattle_per_n_s
    for n_s in SLOW_N_S + FAST_N_S:
        high_n = 0.5 + min(3.0, max(n_s, 0.5))
        up = (high_n - 0.5) / n_s
        legs = (0.2, 0.5), (1.3, 0.5), (up, high_n), (0.6, high_n), (up, 0.5), (0.6, 0.5), (0.5 / n_s, 0), (0.5, 0)
        ends_s, slips_s, level = _felt(finger, at, *legs)
        for case, leg in ((SQUEEZED, 2), (RELEASED, 4), (RELEASED, 6)):
            during = (slips_s >= ends_s[leg]) & (slips_s < ends_s[leg + 1] + AGAIN_S)
            found[case, n_s, rattle].append(bool(during.any()))
            rounds = [level[int(at_s * 100) :][: PENDING_ROUNDS + 1] for at_s in slips_s[during]]
            strong = any((now[now < NO_LEVEL] >= SLIPS_FROM_COUNTS).any() for now in rounds)
            found[case + KNOWN, n_s, rattle].append(strong)
        still = [k for leg in (1, 3, 5) for k in range(round(ends_s[leg] * 100) + 20, round(ends_s[leg + 1] * 100))]
        found[CALM[0], 0, rattle] += (level[[*range(100, round(REST_S * 100)), *still]] == 0).tolist()
    for n_s, mm_s in ((n_s, mm_s) for n_s in (0.0, *SLOW_N_S[1:-1]) for mm_s in (5.0, 20.0)):
        high_n = 1.5 + 0.51 * n_s
        ends_s, slips_s, _ = _felt(finger, at, (0.3, 1.5), (1.3, 1.5), (0.51, high_n), (0.3, high_n), mm_s=mm_s)
        late_s = slips_s - ends_s[2] - 0.2
        reported = bool(((late_s > 0) & (late_s <= SOON_S)).any())
        found[f"slides at {mm_s:g} mm/s: told within 50 ms", n_s, rattle].append(reported)
    for n_s in (10.0, 30.0, 100.0):
        reported = len(_felt(finger, at, (2 / n_s, 2.0), (0.15, 2.0), (2 / n_s, 0), (0.5, 0))[1]) > 0
        found["poked: SLIP", n_s, rattle].append(reported)


def _long_held(pac: Any) -> tuple[Any, Any, Any]:
    """Counts, PDC and PAC of a finger that has held something for HELD_S, with PAC (n, 22) as ``pac`` from then on."""
    rounds = round(100 * HELD_S)
    counts, pdc = np.full((rounds + len(pac), 19), 3000), np.full(rounds + len(pac), 1326)
    counts[300:, :6], pdc[300:] = 2900, 1386
    quiet = np.full((rounds, 22), int(np.median(pac[0])))
    return counts, pdc, np.concatenate([quiet, pac]).astype(np.uint16)


def _held_times(counts: Any, pdc: Any, pac: Any) -> list[Any]:
    """When, in s after HELD_S, such a finger reports SLIP and STUCK."""
    return [times - HELD_S for times in _times(Finger().events(counts, pdc, pac=pac))]


def _real_slides(data: Any) -> list[tuple[str, Any]]:
    slid, late_ms, levels = list[bool](), list[float](), list[int]()
    for trial in sorted(name[: -len("frame")] for name in data.files if name.endswith("_frame")):
        t_s, at_s = data[f"{trial}t"], data[f"{trial}cv_t"]
        speed_m_s = np.linalg.norm(data[f"{trial}cv"][:, :3], axis=1)
        pac = data[f"{trial}frame"][:, 3:25]
        counts, pdc, words = _long_held(pac)
        begin_s, end_s = _held_times(counts, pdc, words)
        level = Finger(quantities=messages.QuantityFlags.EVENTS).feed(counts, pdc, pac=words)["slip_level"][-len(pac) :]
        levels += [int(level[round_ : round_ + 3].max()) for round_ in (begin_s * 100).astype(int)]
        ends_s = (np.arange(len(t_s)) + 1) / 100
        slips = np.searchsorted(begin_s, ends_s) > np.searchsorted(end_s, ends_s)
        slid += slips[np.interp(t_s, at_s, speed_m_s) > SLIDING_M_S].tolist()
        onset_s = at_s[speed_m_s > SLIDING_M_S][0]
        if onset_s > 0.03:  # else it slides as the recording begins
            late_ms.append(1e3 * (t_s[0] + begin_s[0] - onset_s) if len(begin_s) else np.inf)
    late = np.abs(late_ms)
    within = [(f"onsets within {ms} ms of {len(late)}", int((late <= ms).sum())) for ms in (30, 50)]
    strong = [("level in the first three rounds, exceeded by 95 %", float(np.percentile(levels, 5)))]
    return [("sliding reported, %", 100 * float(np.mean(slid))), *within, ("latest, ms", max(late_ms)), *strong]


def _real_taps(data: Any) -> list[tuple[str, Any]]:
    pac = np.concatenate([data[name] for name in data.files if name.endswith("_signals")])[:, :594].astype(int)
    first_s = np.array(
        [min(_held_times(*_long_held(np.clip(2038 + tap.reshape(-1, 22), 0, 4095)))[0], default=np.inf) for tap in pac]
    )
    shares = [100 * float(np.mean(first_s < before_s)) for before_s in (np.inf, TAPPED / 2200)]
    return [("handovers", len(pac)), ("with a SLIP, %", shares[0]), ("before the tap, %", shares[1])]
