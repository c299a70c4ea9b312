"""A hand calibrates itself (Navarro et al. 2015, III): it touches a force plate finger by finger, driven from here.

Each finger touches three times, harder each time; K is fitted and written to the board; then each touches a fourth
time, and the board's own force is compared with the plate's.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import numpy as np

from ...errors import InputError
from ...hand.hand import Hand
from ...hand.rounds import Round
from ...keep import Calibration
from ...recording.pressure_check import usable
from ...wire.frames import StructArray
from ...wire.messages_gen import INVALID_COUNT, FrameFlags
from .detector import Phase, Procedure
from .force_source import ROW_DTYPE
from .pressure import CALIBRATION_FORCES_N, VERIFICATION_FORCES_N, Calibrated, fit, verify
from .pressure_procedure import put, with_gain

#: Sends a finger, by name, to a touch, or with None back to where it touches nothing. It returns at once: the finger
#: moves while rounds come.
Move = Callable[[str, float | None], None]


def drive(
    hand: Hand,
    move: Move,
    plate_n: Callable[[], float],
    touches: Sequence[float],
    *,
    fingers: Sequence[str] = (),
    next_round: Callable[[], Round] | None = None,
) -> dict[str, Calibrated]:
    """K of each of ``fingers`` (none: all), by name; in force until the next reboot.

    ``touches`` are four values that ``move`` understands, such as newtons or the paper's joint angles: three with
    growing force, and the one that verifies. ``plate_n`` is asked after each round for the size of the force on the
    plate in N (Eq 2), NaN where unknown. ``next_round`` lets 10 ms pass: hand.next_round by default, a step of a
    simulated world. A finger always goes back at the end. Raises InputError for touches that are not four, an unknown
    finger, and presses that do not give K; a K that the fourth touch refutes is removed from the board again.
    """
    series = CALIBRATION_FORCES_N, VERIFICATION_FORCES_N  # only how many they are matters: ``touches`` say how hard
    if len(touches) != sum(map(len, series)):
        raise InputError(f"touches are {list(touches)}; expected four: three that grow, and the one that verifies")
    index = {hand[k].name: k for k in hand.fingers}
    names = {index[name]: name for name in fingers or index if name in index}
    if not names or len(names) < len(fingers):
        raise InputError(f"fingers are {list(fingers)}; expected some of {', '.join(index) or 'a sensor'}")
    last: Round | None = None

    def passed() -> Round:
        nonlocal last
        last = hand.next_round(last) if next_round is None else next_round()
        return last

    def through(procedure: Procedure, values: Sequence[float]) -> Procedure:
        shown = None
        try:
            while (step := procedure.step) is not None:
                if step != shown:
                    shown = step
                    move(names[step.finger], values[step.press - 1] if step.phase is Phase.PRESS else None)
                procedure.feed(_rows(passed(), plate_n))
        finally:
            if shown is not None:
                move(names[shown.finger], None)
        return procedure

    first = through(Procedure(list(names), series[0]), touches[:-1])
    fits = [fit(first.rests[finger], presses) for finger, presses in first.presses.items()]
    for why_not in filter(None, (fitted.why_not for fitted in fits)):
        raise InputError(why_not)
    hand.stop()  # a board accepts no calibration while it streams
    unset = Calibration().changed(hand.board.settings())
    before = {fitted.finger: hand.board.calibration(fitted.finger) or unset for fitted in fits}
    own = {fitted.finger: with_gain(hand, fitted, int(time.time())) for fitted in fits}
    for finger, calibration in own.items():
        put(hand, finger, calibration)
    hand.stream("results", "events")
    held = through(Procedure(list(names), series[1]), touches[-1:]).presses
    source = {"from": hand.port, "touches": list(touches)}
    found = [Calibrated(fit, verify(fit, held[fit.finger][0]), own[fit.finger], source) for fit in fits]
    wrong = [calibrated for calibrated in found if calibrated.why_not]
    if wrong:
        hand.stop()
        for calibrated in wrong:
            put(hand, calibrated.fit.finger, before[calibrated.fit.finger])
        hand.stream("results", "events")
        raise InputError("; ".join(calibrated.why_not for calibrated in wrong))
    return {names[calibrated.fit.finger]: calibrated for calibrated in found}


def _rows(now: Round, plate_n: Callable[[], float]) -> StructArray:
    frames = [finger.frame for finger in now.fingers.values() if finger.frame is not None]
    out = np.zeros(len(frames), ROW_DTYPE)
    for k, frame in enumerate(frames):
        touched = bool(frame.flags & (FrameFlags.CONTACT | FrameFlags.FAULT))
        numbers = frame.pdc_filtered, frame.pdc_tare, frame.pressure_force_n, plate_n()
        railed = frame.pdc != INVALID_COUNT and not usable(np.uint16(frame.pdc))
        out[k] = (frame.finger, frame.t_us, *numbers, frame.counts, frame.tare, touched, railed)
    return out
